//! How far the reference lags behind the probes, estimated together with the parameters.

use hallstage_input::stage::Stage;
use hallstage_solver::problem::model::Model;
use hallstage_solver::problem::parameters::Parameters;
use hallstage_solver::solve::field::blocks::{Block, Rows};
use hallstage_solver::solve::field::noise::{drift_mm, white_mm};
use hallstage_solver::solve::field::parameters::FieldParameters;
use hallstage_solver::solve::field::probe::probes;
use hallstage_solver::solve::field::terms::{COUNT, PER_PROBE};
use hallstage_solver::solve::field::whiten::{FieldEquations, Noise, UNKNOWNS};
use hallstage_solver::solve::gauss_newton::Unknowns;
use nalgebra::{DMatrix, DVector};
use std::ops::Range;

/// For how long a model errs alike, s: its errors go with the motion. What it leaves unexplained
/// counts as one residual in that time.
pub(crate) const ALIKE_S: f64 = 0.5;

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
    let start = FieldParameters::of_model_31(parameters, stage);
    let probes = probes(&start);
    let offsets_mm = vec![[0.0; 3]; rows.movements.len()];
    let white_mm = white_mm(rows, &probes, 0.0, &offsets_mm, stage);
    let blocks = rows.evaluate(&probes, 0.0, &offsets_mm);
    let unknown = DMatrix::zeros(UNKNOWNS, UNKNOWNS);
    let equations = FieldEquations {
        rows,
        places: start.places,
        noise: Noise {
            drift_mm: drift_mm(rows, &blocks, white_mm, &unknown),
            white_mm,
        },
        resets_mm: None,
        faults: &[],
    };
    let normal = equations.of_blocks(&blocks);
    // The first terms of a probe are those of Model (31), in its order.
    let place = |index: usize| index % 3 * PER_PROBE + index / 3;
    let of_model = model.free().map(|id| place(id.index));
    let free: Vec<usize> = of_model.chain([COUNT]).collect();
    let lag = free.len() - 1;
    let unknowns = Unknowns::some(DVector::zeros(UNKNOWNS), &free);
    let factor = unknowns.factor(&normal)?;
    let descent = unknowns.descent(&normal, &DVector::zeros(free.len()));
    let step = factor.solve(&descent);

    let residuals = (3 * rows.blocks.len()).checked_sub(3 * rows.movements.len() + free.len())?;
    let chi_squared = normal.chi_squared() - descent.dot(&step);
    let unexplained = (chi_squared / residuals.max(1) as f64 - 1.0).max(0.0);
    let alike = (ALIKE_S * rows.blocks.len() as f64 / seconds(rows, &blocks)).max(1.0);
    let variance = factor.inverse()[(lag, lag)] * (1.0 + unexplained * alike);
    let found = ReferenceLag {
        value_s: step[lag],
        standard_error_s: variance.sqrt(),
    };
    let is_shown = found.standard_error_s.is_finite() && found.standard_error_s > 0.0;
    is_shown.then_some(found)
}

/// Length of all movements, s.
fn seconds(rows: &Rows, blocks: &[Block]) -> f64 {
    let ends = |movement: &Range<usize>| {
        let of_movement = &blocks[movement.clone()];
        Some(of_movement.last()?.time_s - of_movement.first()?.time_s)
    };
    rows.movements.iter().filter_map(ends).sum()
}
