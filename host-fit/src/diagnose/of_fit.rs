//! What a fit says of itself, as findings.

use super::finding::{Code, Finding, Severity};
use super::warning;
use crate::fit::{Fit, FitWarning};
use crate::input::dataset::Dataset;
use crate::judge::identify::check_described;
use crate::judge::statistics::white_noise;
use runtime::ModelKind;

/// Errors beyond this many times their white noise are not the drift of an interferometer.
pub const ERROR_TO_NOISE_MAX: f64 = 3.0;
/// Noise below this, m or rad, is rounding.
const NOISE_MIN: f64 = 0.05e-6;

/// Why a fit is not the field model, where nobody asked for another.
pub(super) fn not_field(fit: &Fit) -> Option<Finding> {
    (fit.model.kind == ModelKind::M31).then(|| Finding {
        message: fit.model_reason.clone(),
        severity: Severity::Note,
        ..warning(Code::ModelLacks)
    })
}

/// A fit that leaves most of the motion unexplained and was kept all the same.
pub(super) fn undescribed(fit: &Fit, dataset: &Dataset) -> Option<Finding> {
    let failure = check_described(dataset, &fit.sound, fit.model).err()?;
    Some(Finding {
        message: failure.to_string(),
        severity: Severity::Refuse,
        ..warning(Code::ModelLacks)
    })
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
    (ratio(worst) > ERROR_TO_NOISE_MAX).then(|| Finding {
        message: format!(
            "{} leaves {rms:.2} {unit} rms in {axis}, {:.1} times the noise from sample to sample: something in the log is not \
             in the model. With all six axes moving at once take --model field or auto; else see the other findings, and the \
             errors over the log in the report",
            fit.model.title(),
            ratio(worst)
        ),
        channel: Some(channel.to_owned()),
        value: Some(rms),
        unit: Some(unit),
        ..warning(Code::ModelLacks)
    })
}

/// A warning of a fit; `None` for clipped zero deviations, which [`super::zeros`] names.
pub(super) fn of_warning(told: &FitWarning) -> Option<Finding> {
    let message = told.to_string();
    let found = match told {
        FitWarning::ZeroDeviationClipped { .. } => return None,
        FitWarning::AtLimit { id, value } => Finding {
            value: Some(*value),
            unit: Some(id.term.unit),
            channel: Some(format!("hall_{}", ["a", "b", "c"][id.probe])),
            ..warning(Code::TermsAtLimit)
        },
        FitWarning::VerticalTermsAtLimit { count } => Finding {
            value: Some(*count as f64),
            unit: Some(""),
            ..warning(Code::TermsAtLimit)
        },
        FitWarning::MovementsMissed { movements } => Finding {
            value: Some(movements.len() as f64),
            unit: Some("movements"),
            ..warning(Code::RowsMissing)
        },
        FitWarning::WildRow {
            axis,
            unit,
            error_micro,
            movement,
            t_us,
            ..
        } => Finding {
            channel: Some(axis.to_lowercase()),
            movement: Some(movement.clone()),
            t_us: Some(*t_us),
            value: Some(*error_micro),
            unit: Some(unit),
            ..warning(Code::Outliers)
        },
        FitWarning::ReferenceLags { lag_s, .. } => Finding {
            channel: Some("ifm".to_owned()),
            value: Some(lag_s * 1e6),
            unit: Some("us"),
            ..warning(Code::ReferenceLag)
        },
        FitWarning::NarrowLog {
            axis,
            unit,
            moved_micro,
            ..
        } => Finding {
            channel: Some((*axis).to_owned()),
            value: Some(*moved_micro),
            unit: Some(unit),
            ..warning(Code::OutOfRange)
        },
        FitWarning::RestDiffers {
            axis,
            unit,
            all_micro,
            ..
        } => Finding {
            channel: Some(axis.to_lowercase()),
            value: Some(*all_micro),
            unit: Some(unit),
            ..warning(Code::ModelLacks)
        },
        FitWarning::FieldUnsettled => warning(Code::ModelLacks),
        FitWarning::Undecoded { rows } => Finding {
            value: Some(*rows as f64),
            unit: Some("rows"),
            ..warning(Code::Saturated)
        },
    };
    Some(Finding { message, ..found })
}
