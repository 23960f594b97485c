//! The normal equations with the prior: a step, and the covariance at the end.

use super::parameters::FieldParameters;
use super::terms::{COUNT, PER_PROBE, TERMS};
use super::whiten::{Normal, UNKNOWNS};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

/// The precision of the prior of an unknown.
pub(super) fn prior(unknown: usize) -> Option<f64> {
    let deviation = (unknown < COUNT).then(|| TERMS[unknown % PER_PROBE].prior)??;
    Some(1.0 / (deviation * deviation))
}

/// Sum of squares of the parameters in terms of their priors' standard deviations.
pub(super) fn prior_squares(parameters: &FieldParameters) -> f64 {
    let values = parameters.probes.as_flattened();
    let mut sum = 0.0;
    for (k, value) in values.iter().enumerate() {
        sum += prior(k).map_or(0.0, |precision| precision * value * value);
    }
    sum
}

/// Half the fall of the cost along each unknown.
pub(super) fn descent(normal: &Normal, parameters: &FieldParameters) -> DVector<f64> {
    let values = parameters.probes.as_flattened();
    DVector::from_fn(UNKNOWNS, |k, _| {
        let pull = prior(k).map_or(0.0, |precision| precision * values[k]);
        normal.descent(k) - pull
    })
}

/// The curvature of the cost, factored in the scale in which its diagonal is one.
pub(super) struct Factor {
    scale: DVector<f64>,
    factor: Cholesky<f64, Dyn>,
}

/// The factor with `damping` added to the diagonal; `None` where it is singular.
pub(super) fn factor(normal: &Normal, damping: f64) -> Option<Factor> {
    let diagonal = |k: usize| normal.curvature(k, k) + prior(k).unwrap_or(0.0);
    let scale = DVector::from_fn(UNKNOWNS, |k, _| {
        let d = diagonal(k).sqrt();
        // A lag that nothing shows stays as it is.
        if d.is_normal() { 1.0 / d } else { 0.0 }
    });
    let scaled = DMatrix::from_fn(UNKNOWNS, UNKNOWNS, |i, j| {
        if i == j {
            1.0 + damping
        } else {
            normal.curvature(i, j) * scale[i] * scale[j]
        }
    });
    let factor = Cholesky::new(scaled)?;
    Some(Factor { scale, factor })
}

impl Factor {
    /// The step along a descent.
    pub(super) fn solve(&self, right: &DVector<f64>) -> DVector<f64> {
        let scaled = right.component_mul(&self.scale);
        self.factor.solve(&scaled).component_mul(&self.scale)
    }

    /// The covariance of the unknowns.
    pub(super) fn covariance(&self) -> DMatrix<f64> {
        let mut inverse = self.factor.inverse();
        for i in 0..UNKNOWNS {
            for j in 0..UNKNOWNS {
                inverse[(i, j)] *= self.scale[i] * self.scale[j];
            }
        }
        inverse
    }
}
