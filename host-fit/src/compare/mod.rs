//! Every search on every form of Model (31) over several seeds, at equal numbers of evaluations.
//!
//! Each seed draws its own rows, as `fit --seed` does, and every solver gets the same rows and the
//! same first population. The floor of a seed is the fitness of the least-squares fit on these rows;
//! it stands in the table as `lm`. A search has arrived once its best fitness is within 1 % of the
//! floor, and is exact once within 5e-7 (1e-6 of the sum of squares).
//! Times are of this machine, of one search after the other.
//!
//! | module | what it holds |
//! |---|---|
//! | [`table`] | medians and ranges over the seeds |
//! | [`curves`] | convergence and course of p, as CSV and SVG |

pub mod curves;
pub mod table;

use crate::cli::arguments::{choice, train};
use clap::Args;
use hallstage_calibration::fit::{FitError, calibration};
use hallstage_calibration::judge::identify::check_motion;
use hallstage_calibration::judge::{Decoded, Zeros};
use hallstage_input::dataset::Dataset;
use hallstage_input::stage::Stage;
use hallstage_solver::problem::Problem;
use hallstage_solver::problem::draw::{Draw, draw_rows};
use hallstage_solver::problem::model::Model;
use hallstage_solver::solve::by_search::solution_of;
use hallstage_solver::solve::objective::Objective;
use hallstage_solver::solve::search::kind::SearchKind;
use hallstage_solver::solve::search::run::{Checkpoint, Start, StopCriteria};
use hallstage_solver::solve::{Projection, Solution, Solver, SolverOptions};
use runtime::ModelKind;
use runtime::calibration::Origin;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// Share above the floor at which a search has arrived.
pub const ARRIVED: f64 = 0.01;
/// Share above the floor at which it is exact: 1e-6 of the sum of squares.
pub const EXACT: f64 = 5e-7;
/// Name of the least-squares fit in tables and files.
pub const LEAST_SQUARES: &str = "lm";

/// What is compared.
#[derive(Clone, Debug, PartialEq, Args)]
pub struct Comparison {
    /// Forms of the problem, separated by commas.
    #[arg(
        long = "project",
        value_name = "PROJECT",
        value_parser = choice::<Projection>(),
        value_delimiter = ',',
        default_value = "none,delta,linear"
    )]
    pub forms: Vec<Projection>,
    /// Searches, separated by commas; all if not given. Least squares is always there.
    #[arg(long = "solvers", value_name = "NAMES", value_delimiter = ',', default_values = SearchKind::ALL.map(SearchKind::name), value_parser = choice::<SearchKind>())]
    pub searches: Vec<SearchKind>,
    /// Runs of each: seeds 1 to N.
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = clap::value_parser!(u64).range(1..=10_000))]
    pub seeds: u64,
    /// Rows that each seed draws: `all` or a number.
    #[arg(long, value_name = "N|all", default_value = "200", value_parser = train)]
    pub train: std::option::Option<usize>,
    /// How rows are drawn.
    #[arg(long, value_parser = choice::<Draw>(), default_value = "stratified")]
    pub draw: Draw,
    /// Evaluations of each run; the paper's are 100 + 100 generations of 200.
    #[arg(long, value_name = "N", default_value_t = 20_100, value_parser = clap::value_parser!(u32).range(4..=1_000_000_000))]
    pub evaluations: u32,
    /// Individuals of a population.
    #[arg(long, value_name = "N", default_value_t = 100, value_parser = clap::value_parser!(u32).range(4..=100_000))]
    pub population: u32,
}

/// One solver on one form with one seed.
#[derive(Clone, Debug, PartialEq)]
pub struct Run {
    /// The form.
    pub form: Projection,
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

    /// The run's mean time of an evaluation, s.
    pub fn seconds_per_evaluation(&self) -> f64 {
        self.elapsed_s / self.evaluations.max(1) as f64
    }
}

/// Makes all runs, form after form, solver after solver; `done` gets each. Ends early,
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
    let drawn = (1..=comparison.seeds).map(draw);
    let problems: Vec<Problem<'_>> = drawn
        .map(|rows| Problem::new(dataset, &rows, stage, model))
        .collect();
    let mut runs: Vec<Run> = Vec::new();
    for &form in &comparison.forms {
        let floors = runs.len();
        for (seed, problem) in (1..).zip(&problems) {
            let options = SolverOptions::new(form, seed);
            let solution = Solver::LeastSquares.solve(problem, &options)?;
            let fitness = problem.fitness(solution.cost);
            let run = Run {
                form,
                solver: LEAST_SQUARES,
                seed,
                fitness,
                floor: fitness,
                evaluations: solution.evaluations as usize,
                nan_costs: 0,
                elapsed_s: solution.elapsed.as_secs_f64(),
                rms: rms_over_all_rows(dataset, problem, &solution),
                history: Vec::new(),
            };
            done(&run);
            runs.push(run);
        }
        for &search in &comparison.searches {
            for (seed, problem) in (1..).zip(&problems) {
                if interrupt.load(Ordering::Relaxed) {
                    return Ok(runs);
                }
                let Some(objective) = Objective::new(problem, form) else {
                    continue;
                };
                let floor = runs[floors + seed as usize - 1].floor;
                let run = search_on(
                    &objective,
                    problem,
                    dataset,
                    search,
                    comparison,
                    (seed, floor),
                );
                done(&run);
                runs.push(run);
            }
        }
    }
    Ok(runs)
}

/// One search on one form with a seed, whose floor is known.
fn search_on(
    objective: &Objective<'_>,
    problem: &Problem<'_>,
    dataset: &Dataset,
    search: SearchKind,
    comparison: &Comparison,
    (seed, floor): (u64, f64),
) -> Run {
    let start = Start {
        seed,
        population: comparison.population as usize,
        individuals: &objective.first_population(comparison.population as usize, seed),
    };
    let criteria = StopCriteria {
        evaluations: Some(comparison.evaluations as usize),
        ..StopCriteria::default()
    };
    let started = Instant::now();
    let found = search.minimize(objective, &start, &criteria);
    let elapsed_s = started.elapsed().as_secs_f64();
    let solution = solution_of(problem, objective, &found).ok();
    Run {
        form: objective.projection,
        solver: search.name(),
        seed,
        fitness: found.cost,
        floor,
        evaluations: found.evaluations,
        nan_costs: found.nan_costs,
        elapsed_s,
        rms: solution.and_then(|solution| rms_over_all_rows(dataset, problem, &solution)),
        history: found.history,
    }
}

/// Errors over all rows, by the decoder of the target, um, um, urad.
fn rms_over_all_rows(
    dataset: &Dataset,
    problem: &Problem<'_>,
    solution: &Solution,
) -> Option<[f64; 3]> {
    let (stage, parameters) = (problem.stage, &solution.parameters);
    let calibration = calibration(&dataset.rows, stage, problem.model, parameters);
    let set = calibration.prepare(&Origin::default()).ok()?;
    let judgement = Decoded::new(&set, dataset).judge(dataset, stage, Zeros::Refit);
    Some(judgement.errors.axes.map(|axis| axis.rms * 1e6))
}

#[cfg(test)]
#[path = "tests.rs"]
mod tests;
