//! What a fit says of itself, as findings.

use crate::fit::Fit;
use crate::judge::identify::{FitFailure, check_described};
use crate::judge::predicted::Predicted;
use crate::judge::statistics;
use crate::judge::verdict;
use hallstage_input::channel::Channel;
use hallstage_input::dataset::Dataset;
use hallstage_input::finding::{Finding, Kind, Place, Severity};
use hallstage_input::stage::Stage;
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
    let left_out = fit.fitted.left_out(dataset);
    let severity = severity(left_out.share());
    let (first, last) = left_out.span.filter(|_| severity > Severity::Note)?;
    let [from, to] = [first, last].map(|at| dataset.movement_named(at.log, at.movement));
    let end = Place {
        movement: to,
        t_us: last.t_us,
    };
    let kind = Kind::LeftOut {
        rows: left_out.rows,
        of: left_out.of,
        end,
    };
    let found = Finding::new(kind).with_severity(severity);
    Some(found.with_place(from, first.t_us))
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
    let severity = verdict::severity(1.0 / shown);
    let kind = Kind::ShortMovements {
        mean_rows: mean,
        hidden: 1.0 - shown,
    };
    (severity > Severity::Note).then(|| Finding::new(kind).with_severity(severity))
}

/// Why a fit is not the field model, and what it is good for; a warning where its errors are so many times their
/// noise that no other finding explains.
pub(super) fn not_field(
    fit: &Fit,
    predicted: Option<&Predicted>,
    unexplained: Option<f64>,
) -> Option<Finding> {
    let over_noise = unexplained.filter(|ratio| *ratio > ERROR_TO_NOISE_MAX);
    let severity = over_noise.map_or(Severity::Note, |_| Severity::Warn);
    let kind = Kind::OtherModel {
        reason: fit.model_reason.clone(),
        in_service: predicted.map(|predicted| predicted.range),
        over_noise,
    };
    let found = Finding::new(kind).with_severity(severity);
    (fit.model.kind != ModelKind::Field).then_some(found)
}

/// A fit that leaves most of the motion unexplained and was kept all the same.
pub(super) fn undescribed(fit: &Fit, dataset: &Dataset, stage: &Stage) -> Option<Finding> {
    let errors = fit.sound_errors(dataset, stage);
    let failure = check_described(dataset, &errors, fit.model).err()?;
    let FitFailure::NotDescribed {
        model,
        motion,
        error_micro,
        motion_micro,
    } = failure
    else {
        return None;
    };
    let kind = Kind::NotDescribed {
        model,
        error: error_micro * 1e-6,
        motion: motion_micro * 1e-6,
    };
    let axis = Channel::POSE[motion as usize];
    Some(
        Finding::new(kind)
            .with_channel(axis)
            .with_severity(Severity::Refuse),
    )
}

/// rms errors of a fit over their noise from sample to sample, of the worst axis.
pub fn over_noise(fit: &Fit, dataset: &Dataset) -> f64 {
    let errors = fit.errors_by_row(dataset);
    let ratios = statistics::over_noise(&errors, &dataset.movements);
    ratios.into_iter().fold(0.0, f64::max)
}
