//! A few seconds of log with an old posterior as the prior: recalibration.
//!
//! The prior is normal about the old parameters. Its covariance is the old posterior's plus what
//! may have changed since, written as L L': the parameters are p = p_old + L x with x standard
//! normal. This needs no inverse, so a change may be of one parameter or of all, with or without
//! an old posterior. Where only gains change, the log moves only the gains; the covariance then has what the errors of the
//! other parameters make of the gains. The lags of the reference and of the probes, and what
//! acceleration adds, are unknowns of every log.

use super::dynamics::{Dynamics, MotionFit, PER_ACCELERATION, lag_prior};
use super::error::FieldFitError;
use super::noise::white_m;
use super::parameters::FieldParameters;
use super::posterior::Posterior;
use super::probe::probes;
use super::rows::Rows;
use super::temperature::OF_SENSORS;
use super::terms::{CARRY, COUNT, ETA, LEVER_ARM, PER_PROBE, SLOPES, TERMS, THETA};
use super::whiten::{ACCELERATIONS, COLUMNS, FieldEquations, LAG, Noise, PROBE_LAGS, UNKNOWNS};
use crate::estimator::gauss_newton::{self, Equations, Limits, Normal, Point, Solved, Unknowns};
use hallstage_input::dataset::Dataset;
use hallstage_input::stage::Stage;
use nalgebra::{Cholesky, DMatrix, DVector};

/// A change since the old log.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Change {
    /// The gain of all probes in common, as the temperature of magnets and amplifiers changes it.
    Gain,
    /// The gain of each probe.
    Gains,
    /// Anything: also the place and the height of each probe, and the shape of its field.
    All,
    /// No parameter has changed: the log adds information, above all on k and h.
    Temperature,
}

/// Standard deviations of the changes.
///
/// A gain scales eta, a, b and c alike. Beyond it a probe that was taken off and seated again is
/// elsewhere by some tenths of a millimetre and turned by up to a degree; its slopes follow the
/// height, and the terms of its field change by a fifth of what is expected of them at all: so
/// chosen, 0.3 mm is followed and a log of 4 s is enough.
const GAIN: f64 = 0.1;
const LEVER_ARM_M: f64 = 1e-3;
const THETA_RAD: f64 = 0.02;
/// Deviation of a, b and c together, as a part of each.
const SLOPE: f64 = 0.05;
/// Deviation of b and of c: a times this lever.
const PLACE_M: f64 = 5e-3;
const PRIOR_SHARE: f64 = 0.2;
const LAG_S: f64 = 0.01;
/// Columns of the lags of the reference and of two probes, and of what acceleration adds.
const MOTION_COLUMNS: usize = 3 + UNKNOWNS - ACCELERATIONS;

impl Change {
    /// The columns of L for it, each over the parameters.
    fn columns(self, old: &FieldParameters) -> Vec<[f64; COUNT]> {
        let gains = || {
            let gain = |probe: usize| {
                let mut parts = [0.0; 3];
                parts[probe] = GAIN;
                old.gain_change(parts)
            };
            vec![gain(0), gain(1), gain(2)]
        };
        match self {
            Self::Gain => vec![old.gain_change([GAIN; 3])],
            Self::Gains => gains(),
            // What errors of the log's temperatures make of its gain.
            Self::Temperature => vec![old.gain_change([OF_SENSORS; 3])],
            Self::All => {
                let mut columns = gains();
                for (probe, values) in old.probes.iter().enumerate() {
                    columns.extend(seating(probe, values));
                }
                columns
            }
        }
    }
}

/// What seating a probe anew changes beside its gain.
fn seating(probe: usize, values: &[f64; PER_PROBE]) -> Vec<[f64; COUNT]> {
    let own = probe * PER_PROBE;
    let one = |k: usize, deviation: f64| {
        let mut column = [0.0; COUNT];
        column[own + k] = deviation;
        column
    };
    let mut slopes = [0.0; COUNT];
    for k in SLOPES..CARRY {
        slopes[own + k] = SLOPE * values[k];
    }
    let place = PLACE_M * values[SLOPES];
    let mut columns = vec![
        slopes,
        one(LEVER_ARM, LEVER_ARM_M),
        one(THETA, THETA_RAD),
        one(SLOPES + 1, place),
        one(SLOPES + 2, place),
    ];
    for (k, term) in TERMS.iter().enumerate() {
        columns.extend(term.prior.map(|prior| one(k, PRIOR_SHARE * prior)));
    }
    columns
}

/// The parameters after a log, with their posterior.
#[derive(Clone, Debug)]
pub struct Update {
    /// The parameters.
    pub parameters: FieldParameters,
    /// How well they are known; without an old covariance as if the others were exact.
    pub posterior: Posterior,
    /// The noise that the log was weighed with.
    pub noise: Noise,
    /// Sum of squares of the whitened residuals and of x: about [`Update::residuals`] if nothing
    /// else has changed.
    pub chi_squared: f64,
    /// The part of x in it: at most about the number of its entries if what changed is what the
    /// prior allows for.
    pub prior: f64,
    /// Entries of x.
    pub changes: usize,
    /// Whitened residuals: three for each block, less three for each movement's offset.
    pub residuals: usize,
    /// Rows behind them.
    pub rows: usize,
    /// Gauss-Newton steps.
    pub iterations: u32,
}

impl Update {
    /// The change of eta of A, B, C in parts of the old one, with the standard error of the new.
    pub fn gains(&self, old: &FieldParameters) -> [(f64, f64); 3] {
        let errors = self.posterior.standard_errors();
        [0, 1, 2].map(|probe| {
            let (eta, new) = (old.probes[probe][ETA], self.parameters.probes[probe][ETA]);
            let error = errors[probe * PER_PROBE + ETA];
            ((new - eta) / eta, (error / eta).abs())
        })
    }
}

/// Fits the change to all rows of a dataset. The signals are compensated by k and h of the old calibration.
/// `covariance` is the old [`Posterior::covariance`]; without it the other parameters are fixed. `drift` is the
/// walk of the reference in X, Y, Rz in a second, m, m, rad: a few seconds do not determine it.
///
/// # Errors
/// [`FieldFitError::Singular`] where a number is not finite or
/// `covariance` is none.
pub fn update(
    dataset: &Dataset,
    stage: &Stage,
    old: &FieldParameters,
    covariance: Option<&DMatrix<f64>>,
    change: Change,
    drift: [f64; 3],
) -> Result<Update, FieldFitError> {
    let all: Vec<usize> = (0..dataset.rows.len()).collect();
    let rows = Rows::new(dataset, &all);
    let basis = factor(old, covariance, change).ok_or(FieldFitError::Singular)?;
    let offsets = vec![[0.0; 3]; rows.movements.len()];
    let equations = FieldEquations {
        rows: &rows,
        places: old.places,
        noise: Noise {
            white_m: white_m(&rows, &probes(old), &Dynamics::default(), &offsets, stage),
            drift,
        },
        resets: stage.reset_sd,
        faults: &[],
    };
    let mut origin = DVector::zeros(UNKNOWNS);
    origin.as_mut_slice()[..COUNT].copy_from_slice(old.probes.as_flattened());
    let changes = basis.ncols();
    let mut unknowns = Unknowns {
        origin,
        basis,
        prior: DMatrix::identity(changes, changes),
        ranges: Vec::new(),
    };
    let x = DVector::zeros(changes);
    // As in a fit: what acceleration adds is an unknown where the log determines it.
    let at = Point {
        values: unknowns.origin.clone(),
        offsets: offsets.clone(),
    };
    let expected =
        (equations.normal(&at)).and_then(|normal: Normal<COLUMNS>| unknowns.covariance(&normal));
    if !expected.is_some_and(|all| MotionFit::is_shown_by(&all)) {
        unknowns
            .basis
            .rows_mut(ACCELERATIONS, UNKNOWNS - ACCELERATIONS)
            .fill(0.0);
    }
    let solved: Option<Solved<COLUMNS>> =
        gauss_newton::solve(&equations, &unknowns, x, offsets, Limits::CLOSE);
    let mut solved = solved.ok_or(FieldFitError::Singular)?;
    let mut lasting = unknowns.basis.clone();
    if change == Change::Temperature {
        // The errors of the temperatures belong to this log only. Their column is the last before the columns of motion.
        lasting.column_mut(changes - MOTION_COLUMNS - 1).fill(0.0);
    }
    let prior = unknowns.prior_squares(&solved.x);
    let chi_squared = solved.normal.chi_squared() + prior;
    let known = covariance.map_or(0, DMatrix::nrows);
    let mut open = None;
    if matches!(change, Change::Gain | Change::Gains) {
        open = Some(unknowns.basis.columns(0, known).into_owned());
        unknowns.basis.columns_mut(0, known).fill(0.0);
        lasting.clone_from(&unknowns.basis);
        let (x, offsets) = (DVector::zeros(changes), solved.point.offsets);
        let again = gauss_newton::solve(&equations, &unknowns, x, offsets, Limits::CLOSE);
        solved = again.ok_or(FieldFitError::Singular)?;
    }
    let inverse = unknowns.factor(&solved.normal);
    let inverse = inverse.ok_or(FieldFitError::Singular)?.inverse();
    let mut all = &lasting * inverse * lasting.transpose();
    if let Some(open) = open {
        // Errors e of the other parameters leave e - C N e: the gains take up what the log sees of them.
        let curvature = |i, j| solved.normal.curvature(i, j);
        let curvature = DMatrix::from_fn(UNKNOWNS, UNKNOWNS, curvature);
        let left = &open - &all * (curvature * &open);
        all += &left * left.transpose();
    }
    solved.point.values = &unknowns.origin + &lasting * &solved.x;
    let parameters = equations.parameters(&solved.point);
    let noise = equations.noise;
    let posterior = Posterior::new(&all, &parameters, &noise);
    Ok(Update {
        posterior: match covariance.is_some_and(|covariance| covariance.nrows() > COUNT) {
            true => posterior.with_temperature(&all),
            false => posterior,
        },
        parameters,
        noise,
        chi_squared,
        prior,
        changes,
        residuals: 3 * (rows.blocks.len() - rows.movements.len()),
        rows: rows.rows.len(),
        iterations: solved.steps,
    })
}

/// L, over all unknowns. `None` if `covariance` is no covariance.
fn factor(
    old: &FieldParameters,
    covariance: Option<&DMatrix<f64>>,
    change: Change,
) -> Option<DMatrix<f64>> {
    let changes = change.columns(old);
    let known = covariance.map_or(0, DMatrix::nrows);
    let mut l = DMatrix::zeros(UNKNOWNS, known + changes.len() + MOTION_COLUMNS);
    if let Some(covariance) = covariance {
        // Scaled to a diagonal of ones: the units differ by orders of magnitude.
        let scale = covariance.diagonal().map(f64::sqrt);
        let scaled = DMatrix::from_fn(known, known, |i, j| {
            covariance[(i, j)] / (scale[i] * scale[j])
        });
        let scaled = Cholesky::new(scaled)?.unpack();
        for i in 0..known {
            for j in 0..=i {
                l[(i, j)] = scale[i] * scaled[(i, j)];
            }
        }
    }
    for (j, column) in changes.iter().enumerate() {
        for (i, value) in column.iter().enumerate() {
            l[(i, known + j)] = *value;
        }
    }
    let lags = known + changes.len();
    l[(LAG, lags)] = LAG_S;
    (l.fixed_view_mut::<2, 2>(PROBE_LAGS, lags + 1)).copy_from(&lag_prior().l());
    for k in ACCELERATIONS..UNKNOWNS {
        l[(k, lags + 3 + k - ACCELERATIONS)] = PER_ACCELERATION;
    }
    Some(l)
}
