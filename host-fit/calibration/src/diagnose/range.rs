//! Poses beyond the range of a calibration, and motion that is not the declared one.

use crate::finding::{Code, Finding};
use crate::input::dataset::{Dataset, Row};
use crate::input::stage::{AXES, Stage};
use runtime::ParameterSet;

/// An axis that spans more than this times its declared range, or less than that, has another scale or
/// moves otherwise: no log shows a scale that is common to all channels of a kind.
pub(super) const SPANS: (f64, f64) = (0.1, 2.0);

/// X, Y, Rz, Z, Rx, Ry: m, rad.
fn pose(row: &Row) -> impl Iterator<Item = f64> {
    row.reference.into_iter().chain(row.vertical)
}

/// Axes that span far more or far less than `[motion]` declares.
pub(super) fn undeclared(dataset: &Dataset, stage: &Stage) -> impl Iterator<Item = Finding> {
    let mut ends = [[f64::INFINITY, f64::NEG_INFINITY]; AXES.len()];
    for row in &dataset.rows {
        for ([low, high], value) in ends.iter_mut().zip(pose(row)) {
            (*low, *high) = (low.min(value), high.max(value));
        }
    }
    let axes = AXES.iter().zip(stage.motion.axes).zip(ends);
    axes.filter_map(|(((axis, _), motion), [low, high])| {
        let [span, service] = [high - low, 2.0 * motion.service].map(|x| x * 1e6);
        let part = span / service;
        if !part.is_finite() || (SPANS.0..=SPANS.1).contains(&part) {
            return None;
        }
        let unit = if axis.starts_with('r') { "urad" } else { "um" };
        let message = format!(
            "the log spans {span:.0} {unit} in {axis}, service {service:.0} ([motion] in stage.toml): a scale of all channels of a \
             kind may be wrong, which nothing else shows; check units and scales, or declare the motion"
        );
        Some(Finding::new(Code::OutOfRange, message).on(*axis).of(span, unit))
    })
}

/// The rows whose pose leaves the range in which a blob was calibrated.
pub fn out_of_range(set: &ParameterSet, dataset: &Dataset) -> Option<Finding> {
    let constants = &set.constants;
    let range = [constants.calibrated_planar, constants.calibrated_vertical].concat();
    let is_beyond = |(value, end): (f64, &f32)| value.abs() > f64::from(*end);
    let mut rows = (dataset.rows.iter()).filter(|row| pose(row).zip(&range).any(is_beyond));
    let first = rows.next()?;
    let count = 1 + rows.count();
    let message = format!(
        "{count} of {} rows are beyond the range of the logs that the parameter blob was fitted to, where it is extrapolated: \
         fit it to logs of the whole range of service",
        dataset.rows.len()
    );
    let name = dataset.movement_name(&dataset.movements[first.movement]);
    let found = Finding::new(Code::OutOfRange, message);
    Some(found.at(name, first.t_us).of(count as f64, "rows"))
}
