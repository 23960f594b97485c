//! Rows that a fit left out of account, where they are more than a few.

use crate::finding::{Code, Finding, Severity};
use crate::fit::Fit;
use crate::input::dataset::Dataset;

/// A warning from this part of the rows on, ...
const WARN_MIN: f64 = 0.02;
/// ... and refused from this on: the rest may be another stage than the log shows.
const REFUSED_MIN: f64 = 0.08;
/// Of a channel whose values are void in this share of the rows.
pub(super) fn severity(share: f64) -> Severity {
    match share >= REFUSED_MIN {
        true => Severity::Refuse,
        false => Severity::Warn,
    }
}

/// The rows that count less than half in a fit, or lie in a stretch of such rows.
pub(super) fn finding(fit: &Fit, dataset: &Dataset) -> Option<Finding> {
    let left_out = &fit.left_out;
    let share = left_out.share();
    if share < WARN_MIN {
        return None;
    }
    let (first, last) = left_out.stretch?;
    let (movement, t_us) = (
        dataset.movement_named(first.log, first.movement),
        first.t_us,
    );
    let place = match left_out.stretch_rows() {
        0..=1 => format!("the first in movement {movement} at t_us = {t_us}"),
        rows => format!(
            "many of them in a stretch of {rows} rows from movement {movement}, t_us = {t_us}, to movement {}, \
             t_us = {}",
            dataset.movement_named(last.log, last.movement),
            last.t_us
        ),
    };
    let severity = severity(share);
    let remedy = match severity {
        Severity::Refuse => {
            "too many to take the rest for the stage: find out what happened there, leave these rows out of the log or record \
             it again (--loss none lets every row count)"
        }
        _ => "look for a fault there",
    };
    let message = format!(
        "{} of {} rows ({:.1} %) are so far from the fitted model that they count little or nothing in the fit, {place}: {remedy}",
        left_out.rows,
        left_out.of,
        100.0 * left_out.rows as f64 / left_out.of.max(1) as f64,
    );
    let found = Finding::new(Code::LeftOut, message).severe(severity);
    Some(found.at(movement, t_us).of(left_out.rows as f64, "rows"))
}
