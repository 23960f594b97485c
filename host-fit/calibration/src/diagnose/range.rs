//! Poses beyond the range of a calibration, and motion that is not the declared one.

use crate::finding::{Code, Finding};
use crate::input::dataset::{Dataset, Row};
use crate::input::stage::{AXES, Stage};
use runtime::ParameterSet;

/// An axis that spans more than this times its declared range, or less than that, has another scale or
/// moves otherwise: no log shows a scale that is common to all channels of a kind.
pub(super) const SPANS: (f64, f64) = (0.1, 2.0);

/// Axes that span far more or far less than `[motion]` declares.
pub(super) fn undeclared(dataset: &Dataset, stage: &Stage) -> impl Iterator<Item = Finding> {
    let spans: Vec<f64> = (0..AXES.len())
        .map(|axis| {
            let value = |row: &Row| match axis {
                0..3 => row.reference[axis],
                _ => row.vertical[axis - 3],
            };
            let values = || dataset.rows.iter().map(value);
            let low = values().fold(f64::INFINITY, f64::min);
            values().fold(f64::NEG_INFINITY, f64::max) - low
        })
        .collect();
    let axes = AXES.iter().zip(&stage.motion.axes).zip(spans);
    let off = axes.filter(|((_, motion), span)| {
        let part = span / (2.0 * motion.service);
        part.is_finite() && !(SPANS.0..=SPANS.1).contains(&part)
    });
    off.map(|(((axis, _), motion), span)| {
        let unit = if axis.starts_with('r') { "urad" } else { "um" };
        let [span, service] = [span, 2.0 * motion.service].map(|x| x * 1e6);
        let message = format!(
            "the log spans {span:.0} {unit} in {axis}, service {service:.0} ([motion] in stage.toml): a scale of all channels of a \
             kind may be wrong, which nothing else shows; check units and scales, or declare the motion"
        );
        Finding::new(Code::OutOfRange, message).on(*axis).of(span, unit)
    })
}

/// The rows whose pose leaves the range in which a blob was calibrated.
pub fn out_of_range(set: &ParameterSet, dataset: &Dataset) -> Option<Finding> {
    let planar = set.constants.calibrated_planar.map(f64::from);
    let vertical = set.constants.calibrated_vertical.map(f64::from);
    let beyond = |pose: [f64; 3], range: [f64; 3]| (0..3).any(|k| pose[k].abs() > range[k]);
    let mut rows = (dataset.rows.iter())
        .filter(|row| beyond(row.reference, planar) || beyond(row.vertical, vertical));
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
