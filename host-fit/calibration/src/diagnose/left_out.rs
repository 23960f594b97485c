//! Rows that a fit left out of account, where they are more than a few.

use super::signals::period_s;
use super::warning;
use crate::finding::{Code, Finding, Severity};
use crate::fit::Fit;
use crate::input::dataset::Dataset;
use crate::input::stage::Stage;
use crate::judge::identify::check_explained;

/// Told from this part of the rows on, ...
const TOLD_MIN: f64 = 0.02;
/// ... and refused from this on: what the rest says of the stage is no longer what the log says.
const REFUSED_MIN: f64 = 0.08;
/// Or from this on, where the errors over all rows are beyond what a fit may leave of the motion and no
/// channel is found that stood still for as long.
const UNEXPLAINED_MIN: f64 = 0.05;

/// Of a channel that tells nothing in this share of the rows.
pub(super) fn severity(share: f64) -> Severity {
    match share >= REFUSED_MIN {
        true => Severity::Refuse,
        false => Severity::Warn,
    }
}

/// The rows that count less than half in a fit, or lie in a stretch of such rows.
pub(super) fn finding(
    fit: &Fit,
    dataset: &Dataset,
    stage: &Stage,
    others: &[Finding],
) -> Option<Finding> {
    let left_out = &fit.left_out;
    let share = left_out.share();
    if share < TOLD_MIN {
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
    let is_explained = check_explained(fit.all.motion, &fit.all.errors, fit.model);
    let stuck_s = others.iter().filter(|found| found.code == Code::Stuck);
    let stuck_s = stuck_s.filter_map(|found| found.value).fold(0.0, f64::max);
    let segments: Vec<_> = dataset.movements.iter().map(|m| m.rows.clone()).collect();
    let period_s = period_s(&dataset.rows, &segments, stage.servo_period_s);
    let is_named = 2.0 * stuck_s > left_out.rows as f64 * period_s;
    let is_refused =
        share >= REFUSED_MIN || share >= UNEXPLAINED_MIN && is_explained.is_err() && !is_named;
    let remedy = match is_refused {
        true => {
            "too many to take the rest for the stage: find out what happened there, leave these rows out of the log or record \
             it again (--loss none lets every row count)"
        }
        false => "look for a fault there",
    };
    Some(Finding {
        message: format!(
            "{} of {} rows ({:.1} %) are so far from the fitted model that they count little or nothing in the fit, {place}: {remedy}",
            left_out.rows,
            left_out.of,
            100.0 * left_out.rows as f64 / left_out.of.max(1) as f64,
        ),
        severity: match is_refused {
            true => Severity::Refuse,
            false => Severity::Warn,
        },
        movement: Some(movement),
        t_us: Some(t_us),
        value: Some(left_out.rows as f64),
        unit: Some("rows"),
        ..warning(Code::LeftOut)
    })
}
