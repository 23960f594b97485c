//! Poses beyond the range of a calibration, and motion that is not the declared one.

use super::limits::SPANS;
use crate::fit::{Fit, RANGE_MARGIN};
use hallstage_input::channel::Channel;
use hallstage_input::dataset::{Dataset, Row};
use hallstage_input::finding::{Finding, Kind};
use hallstage_input::stage::Stage;
use runtime::ParameterSet;

/// The errors of the field model are larger than predicted if the log moves an axis by less than this part of its
/// declared range.
const RANGE_MIN: f64 = 0.5;

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
