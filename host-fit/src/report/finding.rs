//! What a fit found about its log, in a form that programs can rely on: the warnings of the fit, and
//! why it is not the field model.

use crate::fit::{Fit, FitWarning};
use runtime::ModelKind;
use serde::Serialize;

/// What is to be done about a finding.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Severity {
    /// Nothing: worth knowing.
    Note,
    /// The calibration is less good, or less certain, than it could be.
    Warn,
}

/// What was found. The names are stable.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Code {
    /// The reference shows an earlier or later pose than the probes.
    ReferenceLag,
    /// Rows far outside the noise.
    Outliers,
    /// Rows with codes that the decoder refuses.
    Saturated,
    /// Zero deviations at an end of their range.
    ZeroClipped,
    /// Parameters at an end of their search range.
    TermsAtLimit,
    /// Movements without a row among those drawn.
    RowsMissing,
    /// Service goes further than the log.
    OutOfRange,
    /// The log can't carry a better model.
    ModelLacks,
}

/// One finding.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Finding {
    /// What was found.
    pub code: Code,
    /// What is to be done about it.
    pub severity: Severity,
    /// A sentence with the evidence and the remedy.
    pub message: String,
    /// The channel or axis, for instance `hall_a` or `x`.
    pub channel: Option<String>,
    /// The movement, by [`Dataset::movement_name`](crate::input::dataset::Dataset::movement_name).
    pub movement: Option<String>,
    /// How large, in `unit`.
    pub value: Option<f64>,
    /// Unit of the value.
    pub unit: Option<&'static str>,
}

/// The findings of a fit: its warnings, then the note on its model.
pub fn of_fit(fit: &Fit) -> Vec<Finding> {
    let mut findings: Vec<Finding> = fit.warnings.iter().map(of_warning).collect();
    if fit.model.kind == ModelKind::M31 {
        findings.push(Finding {
            code: Code::ModelLacks,
            severity: Severity::Note,
            message: fit.model_reason.clone(),
            channel: None,
            movement: None,
            value: None,
            unit: None,
        });
    }
    findings
}

fn of_warning(warning: &FitWarning) -> Finding {
    let hall = |probe: usize| Some(format!("hall_{}", ["a", "b", "c"][probe]));
    let (code, channel, value, unit) = match warning {
        FitWarning::ReferenceLags { lag_s, .. } => (Code::ReferenceLag, None, lag_s * 1e6, "us"),
        FitWarning::WildRow {
            axis,
            error_micro,
            unit,
            ..
        } => (
            Code::Outliers,
            Some(axis.to_lowercase()),
            *error_micro,
            *unit,
        ),
        FitWarning::Undecoded { rows } => (Code::Saturated, None, *rows as f64, "rows"),
        FitWarning::ZeroDeviationClipped { count, .. } => {
            (Code::ZeroClipped, None, *count as f64, "movements")
        }
        FitWarning::AtLimit { id, value } => {
            (Code::TermsAtLimit, hall(id.probe), *value, id.term.unit)
        }
        FitWarning::VerticalTermsAtLimit { count } => {
            (Code::TermsAtLimit, None, *count as f64, "parameters")
        }
        FitWarning::MovementsMissed { movements } => {
            (Code::RowsMissing, None, movements.len() as f64, "movements")
        }
        FitWarning::NarrowLog {
            axis,
            moved_micro,
            unit,
            ..
        } => (
            Code::OutOfRange,
            Some((*axis).to_owned()),
            *moved_micro,
            *unit,
        ),
    };
    let movement = match warning {
        FitWarning::WildRow { movement, .. } => Some(movement.clone()),
        _ => None,
    };
    Finding {
        code,
        severity: Severity::Warn,
        message: warning.to_string(),
        channel,
        movement,
        value: Some(value),
        unit: Some(unit),
    }
}
