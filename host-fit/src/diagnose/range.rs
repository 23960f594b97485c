//! Poses beyond the range of a calibration.

use super::finding::{Code, Finding};
use super::warning;
use crate::input::dataset::Dataset;
use runtime::ParameterSet;

/// The rows whose pose leaves the range in which a blob was calibrated.
pub fn out_of_range(set: &ParameterSet, dataset: &Dataset) -> Option<Finding> {
    let planar = set.constants.calibrated_planar.map(f64::from);
    let vertical = set.constants.calibrated_vertical.map(f64::from);
    let beyond = |pose: [f64; 3], range: [f64; 3]| (0..3).any(|k| pose[k].abs() > range[k]);
    let mut rows = (dataset.rows.iter())
        .filter(|row| beyond(row.reference, planar) || beyond(row.vertical, vertical));
    let first = rows.next()?;
    let count = 1 + rows.count();
    Some(Finding {
        message: format!(
            "{count} of {} rows are beyond the range of the logs that the parameter blob was fitted to, where it is extrapolated: \
             fit it to logs of the whole range of service",
            dataset.rows.len()
        ),
        movement: (dataset.movements.get(first.movement)).map(|m| dataset.movement_name(m)),
        t_us: Some(first.t_us),
        value: Some(count as f64),
        unit: Some("rows"),
        ..warning(Code::OutOfRange)
    })
}
