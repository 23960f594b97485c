//! What is said of a calibration that was brought up to date.

use super::warnings_of;
use crate::fit::of_undecoded;
use crate::input::log::LogReading;
use crate::recalibrate::Recalibration;
use crate::report::errors::errors;
use crate::report::field::by_axis;
use crate::solve::field::update::Change;
use serde_json::{Value, json};

/// What the user should know of it.
pub fn warnings_of_recalibration(log: &LogReading, new: &Recalibration) -> Vec<String> {
    let mut warnings = warnings_of(log);
    let undecoded = of_undecoded(new.judgement.undecoded);
    warnings.extend(undecoded.map(|found| found.message));
    if new.known.is_none() {
        warnings.push(
            "no posterior stands beside the old blob: the predicted errors count those of the gains alone, and the new \
             blob can only have its gains recalibrated"
                .to_owned(),
        );
    }
    warnings
}

/// The figures.
pub fn figures_of_recalibration(
    change: Change,
    new: &Recalibration,
    log: &LogReading,
    warnings: &[String],
) -> Value {
    let gain = |(change, error): (f64, f64)| json!({ "change_percent": change * 100.0, "standard_error_percent": error * 100.0 });
    let [a, b, c] = new.gains.map(gain);
    // rms errors, from ratios to the noise floor.
    let rms = |ratios: [f64; 3]| by_axis([0, 1, 2].map(|k| new.floor[k] * ratios[k]));
    json!({
        "what": change.name(),
        "rows": log.dataset.rows.len(),
        "movements": log.dataset.movements.len(),
        "gains": { "a": a, "b": b, "c": c },
        // What is predicted for service over the calibrated range: with the old blob, with the new one,
        // and by the noise of the probes alone.
        "predicted_service": {
            "before": rms(new.before), "after": rms(new.after), "floor": rms([1.0; 3]),
        },
        // Whether an old posterior was there, and a new one is.
        "posterior": new.known.is_some(),
        // Over residuals: about 1.
        "chi_squared": new.chi_squared,
        // Over the log, zero deviations refitted.
        "errors": errors(&new.judgement.errors),
        "errors_before": errors(&new.judgement_before.errors),
        "serial": new.set.serial.as_str(),
        "warnings": warnings,
        "verdict": new.diagnosis.verdict,
        "predicted": new.diagnosis.predicted,
        "findings": new.diagnosis.findings,
    })
}
