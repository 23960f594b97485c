//! The fit of a model of the paper by the errors of the pose: a start from a regression, then Gauss-Newton.

use super::linear::{LinearPoint, parameters_at};
use super::pose::{COLUMNS, Decoder};
use crate::estimator::gauss_newton::{self, Limits, Solved, Unknowns};
use crate::estimator::model::{COUNT, Model, ParameterId};
use crate::estimator::paper::{Parameters, SLOPES, THETA, search_box};
use crate::estimator::problem::Problem;
use crate::estimator::zero_deviation::ZeroDeviation;
use crate::solve::{Solution, SolveError, Stopped};
use hallstage_input::stage::{Range, Stage};
use nalgebra::{DVector, Matrix3, Vector3};
use std::time::Duration;

/// Starts are compared on this number of rows. The fit to all rows goes on from the fit to these.
const START_ROWS: usize = 2000;
const LIMITS: Limits = Limits {
    steps: 100,
    gain: 1e-9,
};
/// Most fits until the ranges of the lever arms, which follow from the misalignments, settle.
const ROUNDS_MAX: usize = 20;

/// Least squares on all rows, from the given start or else from a regression; of a model without
/// gains within the search ranges, since angles and lever arms would take what gains are off.
///
/// # Errors
/// See [`SolveError`].
pub fn solve(problem: &Problem, start: Option<Parameters>) -> Result<Solution, SolveError> {
    let start = start.or_else(|| regression(&problem.thinned(START_ROWS)));
    let start = start.ok_or(SolveError::NoPlanarMotion)?;
    fit(problem, start, !problem.model.fits_gain())
}

/// The search range of every parameter; if not `within` them, only of those that stage.toml fixes.
fn ranges(problem: &Problem, theta: [f64; 3], within: bool) -> [Range; COUNT] {
    let mut ranges = search_box(problem.stage, problem.model, theta);
    if !within {
        for index in problem.free() {
            ranges[index] = Range::new(f64::NEG_INFINITY, f64::INFINITY);
        }
    }
    ranges
}

/// Parameters clipped to their ranges. The ranges of the lever arms follow from the misalignments, so these come
/// first.
fn clipped(problem: &Problem, parameters: &Parameters, within: bool) -> Parameters {
    let mut clipped = *parameters;
    for start in [THETA, 0] {
        let theta = clipped.geometry().misalignment_rad;
        let ranges = ranges(problem, theta, within);
        for id in problem.model.free().filter(|id| id.index >= start) {
            clipped.values[id.index] = ranges[id.index].clip(clipped.values[id.index]);
        }
    }
    clipped
}

/// What may change, about some parameters. A lever arm's range moves with the misalignment: what
/// has a range is its distance to where the nearer end of it moves.
fn unknowns(problem: &Problem, about: &Parameters, within: bool) -> Unknowns {
    const STEP_RAD: f64 = 1e-6;
    let theta = about.geometry().misalignment_rad;
    let here = ranges(problem, theta, within);
    let there = ranges(problem, theta.map(|theta| theta + STEP_RAD), within);
    let free: Vec<usize> = problem.model.free().map(|id| id.index).collect();
    let mut unknowns = Unknowns::some(DVector::from_column_slice(&about.values), &free);
    for &arm in free.iter().filter(|index| **index < THETA) {
        let (value, [low, high]) = (about.values[arm], [here[arm].low, here[arm].high]);
        let moved = match value - low < high - value {
            true => there[arm].low - low,
            false => there[arm].high - high,
        };
        if moved.is_finite() {
            unknowns.basis[(arm, THETA + arm)] = moved / STEP_RAD;
        }
    }
    let range = |&index: &usize| {
        let (here, about) = (here[index], about.values[index]);
        Range::new(here.low - about, here.high - about)
    };
    unknowns.ranges = free.iter().map(range).collect();
    unknowns
}

/// Least squares from a start, `within` the search ranges or not.
pub(super) fn fit(
    problem: &Problem,
    start: Parameters,
    within: bool,
) -> Result<Solution, SolveError> {
    let few = problem.thinned(START_ROWS);
    let descend = |problem: &Problem, from: &Parameters, limits: Limits| {
        let from = clipped(problem, from, within);
        let unknowns = unknowns(problem, &from, within);
        let x = DVector::zeros(unknowns.basis.ncols());
        gauss_newton::solve(problem, &unknowns, x, Vec::new(), limits)
    };
    let steps = if within { LIMITS.steps } else { 0 };
    let look = Limits { steps, ..LIMITS };
    let mut at = descend(&few, &start, look).ok_or(SolveError::NoUsableStart)?;
    let mut steps = 0;
    let is_few = few.rows.rows.len() < problem.rows.rows.len() / 2;
    for problem in is_few.then_some(&few).into_iter().chain([problem]) {
        for _ in 0..if within { ROUNDS_MAX } else { 1 } {
            at = descend(problem, &parameters(&at), LIMITS).ok_or(SolveError::NoUsableStart)?;
            steps += at.steps;
            if at.steps == 0 {
                break;
            }
        }
    }
    let parameters = clipped(problem, &parameters(&at), within);
    let zeros = zero_deviations(problem, &parameters);
    Ok(Solution {
        delta_m: zeros.iter().map(|zero| zero.delta_m).collect(),
        parameters,
        cost: at.normal.chi_squared().max(0.0),
        evaluations: 3 + u64::from(steps),
        history: Vec::new(),
        elapsed: Duration::ZERO,
        stopped: match at.reached {
            true => Stopped::Converged,
            false => Stopped::NoLowerCost,
        },
    })
}

fn parameters(solved: &Solved<COLUMNS>) -> Parameters {
    Parameters::from_slice(solved.point.values.as_slice())
}

impl Problem<'_> {
    /// The parameters that are fitted: those that the model fits, but for those that stage.toml fixes by
    /// a range without width.
    pub fn free(&self) -> Vec<usize> {
        // Away from zero, where both coordinates of a probe count in its lever arm.
        let ranges = search_box(self.stage, self.model, [0.1; 3]);
        let ids = self.model.free().map(|id| id.index);
        ids.filter(|&index| ranges[index].width() > 0.0).collect()
    }
}

/// The free parameters that stand at an end of their range or beyond it.
pub fn at_limit(stage: &Stage, model: &'static Model, parameters: &Parameters) -> Vec<ParameterId> {
    let ranges = search_box(stage, model, parameters.geometry().misalignment_rad);
    let at_end = |id: &ParameterId| {
        let (range, value) = (ranges[id.index], parameters.values[id.index]);
        let edge = 1e-9 * range.width();
        range.width() > 0.0 && (value <= range.low + edge || value >= range.high - edge)
    };
    model.free().filter(at_end).collect()
}

/// eta, angle and lever arm of each probe by a linear regression of its signal on the reference, each
/// less its mean over the movement: slopes left out. `None` where the motion does not span X, Y, Rz.
fn regression(problem: &Problem) -> Option<Parameters> {
    let mut squares = Matrix3::zeros();
    let mut products = Matrix3::zeros();
    for movement in problem.rows.movement_rows() {
        let rows = &problem.rows.rows[movement];
        let (mut of_q, mut of_s, mut weights) = (Vector3::zeros(), Vector3::zeros(), 0.0);
        for row in rows {
            let (q, s) = (Vector3::from(row.reference), Vector3::from(row.signal_m));
            of_q += q * row.weight;
            of_s += s * row.weight;
            weights += row.weight;
            squares += q * q.transpose() * row.weight;
            products += s * q.transpose() * row.weight;
        }
        if problem.model.has_zero_deviation {
            squares -= of_q * of_q.transpose() / weights;
            products -= of_s * of_q.transpose() / weights;
        }
    }
    // Scaled to a correlation matrix, so that the limit does not depend on units.
    let scale = squares.diagonal().map(f64::sqrt);
    let unit = squares.component_div(&(scale * scale.transpose()));
    if unit.determinant().is_nan() || unit.determinant() < 1e-12 {
        return None;
    }
    let inverse = products.try_inverse();
    let found = inverse.and_then(|inverse| {
        let point = LinearPoint {
            gain: squares * inverse,
            ratios: [[0.0; 3]; 3],
        };
        parameters_at(&point, problem.stage)
    });
    // Where noise hides the motion, the design is as good a start.
    let mut start = found.unwrap_or_else(|| Parameters::designed(problem.stage));
    for id in problem.model.parameters().skip(3 * problem.model.fitted) {
        start.values[id.index] = id.term.fixed;
    }
    start.values[SLOPES..].fill(0.0);
    Some(start)
}

/// The zero deviation of every movement of the log; none where the model has none or the movement no
/// row, and where the parameters have no pose.
pub fn zero_deviations(problem: &Problem, parameters: &Parameters) -> Vec<ZeroDeviation> {
    let mut zeros = vec![ZeroDeviation::NONE; problem.rows.movements_of_log];
    let Some(decoder) = Decoder::new(parameters, problem.stage) else {
        return zeros;
    };
    if !problem.model.has_zero_deviation {
        return zeros;
    }
    for (number, movement) in problem.rows.numbered_movements() {
        let (mut sum, mut weights) = ([0.0; 3], 0.0);
        for row in &problem.rows.rows[movement] {
            let Some(error) = decoder.error(row) else {
                return vec![ZeroDeviation::NONE; problem.rows.movements_of_log];
            };
            for (sum, error) in sum.iter_mut().zip(error) {
                *sum -= row.weight * error;
            }
            weights += row.weight;
        }
        let mean = sum.map(|sum| sum / weights);
        let range = &problem.stage.search.delta_m;
        zeros[number] = ZeroDeviation::from_mean_error(parameters, mean, range);
    }
    zeros
}

#[cfg(test)]
#[path = "least_squares_tests.rs"]
mod tests;
