//! How far the reference lags behind the probes, estimated together with the parameters.

use crate::input::stage::Stage;
use crate::problem::model::Model;
use crate::problem::parameters::Parameters;
use crate::solve::field::blocks::{Block, Rows};
use crate::solve::field::noise::{drift_mm, white_mm};
use crate::solve::field::parameters::FieldParameters;
use crate::solve::field::probe::probes;
use crate::solve::field::terms::{COUNT, PER_PROBE};
use crate::solve::field::whiten::{Noise, Normal, UNKNOWNS};
use nalgebra::{Cholesky, DMatrix, DVector};
use std::ops::Range;

/// For how long a model errs alike, s: its errors go with the motion. What it leaves unexplained
/// counts as one residual in that time.
const ALIKE_S: f64 = 0.5;

/// The lag of the reference behind the probes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReferenceLag {
    /// s; positive where the reference shows an earlier pose.
    pub value_s: f64,
    /// s.
    pub standard_error_s: f64,
}

/// The lag at the least squares of a model of the paper, by its rows with their weights: one
/// Gauss-Newton step of the lag with all
/// parameters that the model fits, under white noise and a walk of the reference. What the
/// model leaves unexplained widens the standard error. `None` where no motion shows the lag.
pub fn reference_lag(
    rows: &Rows,
    stage: &Stage,
    model: &'static Model,
    parameters: &Parameters,
) -> Option<ReferenceLag> {
    let probes = probes(&FieldParameters::of_model_31(parameters, stage));
    let offsets_mm = vec![[0.0; 3]; rows.movements.len()];
    let least_mm = stage.hall.m_per_count * 1e3 / 12f64.sqrt();
    let white_mm = white_mm(rows, &probes, 0.0, &offsets_mm, least_mm);
    let blocks = rows.evaluate(&probes, 0.0, &offsets_mm);
    let unknown = DMatrix::zeros(UNKNOWNS, UNKNOWNS);
    let noise = Noise {
        drift_mm: drift_mm(rows, &blocks, white_mm, &unknown),
        white_mm,
    };
    let normal = Normal::new(rows, &blocks, &noise);

    // The first terms of a probe are those of Model (31), in its order.
    let place = |index: usize| index % 3 * PER_PROBE + index / 3;
    let of_model = model.free().map(|id| place(id.index));
    let unknowns: Vec<usize> = of_model.chain([COUNT]).collect();
    let scale = |k: usize| 1.0 / normal.curvature(k, k).sqrt();
    let curvature = DMatrix::from_fn(unknowns.len(), unknowns.len(), |i, j| {
        let (i, j) = (unknowns[i], unknowns[j]);
        normal.curvature(i, j) * scale(i) * scale(j)
    });
    let descent = DVector::from_iterator(
        unknowns.len(),
        unknowns.iter().map(|&k| normal.descent(k) * scale(k)),
    );
    let factor = Cholesky::new(curvature)?;
    let step = factor.solve(&descent);
    let lag = unknowns.len() - 1;
    let mut unit = DVector::zeros(unknowns.len());
    unit[lag] = 1.0;
    let by_descent = factor.solve(&unit);

    let residuals =
        (3 * rows.blocks.len()).checked_sub(3 * rows.movements.len() + unknowns.len())?;
    let chi_squared = normal.chi_squared() - descent.dot(&step);
    let unexplained = (chi_squared / residuals.max(1) as f64 - 1.0).max(0.0);
    let alike = (ALIKE_S * rows.blocks.len() as f64 / seconds(rows, &blocks)).max(1.0);
    let variance = by_descent[lag] * (1.0 + unexplained * alike);
    let found = ReferenceLag {
        value_s: step[lag] * scale(COUNT),
        standard_error_s: variance.sqrt() * scale(COUNT),
    };
    found.standard_error_s.is_finite().then_some(found)
}

/// Length of all movements, s.
fn seconds(rows: &Rows, blocks: &[Block]) -> f64 {
    let ends = |movement: &Range<usize>| {
        let of_movement = &blocks[movement.clone()];
        Some(of_movement.last()?.time_s - of_movement.first()?.time_s)
    };
    rows.movements.iter().filter_map(ends).sum()
}
