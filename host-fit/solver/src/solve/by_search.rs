//! A search on the fitness of a problem, with or without a least-squares finish.
//!
//! With a finish (the program's default, `shtlbo-lm`) the search runs on a few hundred rows, evenly
//! from each movement, until it hardly improves. The least-squares fit on all rows then starts from its best
//! individual. The result is the least-squares optimum for every seed; the search guards against a bad start.

use super::objective::{Objective, best_delta_m};
use super::search::kind::SearchKind;
use super::search::run::{SearchOptions, SearchResult, Stall};
use super::{Projection, Solution, SolveError, SolverOptions};
use crate::estimator::least_squares;
use crate::estimator::problem::Problem;

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

/// Np and Gm for a form if the user names none: the paper's values, except for `linear`. Its nine unknowns want a
/// smaller population and more generations.
pub const fn default_size(projection: Projection) -> (usize, usize) {
    match projection {
        Projection::None | Projection::Delta => (100, 100),
        Projection::Linear => (16, 1000),
    }
}

/// A search alone, on all rows of the problem.
///
/// # Errors
/// See [`SolveError`].
pub fn solve(
    kind: SearchKind,
    problem: &Problem<'_>,
    options: &SolverOptions,
) -> Result<Solution, SolveError> {
    let objective = Objective::new(problem, options.projection).ok_or(SolveError::Unsupported {
        solver: kind.name(),
        model: problem.model.name,
        projection: options.projection.name(),
        reason: "in this form only a model with slopes has unknowns left to search for: \
                 use --project delta or none, or --solver lm",
    })?;
    // The other forms fall in steps with long rests between them.
    let stall = match options.projection {
        Projection::Linear => Some(EXACT),
        Projection::None | Projection::Delta => None,
    };
    let found = search(kind, &objective, options, stall);
    solution_of(problem, &objective, &found)
}

/// SHTLBO on few rows, then least squares on all.
///
/// # Errors
/// See [`SolveError`].
pub fn solve_finished(
    problem: &Problem<'_>,
    options: &SolverOptions,
) -> Result<Solution, SolveError> {
    let few = problem.thinned(FEW_ROWS);
    // Where nothing nonlinear is left to search for, least squares alone is exact.
    let projection = match options.projection {
        Projection::Linear if !problem.model.fits_gain() => Projection::Delta,
        other => other,
    };
    let Some(objective) = Objective::new(&few, projection) else {
        return least_squares::solve(problem, &[]);
    };
    let found = search(SearchKind::Shtlbo, &objective, options, Some(NEAR));
    let is_usable = found.cost.is_finite();
    let start = is_usable.then(|| objective.parameters(&found.best));
    let mut solution = least_squares::solve(problem, start.flatten().as_slice())?;
    solution.evaluations += found.evaluations as u64;
    solution.history = found.history;
    solution.stopped = format!("search: {}; finish: {}", found.reason, solution.stopped);
    Ok(solution)
}

fn search(
    kind: SearchKind,
    objective: &Objective<'_>,
    options: &SolverOptions,
    stall: Option<Stall>,
) -> SearchResult {
    let first = objective.first_population(options.population, options.seed);
    let options = SearchOptions {
        first: &first,
        stall,
        watch: options.watch,
        ..SearchOptions::new(options.seed, options.population, options.generations)
    };
    kind.minimize(objective, &options)
}

/// What a search found.
///
/// # Errors
/// [`SolveError::NoUsableStart`] when no individual had a cost, [`SolveError::NoPlanarMotion`]
/// when the best gain is singular.
pub fn solution_of(
    problem: &Problem<'_>,
    objective: &Objective<'_>,
    found: &SearchResult,
) -> Result<Solution, SolveError> {
    if !found.cost.is_finite() {
        return Err(SolveError::NoUsableStart);
    }
    let parameters = objective.parameters(&found.best);
    let parameters = parameters.ok_or(SolveError::NoPlanarMotion)?;
    let own = objective.own_delta_m(&found.best);
    Ok(Solution {
        delta_m: own.unwrap_or_else(|| {
            let mut best = best_delta_m(problem, &parameters);
            if objective.projection == Projection::Delta {
                let range = problem.stage.search.delta_m;
                let deltas = best.as_flattened_mut().iter_mut();
                deltas.for_each(|delta| *delta = range.clip(*delta));
            }
            best
        }),
        parameters,
        cost: found.cost * found.cost * 3.0 * problem.rows.rows.len() as f64,
        evaluations: found.evaluations as u64,
        history: found.history.clone(),
        elapsed: std::time::Duration::ZERO,
        stopped: format!(
            "{}; {} of {} evaluations had no cost",
            found.reason, found.nan_costs, found.evaluations
        ),
    })
}

#[cfg(test)]
#[path = "by_search_tests.rs"]
mod tests;
