//! Every search on every form of Model (31), and on the field model, over several seeds, at equal
//! numbers of evaluations.
//!
//! Each seed draws its own rows, as `fit --seed` does, and every solver gets the same rows and the
//! same first population (CMA-ES has none: it gets the first individual, or the middle). The
//! floor of a seed is the fitness of the least-squares fit on these rows; it stands in the
//! table as `lm`. A search has arrived once its best fitness is within 1 % of the floor, and is
//! exact once within 5e-7 (1e-6 of the sum of squares).
//! Times are of this machine, of one search after the other.
//!
//! | module | what it holds |
//! |---|---|
//! | `field` | runs on the field model |
//! | [`summary`] | medians and spreads, the table |
//! | [`curves`] | convergence and course of p, as CSV and SVG |

pub mod curves;
mod field;
pub mod summary;

use crate::fit::{FitError, calibration};
use crate::input::dataset::Dataset;
use crate::input::stage::Stage;
use crate::judge::identify::check_motion;
use crate::judge::{Decoded, Zeros};
use crate::problem::Problem;
use crate::problem::draw::{Draw, draw_rows};
use crate::problem::model::Model;
use crate::solve::by_search::solution_of;
use crate::solve::objective::form::Form;
use crate::solve::search::cost::CostFunction;
use crate::solve::search::kind::{SearchKind, Settings};
use crate::solve::search::run::{Checkpoint, Outcome, Start, StopCriteria};
use crate::solve::{Projection, Solution, SolveError, Solver, SolverOptions};
use runtime::calibration::Origin;
use runtime::{Calibration, ModelKind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// Share above the floor at which a search has arrived.
pub const ARRIVED: f64 = 0.01;
/// Share above the floor at which it is exact: 1e-6 of the sum of squares.
pub const EXACT: f64 = 5e-7;
/// Name of the least-squares fit in tables and files.
pub const LEAST_SQUARES: &str = "lm";

/// What the searches look for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Case {
    /// Model (31), with so much of it in closed form.
    Model31(Projection),
    /// The field model, all but the nine ratios of a, b, c to eta in closed form. Its fitness is
    /// that of [`FieldCost`](crate::solve::field::search::FieldCost), um of the Hall signals.
    Field,
}

impl Case {
    /// All of them.
    pub const ALL: [Self; 4] = [
        Self::Model31(Projection::None),
        Self::Model31(Projection::Delta),
        Self::Model31(Projection::Linear),
        Self::Field,
    ];

    /// Its name on the command line, in tables and files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Model31(projection) => projection.name(),
            Self::Field => "field",
        }
    }
}

/// What is compared.
#[derive(Clone, Debug, PartialEq)]
pub struct Comparison {
    /// The forms of the problem.
    pub forms: Vec<Case>,
    /// The searches.
    pub searches: Vec<SearchKind>,
    /// Seeds 1 to this.
    pub seeds: u64,
    /// Rows drawn by each seed; all if `None`.
    pub train: Option<usize>,
    /// How they are drawn.
    pub draw: Draw,
    /// Evaluations of each run.
    pub evaluations: usize,
    /// Np.
    pub population: usize,
}

/// One solver on one form with one seed.
#[derive(Clone, Debug, PartialEq)]
pub struct Run {
    /// The form.
    pub form: Case,
    /// Name of the solver.
    pub solver: &'static str,
    /// The seed of rows and search.
    pub seed: u64,
    /// Fitness over the rows that the run used, um, um, urad.
    pub fitness: f64,
    /// Fitness of the least-squares fit on the same rows.
    pub floor: f64,
    /// Evaluations made.
    pub evaluations: usize,
    /// How many of them had no cost.
    pub nan_costs: usize,
    /// Time of the run, s.
    pub elapsed_s: f64,
    /// rms of X, Y, Rz over all rows of the logs by the target's decoder, zero deviations
    /// refitted, um, um, urad; `None` where the parameters cannot serve a decoder.
    pub rms: Option<[f64; 3]>,
    /// The course of the search; empty for least squares.
    pub history: Vec<Checkpoint>,
}

impl Run {
    /// Evaluations until the best fitness was within `share` of the floor, to the end of the
    /// generation.
    pub fn evaluations_to(&self, share: f64) -> Option<usize> {
        let target = self.floor * (1.0 + share);
        if self.history.is_empty() {
            return (self.fitness <= target).then_some(self.evaluations);
        }
        let first = self
            .history
            .iter()
            .find(|point| point.best_cost <= target)?;
        Some(first.evaluations)
    }

    /// The same in s, by the run's mean time of an evaluation.
    pub fn seconds_to(&self, share: f64) -> Option<f64> {
        Some(self.elapsed_s * self.evaluations_to(share)? as f64 / self.evaluations.max(1) as f64)
    }
}

/// Makes all runs, form after form, solver after solver; `done` is told of each. Ends early,
/// with what there is, once `interrupt` is set.
///
/// # Errors
/// [`FitError::Failed`] when the rows cannot determine Model (31), [`FitError::Solver`] when the
/// least-squares fit, which gives the floor, fails.
pub fn compare(
    dataset: &Dataset,
    stage: &Stage,
    comparison: &Comparison,
    interrupt: &AtomicBool,
    mut done: impl FnMut(&Run),
) -> Result<Vec<Run>, FitError> {
    let model = Model::of(ModelKind::M31);
    let all = dataset.rows.len();
    let count = comparison.train.unwrap_or(all).min(all);
    check_motion(dataset, stage, count, model)?;
    let draw = |seed| draw_rows(dataset, count, comparison.draw, seed);
    let drawn: Vec<Vec<usize>> = (1..=comparison.seeds).map(draw).collect();
    let problem = |rows: &[usize]| Problem::new(dataset, rows, stage, model);
    let mut runs = Vec::new();
    for &form in &comparison.forms {
        let mut floors = Vec::new();
        for (seed, rows) in (1..).zip(&drawn) {
            let problem = problem(rows);
            let run = match form {
                Case::Model31(form) => least_squares(dataset, &problem, form, seed)?,
                Case::Field => field::least_squares(dataset, rows, &problem, seed)?,
            };
            floors.push(run.floor);
            done(&run);
            runs.push(run);
        }
        for &search in &comparison.searches {
            for ((seed, rows), &floor) in (1..).zip(&drawn).zip(&floors) {
                if interrupt.load(Ordering::Relaxed) {
                    return Ok(runs);
                }
                let problem = problem(rows);
                let job = Job {
                    search,
                    seed,
                    floor,
                    comparison,
                };
                let run = match form {
                    Case::Model31(form) => job.of_form(dataset, &problem, form),
                    Case::Field => job.of_field(dataset, rows, &problem)?,
                };
                runs.extend(run.inspect(&mut done));
            }
        }
    }
    Ok(runs)
}

fn least_squares(
    dataset: &Dataset,
    problem: &Problem<'_>,
    form: Projection,
    seed: u64,
) -> Result<Run, SolveError> {
    let options = SolverOptions::new(form, seed);
    let solution = Solver::LeastSquares.solve(problem, &options)?;
    let fitness = problem.fitness(solution.cost);
    Ok(Run {
        form: Case::Model31(form),
        solver: LEAST_SQUARES,
        seed,
        fitness,
        floor: fitness,
        evaluations: usize::try_from(solution.evaluations).unwrap_or(usize::MAX),
        nan_costs: 0,
        elapsed_s: solution.elapsed.as_secs_f64(),
        rms: rms_over_all_rows(dataset, problem, &solution),
        history: Vec::new(),
    })
}

/// One search with one seed.
struct Job<'c> {
    search: SearchKind,
    seed: u64,
    floor: f64,
    comparison: &'c Comparison,
}

impl Job<'_> {
    /// On a form of Model (31); `None` where the form has no unknowns to search for.
    fn of_form(
        &self,
        dataset: &Dataset,
        problem: &Problem<'_>,
        projection: Projection,
    ) -> Option<Run> {
        let form = Form::new(problem, projection)?;
        let first = form.first_population(self.comparison.population, self.seed);
        let (found, run) = self.run(Case::Model31(projection), form.cost_function(), &first);
        let solution = solution_of(problem, &form, &found).ok();
        Some(Run {
            rms: solution.and_then(|solution| rms_over_all_rows(dataset, problem, &solution)),
            ..run
        })
    }

    /// What a search finds, and its run, which nothing has decoded yet.
    fn run(&self, form: Case, cost: &dyn CostFunction, first: &[Vec<f64>]) -> (Outcome, Run) {
        let settings = Settings {
            seed: self.seed,
            start: Start {
                population: self.comparison.population,
                individuals: first,
            },
            ..Settings::default()
        };
        let criteria = StopCriteria {
            evaluations: Some(self.comparison.evaluations),
            ..StopCriteria::default()
        };
        let started = Instant::now();
        let mut found = self.search.minimize(cost, &settings, &criteria);
        let run = Run {
            form,
            solver: self.search.name(),
            seed: self.seed,
            fitness: found.cost,
            floor: self.floor,
            evaluations: found.evaluations,
            nan_costs: found.nan_costs,
            elapsed_s: started.elapsed().as_secs_f64(),
            rms: None,
            history: std::mem::take(&mut found.history),
        };
        (found, run)
    }
}

/// Errors over all rows, by the decoder of the target, um, um, urad.
fn rms_over_all_rows(
    dataset: &Dataset,
    problem: &Problem<'_>,
    solution: &Solution,
) -> Option<[f64; 3]> {
    let calibration = calibration(
        &dataset.rows,
        problem.stage,
        problem.model,
        &solution.parameters,
    )
    .ok()?;
    rms_of(dataset, problem.stage, &calibration)
}

fn rms_of(dataset: &Dataset, stage: &Stage, calibration: &Calibration) -> Option<[f64; 3]> {
    let set = calibration.prepare(&Origin::default()).ok()?;
    let judgement = Decoded::new(&set, dataset).judge(dataset, stage, Zeros::Refit);
    Some(judgement.errors.axes.map(|axis| axis.rms * 1e6))
}

#[cfg(test)]
#[path = "tests.rs"]
mod tests;
