//! Damped Gauss-Newton (Levenberg-Marquardt) within a box, on the sums of `scatter`.

use super::coordinates::Coordinates;
use super::moments::Moments;
use super::normal::{Column, Point, Square, cost, descent, gram};
use super::scatter::{Offset, Q, Ratios, Scatter, scatter};
use crate::problem::Problem;
use crate::problem::model::COUNT;
use nalgebra::{Cholesky, DMatrix, DVector, Matrix3};

/// Why a descent ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DescentEnd {
    /// No step would lower the cost by more than rounding.
    Converged,
    /// Every step was refused, even very short ones: at a pole or a kink.
    Stuck,
    /// The limit of steps was reached.
    StepLimit,
}

/// Where a descent ended.
#[derive(Clone, Debug)]
pub struct Descent {
    /// The unknowns.
    pub unknowns: Column,
    /// The point (G, r) that they mean.
    pub point: Point,
    /// The sums at that point.
    pub scatter: Scatter,
    /// Weighted sum of squared residuals, um^2.
    pub cost: f64,
    /// Passes over the rows.
    pub evaluations: u64,
    /// Why it ended.
    pub end: DescentEnd,
}

const STEPS_MAX: u32 = 100;
const DAMPING_START: f64 = 1e-6;
const DAMPING_MAX: f64 = 1e12;

struct State {
    unknowns: Column,
    point: Point,
    scatter: Scatter,
    cost: f64,
}

/// The rows that a descent is on.
#[derive(Clone, Copy, Debug)]
pub struct Sums<'p, 'a> {
    /// The rows themselves.
    pub problem: &'p Problem<'a>,
    /// Their moments, where the log has such.
    pub moments: Option<&'p Moments>,
}

impl Sums<'_, '_> {
    /// The scatter at the given ratios, `None` next to a pole.
    pub fn scatter(&self, ratios: &Ratios, offsets: &[Offset]) -> Option<Scatter> {
        match self.moments {
            Some(moments) => moments.scatter(ratios, offsets),
            None => scatter(self.problem, ratios, offsets),
        }
    }
}

fn evaluate(
    sums: Sums,
    offsets: &[Offset],
    coordinates: &impl Coordinates,
    unknowns: Column,
) -> Option<State> {
    let point = coordinates.point(&unknowns)?;
    let scatter = sums.scatter(&point.ratios, offsets)?;
    let cost = cost(&scatter, &point.gain, sums.problem.weights);
    cost.is_finite().then_some(State {
        unknowns,
        point,
        scatter,
        cost,
    })
}

/// The sums cancel down to the cost, so it carries the rounding of the whole signal.
fn rounding(scatter: &Scatter) -> f64 {
    1e-13 * scatter.fixed_view::<3, 3>(Q, Q).trace()
}

/// Descends from `start` (clipped to the box). `None` when the start itself cannot be
/// evaluated: a singular geometry, or a row next to a pole.
pub fn descend(
    sums: Sums,
    offsets: &[Offset],
    coordinates: &impl Coordinates,
    start: Column,
) -> Option<Descent> {
    let problem = sums.problem;
    let mut state = evaluate(sums, offsets, coordinates, coordinates.clip(start))?;
    let mut evaluations = 1;
    let mut damping = DAMPING_START;
    let mut end = DescentEnd::StepLimit;
    let weights = Matrix3::from_diagonal(&problem.weights.into());
    let places = coordinates.places();
    'steps: for _ in 0..STEPS_MAX {
        let mut gradient = descent(&state.scatter, &state.point.gain, problem.weights);
        let mut curvature = gram(&state.scatter, &state.point.gain, &weights);
        if let Some(chain) = coordinates.jacobian(&state.unknowns, &state.point) {
            gradient = chain.transpose() * gradient;
            curvature = chain.transpose() * curvature * chain;
        }
        let free = unblocked(coordinates, &state.unknowns, &gradient);
        let enough = state.cost / (problem.rows.len() as f64) * 1e-8 + rounding(&state.scatter);
        loop {
            let step = damped_step(&curvature, &gradient, &free, &places, damping);
            let next = coordinates.clip(state.unknowns + step);
            let moved = next - state.unknowns;
            let gain = 2.0 * gradient.dot(&moved) - moved.dot(&(curvature * moved));
            if gain.abs() <= enough && damping <= 1.0 {
                end = DescentEnd::Converged;
                break 'steps;
            }
            evaluations += 1;
            match evaluate(sums, offsets, coordinates, next) {
                Some(next) if next.cost < state.cost => {
                    state = next;
                    damping = (damping * 0.1).max(1e-14);
                    break;
                }
                _ => damping *= 10.0,
            }
            if damping > DAMPING_MAX {
                end = DescentEnd::Stuck;
                break 'steps;
            }
        }
    }
    Some(Descent {
        unknowns: state.unknowns,
        point: state.point,
        scatter: state.scatter,
        cost: state.cost,
        evaluations,
        end,
    })
}

/// The unknowns that may move: free, and not pressed against an end of their range.
fn unblocked(coordinates: &impl Coordinates, at: &Column, gradient: &Column) -> [bool; COUNT] {
    let mut free = coordinates.free();
    for k in 0..COUNT {
        if free[k] {
            let mut probe = *at;
            probe[k] += gradient[k].signum() * (at[k].abs() * 1e-9 + 1e-15);
            free[k] = coordinates.clip(probe)[k] != at[k];
        }
    }
    free
}

/// Solves (A + damping diag A) step = gradient for the free unknowns, scaled by diag A; others,
/// and those without any effect on the cost, stay. The matrix holds only the `places` that the
/// model has.
fn damped_step(
    curvature: &Square,
    gradient: &Column,
    free: &[bool; COUNT],
    places: &[usize],
    damping: f64,
) -> Column {
    let scale = Column::from_fn(|k, _| {
        let d = curvature[(k, k)].sqrt();
        if free[k] && d.is_normal() {
            1.0 / d
        } else {
            0.0
        }
    });
    let n = places.len();
    let scaled = DMatrix::from_fn(n, n, |i, j| {
        let (i, j) = (places[i], places[j]);
        curvature[(i, j)] * scale[i] * scale[j]
    });
    let right = DVector::from_fn(n, |i, _| gradient[places[i]] * scale[places[i]]);
    let spread = |step: &DVector<f64>| {
        let mut out = Column::zeros();
        for (&k, step) in places.iter().zip(step) {
            out[k] = step * scale[k];
        }
        out
    };
    // Where the log leaves a direction open the matrix is singular to rounding: damp it more.
    let mut extra = 0.0;
    for _ in 0..12 {
        let mut regular = scaled.clone();
        regular.fill_diagonal(1.0 + damping + extra);
        if let Some(factor) = Cholesky::new(regular) {
            return spread(&factor.solve(&right));
        }
        extra = if extra == 0.0 { 1e-12 } else { extra * 10.0 };
    }
    spread(&right)
}
