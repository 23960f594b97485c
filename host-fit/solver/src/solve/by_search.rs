//! A search on the fitness of a problem.

use super::objective::{Objective, best_delta_m};
use super::search::kind::SearchKind;
use super::search::run::{SearchOptions, SearchResult, Stall};
use super::{Projection, Solution, SolveError, SolverOptions, Stopped};
use crate::estimator::problem::Problem;

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

/// A search on all rows of the problem.
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
    })?;
    // The other forms fall in steps with long rests between them.
    let stall = match options.projection {
        Projection::Linear => Some(EXACT),
        Projection::None | Projection::Delta => None,
    };
    let first = objective.first_population(options.population, options.seed);
    let options = SearchOptions {
        first: &first,
        stall,
        watch: options.watch,
        ..SearchOptions::new(options.seed, options.population, options.generations)
    };
    let found = kind.minimize(&objective, &options);
    solution_of(problem, &objective, &found)
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
        stopped: Stopped::Search {
            reason: found.reason,
            nan_costs: found.nan_costs,
            evaluations: found.evaluations,
        },
    })
}

#[cfg(test)]
#[path = "by_search_tests.rs"]
mod tests;
