//! Poses beyond the range of a calibration, and motion that is not the declared one.

use crate::fit::{Fit, RANGE_MARGIN};
use hallstage_input::axis::{AXES, Axis};
use hallstage_input::dataset::{Dataset, Row};
use hallstage_input::finding::{Code, Finding};
use hallstage_input::stage::Stage;
use runtime::ParameterSet;

/// An axis that moves by more than this times its declared range, or less than that, has another scale or
/// moves otherwise: no log shows a scale that is common to all channels of a kind.
pub(super) const SPANS: (f64, f64) = (0.1, 2.0);
/// The field model is less good than predicted beyond a log that moves an axis by less than this part.
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
    let axes = AXES.iter().zip(stage.motion.axes).zip(moved);
    axes.filter_map(move |((Axis { key: axis, micro: unit, .. }, motion), moved)| {
        let [moved, service] = [moved / RANGE_MARGIN, motion.service].map(|x| x * 1e6);
        let part = moved / service;
        let what = match (SPANS.0..=SPANS.1).contains(&part) {
            true if is_for_service && part < RANGE_MIN => {
                "errors beyond the log's range are larger than predicted; `host-fit plan` makes a run of full range"
            }
            true => return None,
            false => {
                "a scale of all channels of a kind may be wrong, which nothing else shows; check units and scales, or declare the \
                 motion"
            }
        };
        let message = format!(
            "the log moves {axis} by {moved:.0} {unit} to either side, service by {service:.0} ([motion] in stage.toml): {what}"
        );
        Some(Finding::new(Code::OutOfRange, message).on(*axis).of(moved, *unit))
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
