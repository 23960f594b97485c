//! Cost, gradient and curvature of the fit in the coordinates x = (G, r), from the scatter.
//!
//! x holds the nine entries of G row by row, then the ratios probe by probe. The residual
//! of axis j is e_j = q_j - G_j s', and its derivative with respect to x is -J_j with
//! J_j = s' at the entries of row j of G, and G_ji u_ik at the ratio r_ik.

use super::scatter::{Q, Ratios, Scatter, U};
use crate::problem::model::{COUNT, SLOPES_MAX};
use nalgebra::{Matrix3, SMatrix, SVector};

/// The point (G, r) of a fit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// Gain: pose (um, um, urad) per um of corrected signal, G = PM^-1 diag(1/eta).
    pub gain: Matrix3<f64>,
    /// Slopes over eta of each probe.
    pub ratios: Ratios,
}

/// One row and column for each number of x, or for each parameter.
pub type Square = SMatrix<f64, COUNT, COUNT>;
/// The numbers of x, or the parameters.
pub type Column = SVector<f64, COUNT>;

/// Column of x, and factors by the axes, of the regressor `z`: the sparse rows of J.
fn jacobian_factor(gain: &Matrix3<f64>, axis: usize, column: usize) -> Option<(usize, f64)> {
    if column < 9 {
        (column / 3 == axis).then_some((column % 3, 1.0))
    } else {
        let probe = (column - 9) / SLOPES_MAX;
        Some((U + column - 9, gain[(axis, probe)]))
    }
}

/// Sum over rows of J' W J for a 3 by 3 weight matrix of the axes.
pub fn gram(scatter: &Scatter, gain: &Matrix3<f64>, weight: &Matrix3<f64>) -> Square {
    let mut out = Square::zeros();
    for row in 0..COUNT {
        for column in row..COUNT {
            let mut sum = 0.0;
            for i in 0..3 {
                let Some((left, left_factor)) = jacobian_factor(gain, i, row) else {
                    continue;
                };
                for j in 0..3 {
                    let Some((right, right_factor)) = jacobian_factor(gain, j, column) else {
                        continue;
                    };
                    sum += weight[(i, j)] * left_factor * right_factor * scatter[(left, right)];
                }
            }
            out[(row, column)] = sum;
            out[(column, row)] = sum;
        }
    }
    out
}

/// Sum over rows of the products of the residuals of two axes.
pub fn residual_products(scatter: &Scatter, gain: &Matrix3<f64>) -> Matrix3<f64> {
    let qq = scatter.fixed_view::<3, 3>(Q, Q);
    let qs = scatter.fixed_view::<3, 3>(Q, 0);
    let ss = scatter.fixed_view::<3, 3>(0, 0);
    let cross = gain * qs.transpose();
    qq - cross - cross.transpose() + gain * ss * gain.transpose()
}

/// The weighted sum of squared residuals.
pub fn cost(scatter: &Scatter, gain: &Matrix3<f64>, weights: [f64; 3]) -> f64 {
    let products = residual_products(scatter, gain);
    (0..3)
        .map(|axis| weights[axis] * products[(axis, axis)])
        .sum()
}

/// Sum over rows of J' W e: the direction in which the cost falls, half its gradient.
pub fn descent(scatter: &Scatter, gain: &Matrix3<f64>, weights: [f64; 3]) -> Column {
    Column::from_fn(|row, _| {
        let mut sum = 0.0;
        for axis in 0..3 {
            let Some((left, factor)) = jacobian_factor(gain, axis, row) else {
                continue;
            };
            let mut residual = scatter[(left, Q + axis)];
            for probe in 0..3 {
                residual -= gain[(axis, probe)] * scatter[(left, probe)];
            }
            sum += weights[axis] * factor * residual;
        }
        sum
    })
}

/// The gain of the least cost at the scatter's ratios, or `None` when the corrected signals do
/// not span three dimensions.
pub fn best_gain(scatter: &Scatter) -> Option<Matrix3<f64>> {
    let ss = scatter.fixed_view::<3, 3>(0, 0).into_owned();
    let qs = scatter.fixed_view::<3, 3>(Q, 0).into_owned();
    // Scaled to a correlation matrix, so that the limit does not depend on units.
    let scale = ss.diagonal().map(f64::sqrt);
    if scale.iter().any(|s| !s.is_normal()) {
        return None;
    }
    let unit = Matrix3::from_fn(|i, j| ss[(i, j)] / (scale[i] * scale[j]));
    if unit.determinant() < 1e-12 {
        return None;
    }
    let inverse = unit.try_inverse()?;
    let inverse = Matrix3::from_fn(|i, j| inverse[(i, j)] / (scale[i] * scale[j]));
    Some(qs * inverse)
}
