//! What a fit says of itself, as findings.

use super::bank;
use crate::fit::Fit;
use crate::judge::identify::check_described;
use crate::judge::statistics;
use crate::judge::verdict::Predicted;
use hallstage_input::dataset::Dataset;
use hallstage_input::finding::{Code, Finding, Severity};
use runtime::ModelKind;

/// A fault in this part of the rows, or one that makes noise or a period so much larger, is worth a warning, ...
const WARN_MIN: f64 = 0.02;
/// ... and refused from this on: the rest may be another stage than the log shows.
const REFUSED_MIN: f64 = 0.08;
/// Errors beyond this many times their white noise are not the drift of an interferometer.
pub const ERROR_TO_NOISE_MAX: f64 = 3.0;

/// Of a fault by its share of the rows, of the noise or of a period.
pub(super) const fn severity(share: f64) -> Severity {
    match share {
        REFUSED_MIN.. => Severity::Refuse,
        WARN_MIN.. => Severity::Warn,
        _ => Severity::Note,
    }
}

/// The rows that count less than half in a fit, where they are more than a few.
pub(super) fn left_out(fit: &Fit, dataset: &Dataset) -> Option<Finding> {
    let left_out = &fit.left_out;
    let severity = severity(left_out.share());
    let (first, last) = left_out.span.filter(|_| severity > Severity::Note)?;
    let [from, to] = [first, last].map(|at| dataset.movement_named(at.log, at.movement));
    let message = format!(
        "{} of {} rows ({:.1} %), from movement {from}, t_us = {}, to movement {to}, t_us = {}, are so far from the fitted \
         model that they count little or nothing in the fit: {} (--loss none lets every row count)",
        left_out.rows,
        left_out.of,
        100.0 * left_out.share(),
        first.t_us,
        last.t_us,
        Code::LeftOut.entry().remedy,
    );
    let found = Finding::new(Code::LeftOut, message).severe(severity);
    Some(found.at(from, first.t_us).of(left_out.rows as f64, "rows"))
}

/// Whether the errors of a model with zero deviations are too small, for each fits a row of its movement.
pub(super) fn short_movements(fit: Option<&Fit>, dataset: &Dataset) -> Option<Finding> {
    if fit.is_some_and(|fit| !fit.model.has_zero_deviation) {
        return None;
    }
    let (movements, rows) = match fit {
        Some(fit) => (&fit.judgement.movements, fit.judgement.rows()),
        None => (&dataset.movements, dataset.rows.len()),
    };
    let mean = rows as f64 / movements.len().max(1) as f64;
    let shown = (1.0 - 1.0 / mean).max(0.0).sqrt();
    let severity = bank::severity(1.0 / shown);
    (severity > Severity::Note).then(|| {
        let message = format!(
            "the movements have {mean:.1} rows on the mean, and each has a zero deviation of its own, which fits one of them \
             whatever the calibration is: the errors come out too small by about {:.0} %. Check the times and the movement \
             column; a log without one begins a movement after every gap of more than ten rows",
            100.0 * (1.0 - shown),
        );
        Finding::new(Code::ShortMovements, message).severe(severity).of(mean, "rows")
    })
}

/// Why a fit is not the field model, and what it is good for; a warning where its errors are so many times their
/// noise that no other finding explains.
pub(super) fn not_field(
    fit: &Fit,
    predicted: Option<&Predicted>,
    unexplained: Option<f64>,
) -> Option<Finding> {
    let mut message = fit.model_reason.clone();
    if let Some(predicted) = predicted {
        let um = predicted.range.map(|ends| ends.map(|end| end * 1e6));
        let [x, y, rz] = um.map(|[low, high]| format!("{low:.1} to {high:.1}"));
        message += &format!(
            ". It is good on movements like those of the log; in service expect {x} um in X, {y} um in Y, {rz} urad in Rz"
        );
    }
    let unexplained = unexplained.filter(|ratio| *ratio > ERROR_TO_NOISE_MAX);
    if let Some(ratio) = unexplained {
        message += &format!(
            ". Its errors are {ratio:.1} times the noise from sample to sample: something in the log is not in the model. With \
             all six axes moving at once take --model field or auto; else see the errors over the log in the report"
        );
    }
    let severity = unexplained.map_or(Severity::Note, |_| Severity::Warn);
    let lacks = Finding::new(Code::ModelLacks, message).severe(severity);
    (fit.model.kind != ModelKind::Field).then_some(lacks)
}

/// A fit that leaves most of the motion unexplained and was kept all the same.
pub(super) fn undescribed(fit: &Fit, dataset: &Dataset) -> Option<Finding> {
    let failure = check_described(dataset, &fit.sound, fit.model).err()?;
    Some(Finding::new(Code::ModelLacks, failure.to_string()).severe(Severity::Refuse))
}

/// rms errors of a fit over their noise from sample to sample, of the worst axis.
pub fn over_noise(fit: &Fit, dataset: &Dataset) -> f64 {
    let errors = fit.decoded.errors_less(&fit.judgement.zeros, dataset);
    let ratios = statistics::over_noise(&errors, &dataset.movements);
    ratios.into_iter().fold(0.0, f64::max)
}
