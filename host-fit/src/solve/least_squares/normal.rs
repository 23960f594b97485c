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

/// Probe of the ratio at a place of x, and where its derivative stands in the scatter; `None`
/// for a gain.
fn ratio(place: usize) -> Option<(usize, usize)> {
    let ratio = place.checked_sub(9)?;
    Some((ratio / SLOPES_MAX, U + ratio))
}

/// Sum over rows of J' W J for a 3 by 3 weight matrix of the axes, in blocks: gain with gain, gain
/// with ratio, ratio with ratio.
pub fn gram(scatter: &Scatter, gain: &Matrix3<f64>, weight: &Matrix3<f64>) -> Square {
    let mut out = Square::zeros();
    for row in 0..COUNT {
        for column in row..COUNT {
            let product = match (ratio(row), ratio(column)) {
                (None, None) => weight[(row / 3, column / 3)] * scatter[(row % 3, column % 3)],
                (None, Some((probe, at))) => (0..3).fold(0.0, |sum, axis| {
                    sum + weight[(row / 3, axis)] * gain[(axis, probe)] * scatter[(row % 3, at)]
                }),
                (Some((left, i)), Some((right, j))) => {
                    let pairs = (0..9).map(|k| (k / 3, k % 3));
                    // Without correlation between the axes three of nine.
                    let weighted = pairs.filter(|pair| weight[*pair] != 0.0);
                    weighted.fold(0.0, |sum, (a, b)| {
                        sum + weight[(a, b)] * gain[(a, left)] * gain[(b, right)] * scatter[(i, j)]
                    })
                }
                // Ratios stand behind the gains.
                (Some(_), None) => 0.0,
            };
            out[(row, column)] = product;
            out[(column, row)] = product;
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
    // Sum over rows of one number times the weighted residual of an axis.
    let pull = |number: usize, axis: usize| {
        let mut residual = scatter[(number, Q + axis)];
        for probe in 0..3 {
            residual -= gain[(axis, probe)] * scatter[(number, probe)];
        }
        weights[axis] * residual
    };
    Column::from_fn(|place, _| match ratio(place) {
        None => pull(place % 3, place / 3),
        Some((probe, at)) => {
            gain[(0, probe)] * pull(at, 0)
                + gain[(1, probe)] * pull(at, 1)
                + gain[(2, probe)] * pull(at, 2)
        }
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
