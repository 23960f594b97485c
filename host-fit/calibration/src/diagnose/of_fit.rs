//! What a fit says of itself, as findings.

use crate::finding::{Code, Finding, Severity};
use crate::fit::Fit;
use crate::input::dataset::Dataset;
use crate::judge::identify::check_described;
use crate::judge::statistics::white_noise;
use crate::judge::verdict::Predicted;
use runtime::ModelKind;

/// Errors beyond this many times their white noise are not the drift of an interferometer.
pub const ERROR_TO_NOISE_MAX: f64 = 3.0;
/// Noise below this, m or rad, is rounding.
const NOISE_MIN: f64 = 0.05e-6;

/// Why a fit is not the field model, and what it is good for.
pub(super) fn not_field(fit: &Fit, predicted: Option<&Predicted>) -> Option<Finding> {
    let expected = predicted.map(|predicted| {
        let [x, y, rz] = predicted
            .range
            .map(|ends| ends.map(|end| end * 1e6))
            .map(|[low, high]| format!("{low:.1} to {high:.1}"));
        format!(
            ". It is good on movements like those of the log; in service expect {x} um in X, {y} um in Y, {rz} urad in Rz"
        )
    });
    (fit.model.kind != ModelKind::Field).then(|| {
        let message = fit.model_reason.clone() + &expected.unwrap_or_default();
        Finding::new(Code::ModelLacks, message).severe(Severity::Note)
    })
}

/// A fit that leaves most of the motion unexplained and was kept all the same.
pub(super) fn undescribed(fit: &Fit, dataset: &Dataset) -> Option<Finding> {
    let failure = check_described(dataset, &fit.sound, fit.model).err()?;
    Some(Finding::new(Code::ModelLacks, failure.to_string()).severe(Severity::Refuse))
}

/// Errors far above the noise from sample to sample.
pub fn unexplained(fit: &Fit, dataset: &Dataset) -> Option<Finding> {
    const AXES: [(&str, &str, &str); 3] =
        [("x", "X", "um"), ("y", "Y", "um"), ("rz", "Rz", "urad")];
    let errors = fit.decoded.errors_less(&fit.judgement.zeros, dataset);
    let noise = white_noise(&errors, &dataset.movements).map(|noise| noise.max(NOISE_MIN));
    let ratio = |axis: usize| fit.sound.axes[axis].rms / noise[axis];
    let worst = (0..3).max_by(|&a, &b| ratio(a).total_cmp(&ratio(b)))?;
    let (channel, axis, unit) = AXES[worst];
    let rms = fit.sound.axes[worst].rms * 1e6;
    (ratio(worst) > ERROR_TO_NOISE_MAX).then(|| {
        let message = format!(
            "{} leaves {rms:.2} {unit} rms in {axis}, {:.1} times the noise from sample to sample: something in the log is not \
             in the model. With all six axes moving at once take --model field or auto; else see the other findings, and the \
             errors over the log in the report",
            fit.model.title(),
            ratio(worst)
        );
        let found = Finding::new(Code::ModelLacks, message);
        found.on(channel).of(rms, unit)
    })
}
