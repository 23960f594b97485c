//! Whether a log can determine the model at all, and whether the model describes the log.

use crate::judge::statistics::PoseError;
use hallstage_input::channel::Channel;
use hallstage_input::dataset::{Dataset, Row};
use hallstage_input::stage::Stage;
use hallstage_input::statistics::median;
use hallstage_solver::estimator::model::{GAIN_TERMS, Model, ParameterId};
use hallstage_solver::estimator::paper::{Parameters, THETA, search_box};
use hallstage_solver::estimator::sandwich::Sandwich;
use nalgebra::Vector3;

/// An axis moves if its span is at least this many times its noise from row to row: a million rows of noise span ten
/// standard deviations.
const SPAN_TO_NOISE_MIN: f64 = 20.0;
/// An axis or probe with a larger span (m or rad) moves, even if it is sampled so coarsely that its motion looks like
/// noise.
const SPAN_OF_MOTION: f64 = 20e-6;
/// A parameter is determined if its error is below this part of its search range.
const ERROR_TO_RANGE_MAX: f64 = 0.1;
/// The model describes the log if its rms errors are below this part of the rms motion: the vertical terms that Model
/// (30) lacks cost less than a tenth.
const ERROR_TO_MOTION_MAX: f64 = 0.2;
/// The same for models without sensitivity or zero deviations.
const ERROR_TO_MOTION_MAX_BASELINE: f64 = 1.0;

/// Why a log has no fit, or why a fit is of no use.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FitFailure {
    /// Fewer rows than unknowns.
    TooFewRows {
        /// Rows that the fit had.
        rows: usize,
        /// Unknowns, zero deviations counted.
        unknowns: usize,
        /// Name of the model.
        model: &'static str,
    },
    /// An axis does not move in the log.
    NoMotion {
        /// The motion that is missing.
        motion: Channel,
        /// Peak-to-peak over the log, um or urad.
        span_micro: f64,
        /// Noise from sample to sample, um or urad.
        noise_micro: f64,
        /// The parameters that need the motion.
        parameters: String,
    },
    /// A Hall probe reads nothing but noise while the stage moves.
    DeadProbe {
        /// The probe.
        probe: &'static str,
        /// Peak-to-peak of its displacement within a movement, um.
        span_micro: f64,
        /// Its noise from sample to sample, um.
        noise_micro: f64,
    },
    /// The motion of the log does not determine these parameters.
    NotDetermined {
        /// The parameters, with their standard errors where there are any.
        parameters: Vec<(ParameterId, Option<f64>)>,
        /// The motions that show them.
        motions: Vec<Channel>,
    },
    /// The fitted model explains too little of the motion.
    NotDescribed {
        /// Name of the model.
        model: &'static str,
        /// The axis.
        motion: Channel,
        /// rms error, um or urad.
        error_micro: f64,
        /// rms motion, um or urad.
        motion_micro: f64,
    },
}

/// Refuses a log without motion in an axis that the model needs, or with a probe that does not follow the motion.
///
/// # Errors
/// [`FitFailure::NoMotion`] for the first such axis, [`FitFailure::DeadProbe`] for the first such
/// probe, [`FitFailure::TooFewRows`].
pub fn check_motion(
    dataset: &Dataset,
    stage: &Stage,
    train_rows: usize,
    model: &'static Model,
) -> Result<(), FitFailure> {
    let zeros = if model.has_zero_deviation {
        3 * dataset.movements.len()
    } else {
        0
    };
    let unknowns = model.free_count() + zeros;
    if 3 * train_rows <= unknowns {
        return Err(FitFailure::TooFewRows {
            rows: train_rows,
            unknowns,
            model: model.name,
        });
    }
    for (axis, motion) in Channel::POSE.into_iter().enumerate() {
        let needing = model.free().filter(|id| id.seen_in(stage) == motion);
        let parameters: Vec<String> = needing.map(|id| id.name()).collect();
        if parameters.is_empty() {
            continue;
        }
        let (span, noise) = if axis < 3 {
            span_and_noise(dataset, true, |row| row.reference[axis])
        } else {
            span_and_noise(dataset, false, |row| row.vertical[axis - 3])
        };
        if stands_still(span, noise) {
            return Err(FitFailure::NoMotion {
                motion,
                span_micro: span * 1e6,
                noise_micro: noise * 1e6,
                parameters: parameters.join(", "),
            });
        }
    }
    let plane = Parameters::designed(stage).geometry().plane();
    for (k, probe) in ["A", "B", "C"].into_iter().enumerate() {
        let (span, noise) = span_and_noise(dataset, true, |row| row.signal_m[k]);
        let (moved, _) = span_and_noise(dataset, true, |row| {
            (plane * Vector3::from(row.reference))[k]
        });
        if stands_still(span, noise) && moved > SPAN_OF_MOTION {
            return Err(FitFailure::DeadProbe {
                probe,
                span_micro: span * 1e6,
                noise_micro: noise * 1e6,
            });
        }
    }
    Ok(())
}

fn stands_still(span: f64, noise: f64) -> bool {
    span == 0.0 || (span <= SPAN_TO_NOISE_MIN * noise && span <= SPAN_OF_MOTION)
}

/// Peak-to-peak of a value (within movements where offsets differ between them, as for X, Y, Rz
/// and the probes; else over the log) and the median over movements of its noise from sample to
/// sample.
fn span_and_noise(
    dataset: &Dataset,
    within_movements: bool,
    value: impl Fn(&Row) -> f64,
) -> (f64, f64) {
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    let mut span: f64 = 0.0;
    let mut noises = Vec::new();
    for movement in &dataset.movements {
        let rows = &dataset.rows[movement.rows.clone()];
        if within_movements {
            (low, high) = (f64::INFINITY, f64::NEG_INFINITY);
        }
        let (mut steps, mut before) = (0.0, rows.first().map_or(0.0, &value));
        for value in rows.iter().map(&value) {
            low = low.min(value);
            high = high.max(value);
            steps += (value - before) * (value - before);
            before = value;
        }
        span = span.max(high - low);
        if rows.len() > 1 {
            noises.push((steps / (2.0 * (rows.len() - 1) as f64)).sqrt());
        }
    }
    (span, median(&mut noises).unwrap_or(0.0))
}

/// An error that does no harm, however narrow the search range: one per cent of sensitivity, of
/// a radian or of a lever arm of a quarter metre: one per cent of a motion.
fn tolerable(id: &ParameterId, vertical_span: [f64; 3]) -> f64 {
    const PART: f64 = 0.01;
    if id.is_slope() {
        PART / vertical_span[id.index / 3 - GAIN_TERMS].abs()
    } else if id.index < THETA {
        PART * 0.25
    } else {
        PART
    }
}

/// Refuses a fit with parameters that the log does not determine; `vertical_span` is the largest magnitude
/// of Z, Rx, Ry in the log (m, rad, rad).
///
/// # Errors
/// [`FitFailure::NotDetermined`] with every such parameter.
pub fn check_determined(
    stage: &Stage,
    model: &'static Model,
    parameters: &Parameters,
    uncertainty: &Sandwich,
    vertical_span: [f64; 3],
) -> Result<(), FitFailure> {
    let misalignment_rad = parameters.geometry().misalignment_rad;
    let ranges = search_box(stage, model, misalignment_rad);
    let (mut parameters, mut motions) = (Vec::new(), Vec::new());
    for id in model.free() {
        let open = uncertainty.undetermined.contains(&id);
        let error = uncertainty.motion_error[id.index];
        let useless = ERROR_TO_RANGE_MAX * ranges[id.index].width();
        if !open && (error <= useless || error <= tolerable(&id, vertical_span)) {
            continue;
        }
        parameters.push((id, (!open).then_some(error)));
        let motion = id.seen_in(stage);
        if !motions.contains(&motion) {
            motions.push(motion);
        }
    }
    if parameters.is_empty() {
        return Ok(());
    }
    Err(FitFailure::NotDetermined {
        parameters,
        motions,
    })
}

/// Refuses a fit that explains too little of the motion.
///
/// # Errors
/// [`FitFailure::NotDescribed`] for the first such axis.
pub fn check_described(
    dataset: &Dataset,
    errors: &PoseError,
    model: &Model,
) -> Result<(), FitFailure> {
    let n = dataset.rows.len().max(1) as f64;
    let moved = [0, 1, 2].map(|axis| {
        let squares: f64 = dataset.rows.iter().map(|r| r.reference[axis].powi(2)).sum();
        (squares / n).sqrt()
    });
    for (axis, motion) in Channel::POSE.into_iter().enumerate().take(3) {
        let moved = moved[axis];
        let error = errors.axes[axis].rms;
        let most = if model.has_zero_deviation {
            ERROR_TO_MOTION_MAX
        } else {
            ERROR_TO_MOTION_MAX_BASELINE
        };
        if error > most * moved {
            return Err(FitFailure::NotDescribed {
                model: model.name,
                motion,
                error_micro: error * 1e6,
                motion_micro: moved * 1e6,
            });
        }
    }
    Ok(())
}
