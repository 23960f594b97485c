//! Sums of squared pose errors over the rows of a problem, um^2, um^2, urad^2.
//!
//! The same equations as `runtime::model`, which is the model; a test holds the two equal
//! within rounding. eta moves from phi into the matrix: PM^-1 (s / phi - delta / eta) =
//! G (s' - delta) with G = PM^-1 diag(1/eta) and s' = s / (phi / eta).

use super::poles::SHARE_MIN;
use crate::estimator::linear::LinearPoint;
use crate::estimator::paper::Parameters;
use crate::estimator::problem::{Problem, UNIT};
use crate::estimator::rows::FieldRow;
use nalgebra::{Matrix3, Vector3};
use runtime::matrix::{from_rows, inverse};

/// The slopes over eta of A, B, C.
struct Ratios(Matrix3<f64>);

impl Ratios {
    fn new(ratios: &[[f64; 3]; 3]) -> Self {
        Self(from_rows(ratios))
    }

    /// phi / eta of the three probes at a row (equation 33), and s' there, m.
    #[inline(always)]
    fn correct(&self, row: &FieldRow) -> (Vector3<f64>, Vector3<f64>) {
        let shares = Vector3::repeat(1.0) + self.0 * Vector3::from(row.vertical);
        let corrected_m = Vector3::from(row.signal_m).component_div(&shares);
        (shares, corrected_m)
    }
}

/// At the given zero deviation of each movement, m.
pub fn squares_at_delta(
    problem: &Problem<'_>,
    point: &LinearPoint,
    delta_m: impl Fn(usize) -> [f64; 3],
) -> Vector3<f64> {
    let ratios = Ratios::new(&point.ratios);
    let mut squares = Vector3::zeros();
    for (number, movement) in problem.rows.numbered_movements() {
        let zero = point.gain * Vector3::from(delta_m(number));
        for row in &problem.rows.rows[movement] {
            let (_, corrected_m) = ratios.correct(row);
            let error = point.gain * corrected_m - Vector3::from(row.reference) - zero;
            squares += error.component_mul(&error);
        }
    }
    squares / (UNIT * UNIT)
}

/// At the best zero deviation of each movement: it takes off the movement's mean pose error,
/// delta = eta (PM mean error), clipped to its range.
pub fn squares_at_best_delta(
    problem: &Problem<'_>,
    point: &LinearPoint,
    parameters: &Parameters,
) -> Option<Vector3<f64>> {
    let ratios = Ratios::new(&point.ratios);
    let range = problem.stage.search.delta_m;
    let eta = Matrix3::from_diagonal(&Vector3::from(parameters.eta()));
    let to_delta = eta * parameters.geometry().plane();
    let mut smallest = Vector3::repeat(f64::INFINITY);
    let mut squares = Vector3::zeros();
    for movement in problem.rows.movement_rows() {
        let rows = &problem.rows.rows[movement];
        let (mut sum, mut here) = (Vector3::zeros(), Vector3::zeros());
        for row in rows {
            let (shares, corrected_m) = ratios.correct(row);
            smallest = smallest.inf(&shares);
            let error = point.gain * corrected_m - Vector3::from(row.reference);
            sum += error;
            here += error.component_mul(&error);
        }
        if problem.model.has_zero_deviation {
            let n = rows.len() as f64;
            let mean = sum / n;
            let delta_m = (to_delta * mean).map(|delta| range.clip(delta));
            // Sum of (error - zero)^2, free of the cancellation that zero^2 would bring.
            let off = mean - point.gain * delta_m;
            here += off.component_mul(&off) * n - sum.component_mul(&mean);
        }
        squares += here;
    }
    (smallest.min() > SHARE_MIN).then_some(squares / (UNIT * UNIT))
}

/// The gain, m, m, rad per m, and one offset of each movement that fit best, and the squares
/// that they leave. With s' and q each less its mean over the movement, A = sum s' s'^T and
/// B = sum s' q^T, G^T is A^-1 B.
pub fn best_gain(
    problem: &Problem<'_>,
    ratios: &[[f64; 3]; 3],
) -> Option<(Matrix3<f64>, Vector3<f64>)> {
    let ratios = Ratios::new(ratios);
    let mut smallest = Vector3::repeat(f64::INFINITY);
    let (mut signal, mut mixed) = (Matrix3::zeros(), Matrix3::zeros());
    let mut squares = Vector3::zeros();
    for movement in problem.rows.movement_rows() {
        let rows = &problem.rows.rows[movement];
        let (mut signal_sum, mut reference_sum) = (Vector3::zeros(), Vector3::zeros());
        for row in rows {
            let (shares, s) = ratios.correct(row);
            let q = Vector3::from(row.reference);
            smallest = smallest.inf(&shares);
            signal_sum += s;
            reference_sum += q;
            signal += s * s.transpose();
            mixed += s * q.transpose();
            squares += q.component_mul(&q);
        }
        let n = rows.len() as f64;
        signal -= signal_sum * signal_sum.transpose() / n;
        mixed -= signal_sum * reference_sum.transpose() / n;
        squares -= reference_sum.component_mul(&reference_sum) / n;
    }
    if smallest.min() <= SHARE_MIN {
        return None;
    }
    let gain = mixed.tr_mul(&inverse(&signal)?);
    let left = squares - (gain * mixed).diagonal();
    // Rounding could make an exact fit negative.
    Some((gain, left.map(|left| left.max(0.0) / (UNIT * UNIT))))
}
