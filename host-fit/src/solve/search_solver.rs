//! The population searches as solvers of the fit.
//!
//! [`PopulationSolver`] runs a search on the form of the problem that the user chose. With a
//! finish (the program's default, `shtlbo-lm`) the search runs on a few hundred rows, evenly
//! from each movement, until it hardly improves; what it found and the designed geometry are
//! then the starts of the least-squares fit on all rows. So the result is the least-squares
//! optimum whatever the seed, and the search guards against a start that leads nowhere.

use crate::problem::Problem;
use crate::problem::parameters::Parameters;
use crate::solve::least_squares::coordinates::Boxed;
use crate::solve::least_squares::multistart::{LeastSquares, thinned};
use crate::solve::objective::delta::DeltaCost;
use crate::solve::objective::form::{Form, best_delta_m};
use crate::solve::search::cost::CostFunction;
use crate::solve::search::kind::{SearchKind, Settings};
use crate::solve::search::run::{Outcome, Stall, Start, StopCriteria};
use crate::solve::{Projection, Solution, SolveError, Solver, SolverOptions};
use runtime::ModelKind;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

/// Rows for a search that a least-squares fit finishes.
const FEW_ROWS: usize = 400;
/// When a search that is finished by least squares has found the right neighbourhood.
const NEAR: Stall = Stall {
    generations: 8,
    relative_decline: 1e-4,
};
/// When a search on the form `linear` is at the optimum: to 5e-7 of the fitness on each of 200
/// seeds tried.
const EXACT: Stall = Stall {
    generations: 20,
    relative_decline: 1e-7,
};

/// Name of SHTLBO with a least-squares finish.
pub const FINISHED: &str = "shtlbo-lm";

/// Np and Gm for a form if the user names none: those of the paper, but for `linear`, whose nine
/// unknowns want a smaller population, and as many generations as it takes.
pub const fn default_size(projection: Projection) -> (usize, usize) {
    match projection {
        Projection::None | Projection::Delta => (100, 100),
        Projection::Linear => (16, 1000),
    }
}

/// A population search, with or without a least-squares finish.
#[derive(Clone, Debug)]
pub struct PopulationSolver {
    /// The search.
    pub kind: SearchKind,
    /// Whether a least-squares fit follows.
    pub finish: bool,
    /// Set by Ctrl-C: the search then ends and keeps the best so far.
    pub interrupt: Option<&'static AtomicBool>,
    /// Known parameters to start from, such as those of an earlier blob.
    pub known: Option<Parameters>,
}

impl PopulationSolver {
    /// The solver of a name: that of a search, or [`FINISHED`].
    pub fn by_name(name: &str) -> Option<Self> {
        let finish = name == FINISHED;
        let kind = if finish {
            SearchKind::Shtlbo
        } else {
            SearchKind::by_name(name)?
        };
        Some(Self {
            kind,
            finish,
            interrupt: None,
            known: None,
        })
    }

    fn search(&self, form: &Form<'_>, problem: &Problem<'_>, options: &SolverOptions) -> Outcome {
        let known = self.known.iter();
        let mut first: Vec<Vec<f64>> = known.map(|p| form.individual(p, problem)).collect();
        first.extend(form.first_population(options.population, options.seed));
        let settings = Settings {
            seed: options.seed,
            start: Start {
                population: options.population,
                individuals: &first,
            },
            ..Settings::default()
        };
        // The other forms fall in steps with long rests between them.
        let stall = match (self.finish, options.projection) {
            (true, _) => Some(NEAR),
            (false, Projection::Linear) => Some(EXACT),
            (false, Projection::None | Projection::Delta) => None,
        };
        let criteria = StopCriteria {
            generations: Some(options.generations),
            stall,
            interrupt: self.interrupt,
            ..StopCriteria::default()
        };
        self.kind.minimize(form, &settings, &criteria)
    }

    /// Search on few rows, then least squares on all.
    fn solve_with_finish(
        &self,
        problem: &Problem<'_>,
        options: &SolverOptions,
    ) -> Result<Solution, SolveError> {
        let few = thinned(problem, FEW_ROWS);
        // Where nothing nonlinear is left to search for, least squares alone is exact.
        let form = match options.projection {
            Projection::Linear if problem.model == ModelKind::M12 => Projection::Delta,
            other => other,
        };
        let Some(form) = Form::new(&few, form) else {
            return LeastSquares.solve(problem, options);
        };
        let found = self.search(&form, &few, options);
        let mut starts: Vec<Parameters> = Vec::new();
        if found.cost.is_finite() {
            starts.extend(form.parameters(&found.best));
        }
        starts.extend(self.known);
        starts.push(middle_of_the_box(problem));
        let mut solution = LeastSquares.solve_from(&starts, problem, options)?;
        solution.evaluations += found.evaluations as u64;
        solution.stopped = format!("search: {}; finish: {}", found.reason, solution.stopped);
        Ok(solution)
    }
}

/// The designed geometry with sensitivities from the middle of their ranges.
fn middle_of_the_box(problem: &Problem<'_>) -> Parameters {
    let mut middle = Parameters::designed(problem.stage);
    if problem.model.has_sensitivity() {
        let ranges = problem.stage.search.of("eta").unwrap_or_default();
        for (sensitivity, range) in middle.sensitivity.iter_mut().zip(ranges) {
            sensitivity.eta = 0.5 * (range.low + range.high);
        }
    }
    middle
}

impl Solver for PopulationSolver {
    fn name(&self) -> &'static str {
        if self.finish {
            FINISHED
        } else {
            self.kind.name()
        }
    }

    fn solve(&self, problem: &Problem, options: &SolverOptions) -> Result<Solution, SolveError> {
        let started = Instant::now();
        let mut solution = if self.finish {
            self.solve_with_finish(problem, options)?
        } else {
            let form = Form::new(problem, options.projection).ok_or(SolveError::Unsupported {
                solver: self.name(),
                model: problem.model.equation(),
                projection: options.projection.name(),
                reason: "in this form only Model (31) has unknowns left to search for: \
                         use --project delta or none, or --solver lm",
            })?;
            let found = self.search(&form, problem, options);
            solution_of(problem, &form, &found)?
        };
        solution.elapsed = started.elapsed();
        Ok(solution)
    }
}

/// What a search found, within the search box.
///
/// # Errors
/// [`SolveError::NoUsableStart`] when no individual had a cost, [`SolveError::NoPlanarMotion`]
/// when the best gain is singular.
pub fn solution_of(
    problem: &Problem<'_>,
    form: &Form<'_>,
    found: &Outcome,
) -> Result<Solution, SolveError> {
    if !found.cost.is_finite() {
        return Err(SolveError::NoUsableStart);
    }
    let best = form
        .parameters(&found.best)
        .ok_or(SolveError::NoPlanarMotion)?;
    let boxed = Boxed {
        stage: problem.stage,
        model: problem.model,
    };
    let mut parameters = best;
    let mut fitness = found.cost;
    // The linear form knows no box of lever arms, angles and eta: bring its result back.
    if let Form::Linear(_) = form {
        parameters = boxed.clipped(&best);
        if parameters != best {
            let delta = DeltaCost::new(problem);
            fitness = delta.cost(&delta.individual(&parameters));
        }
    }
    let own = form.own_delta_m(&found.best);
    Ok(Solution {
        delta_m: own.unwrap_or_else(|| best_delta_m(problem, &parameters)),
        parameters,
        cost: fitness * fitness * 3.0 * problem.rows.len() as f64,
        evaluations: found.evaluations as u64,
        elapsed: std::time::Duration::ZERO,
        stopped: format!(
            "{}; {} of {} evaluations had no cost",
            found.reason, found.nan_costs, found.evaluations
        ),
        at_limit: boxed.at_limit(&parameters),
    })
}

#[cfg(test)]
#[path = "search_solver_tests.rs"]
mod tests;
