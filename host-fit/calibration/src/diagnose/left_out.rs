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

/// The rows that count less than half in a fit.
pub(super) fn finding(fit: &Fit, dataset: &Dataset) -> Option<Finding> {
    let left_out = &fit.left_out;
    let share = left_out.share();
    let (first, last) = left_out.span.filter(|_| share >= WARN_MIN)?;
    let [from, to] = [first, last].map(|at| dataset.movement_named(at.log, at.movement));
    let severity = severity(share);
    let remedy = match severity {
        Severity::Refuse => {
            "too many to take the rest for the stage: find out what happened there, leave these rows out of the log or record \
             it again (--loss none lets every row count)"
        }
        _ => "look for a fault there",
    };
    let message = format!(
        "{} of {} rows ({:.1} %), from movement {from}, t_us = {}, to movement {to}, t_us = {}, are so far from the fitted \
         model that they count little or nothing in the fit: {remedy}",
        left_out.rows,
        left_out.of,
        100.0 * share,
        first.t_us,
        last.t_us,
    );
    let found = Finding::new(Code::LeftOut, message).severe(severity);
    Some(found.at(from, first.t_us).of(left_out.rows as f64, "rows"))
}
