//! Movements so short that their own zero deviations take their errors.

use crate::finding::{Code, Finding, Severity};
use crate::fit::Fit;
use crate::input::dataset::Dataset;

/// Rows a movement, on the mean, below which the errors come out too small: by 5 % at ten.
const MEAN_MIN: f64 = 10.0;
/// Movements of fewer rows show hardly any error, ...
const ROWS_MIN: usize = 3;
/// ... and a log with more than this part of its rows in such movements is refused.
const PART_MAX: f64 = 0.1;

/// What is to be done.
const REMEDY: &str = "check the times and the movement column; a log without one begins a movement after every gap of more \
                      than ten rows";

/// Whether the errors of a model with zero deviations are meaningless or too small.
pub(super) fn finding(fit: Option<&Fit>, dataset: &Dataset) -> Option<Finding> {
    if fit.is_some_and(|fit| !fit.model.has_zero_deviation) {
        return None;
    }
    let (movements, rows) = match fit {
        Some(fit) => (&fit.all.movements, fit.all.rows()),
        None => (&dataset.movements, dataset.rows.len()),
    };
    let count = movements.len();
    let short = || movements.iter().filter(|m| m.rows.len() < ROWS_MIN);
    let rows_of_short: usize = short().map(|movement| movement.rows.len()).sum();
    if rows_of_short as f64 > PART_MAX * rows as f64 {
        let first = short().next()?;
        let message = format!(
            "{rows_of_short} of {rows} rows are in movements of one or two rows, whose zero deviations fit them whatever the \
                 calibration is, so that the errors say nothing about it: {REMEDY}"
        );
        let found = Finding::new(Code::ShortMovements, message).severe(Severity::Refuse);
        let found = found.of(rows_of_short as f64, "rows");
        return Some(Finding {
            movement: Some(dataset.movement_name(first)),
            ..found
        });
    }
    let mean = rows as f64 / count.max(1) as f64;
    (mean < MEAN_MIN).then(|| {
        let message = format!(
            "the movements have {mean:.1} rows on the mean, and each has a zero deviation of its own: the errors come out too \
             small by about {:.0} %: {REMEDY}",
            100.0 * (1.0 - (1.0 - 1.0 / mean).max(0.0).sqrt()),
        );
        Finding::new(Code::ShortMovements, message).of(mean, "rows")
    })
}
