//! Findings about the fit itself.

use crate::fit::Fit;
use crate::judge::predicted::Predicted;
use crate::judge::statistics;
use crate::judge::verdict;
use crate::words;
use hallstage_input::dataset::Dataset;
use hallstage_input::finding::{Finding, Kind, Severity};
use runtime::ModelKind;

/// Movements so short that their zero deviations make the errors too small: each zero deviation fits one row.
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
        hidden_percent: 100.0 * (1.0 - shown),
    };
    (severity > Severity::Note).then(|| Finding::new(kind).with_severity(severity))
}

/// The reason for another model than the field model, with its errors in service.
pub(super) fn not_field(fit: &Fit, predicted: Option<&Predicted>) -> Option<Finding> {
    let kind = Kind::OtherModel {
        reason: words::model_reason(fit),
        in_service_micro: predicted
            .map(|predicted| predicted.range.map(|ends| ends.map(|end| end * 1e6))),
    };
    let found = Finding::new(kind).with_severity(Severity::Note);
    (fit.model.kind != ModelKind::Field).then_some(found)
}

/// rms errors of a fit over their noise from row to row, of the worst axis.
pub fn over_noise(fit: &Fit, dataset: &Dataset) -> f64 {
    let errors = fit.errors_by_row(dataset);
    let ratios = statistics::over_noise(&errors, &dataset.movements);
    ratios.into_iter().fold(0.0, f64::max)
}
