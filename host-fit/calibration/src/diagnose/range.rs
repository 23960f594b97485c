//! Poses beyond the range of a calibration, and motion that is not the declared one.

use super::limits::SPANS;
use crate::fit::{Fit, RANGE_MARGIN};
use crate::judge::predicted::Predicted;
use crate::judge::verdict::GOOD_MAX;
use hallstage_input::channel::Channel;
use hallstage_input::dataset::{Dataset, Row};
use hallstage_input::finding::{Finding, Kind, Severity};
use hallstage_input::stage::{AxisMotion, Stage};
use hallstage_solver::estimator::dynamics::ARMS_M;
use hallstage_solver::estimator::rows::measured_motion;
use runtime::{CommandedMotion, ParameterSet};

/// The errors of the field model are larger than predicted if the log moves an axis by less than this part of its
/// declared range.
const RANGE_MIN: f64 = 0.5;
/// A log is faster than declared from this many times the declared rms speed or acceleration on.
const FASTER_MIN: f64 = 1.5;

/// X, Y, Rz, Z, Rx, Ry: m, rad.
fn pose(row: &Row) -> impl Iterator<Item = f64> {
    row.reference.into_iter().chain(row.vertical)
}

/// Axes that the logs of a fit move far more or far less than `[motion]` declares.
pub(super) fn undeclared(fit: &Fit, stage: &Stage) -> impl Iterator<Item = Finding> {
    let to = &fit.calibration;
    let moved = (to.calibrated_planar.into_iter()).chain(to.calibrated_vertical);
    let is_for_service = fit.field.is_some();
    let axes = Channel::POSE.into_iter().zip(stage.motion.axes).zip(moved);
    axes.filter_map(move |((axis, motion), moved)| {
        let [micro, service_micro] = [moved / RANGE_MARGIN, motion.service].map(|x| x * 1e6);
        let part = micro / service_micro;
        let is_scale = !(SPANS.0..=SPANS.1).contains(&part);
        let is_narrow = is_for_service && part < RANGE_MIN;
        let unit = axis.micro_unit();
        let kind = Kind::OtherMotion {
            micro,
            service_micro,
            unit,
            is_scale,
        };
        (is_scale || is_narrow).then(|| Finding::new(kind).with_channel(axis))
    })
}

/// A log that moves faster than service does by `[motion]`: the verdict is about the declared motion. The errors on such a
/// log, as they are and corrected for motion, say what faster service has to expect. Only the `trusted` rows show motion.
pub fn faster(
    (dataset, trusted): (&Dataset, &[bool]),
    stage: &Stage,
    (errors, corrected): ([f64; 3], Option<[f64; 3]>),
    predicted: &Predicted,
) -> Option<Finding> {
    let rows = measured_motion(dataset, trusted);
    let axes = &stage.motion.axes;
    let square = |x: f32, axis: usize| (f64::from(x) * ARMS_M[axis]).powi(2);
    let of_log = |of: &dyn Fn(&CommandedMotion) -> f64| {
        (rows.iter().map(of).sum::<f64>() / rows.len().max(1) as f64).sqrt()
    };
    let declared = |count: usize, of: fn(&AxisMotion) -> f64| {
        let squares = (0..count).map(|axis| (of(&axes[axis]) * ARMS_M[axis]).powi(2));
        (squares.sum::<f64>() / count as f64).sqrt()
    };
    let speed_m_s = [
        of_log(&|row| (0..3).map(|k| square(row.velocity[k], k)).sum::<f64>() / 3.0),
        declared(3, |axis| axis.service_speed_rms),
    ];
    let acceleration_m_s2 = [
        of_log(&|row| (0..6).map(|k| square(row.acceleration[k], k)).sum::<f64>() / 6.0),
        declared(6, |axis| axis.service_acceleration_rms),
    ];
    let is_faster = [speed_m_s, acceleration_m_s2]
        .iter()
        .any(|[log, declared]| *log > FASTER_MIN * declared);
    let worst = |errors: [f64; 3]| {
        (0..3).fold(0.0, |worst, axis| {
            f64::max(worst, errors[axis] / predicted.noise(axis))
        })
    };
    let ratio = worst(errors);
    let kind = Kind::FasterLog {
        acceleration_m_s2,
        speed_mm_s: speed_m_s.map(|speed| speed * 1e3),
        ratio,
        corrected_ratio: corrected.map(worst),
    };
    let found = Finding::new(kind).with_cost(ratio);
    is_faster.then(|| match ratio > GOOD_MAX {
        true => found,
        false => found.with_severity(Severity::Note),
    })
}

/// Rows with a pose beyond the calibrated range of a blob.
pub fn out_of_range(set: &ParameterSet, dataset: &Dataset) -> Option<Finding> {
    let constants = &set.constants;
    let range = [constants.calibrated_planar, constants.calibrated_vertical].concat();
    let is_beyond = |(value, end): (f64, &f32)| value.abs() > f64::from(*end);
    let mut rows = (dataset.rows.iter()).filter(|row| pose(row).zip(&range).any(is_beyond));
    let first = rows.next()?;
    let (rows, of) = (1 + rows.count(), dataset.rows.len());
    let name = dataset.movement_name(&dataset.movements[first.movement]);
    Some(Finding::new(Kind::BeyondRange { rows, of }).with_place(name, first.t_us))
}
