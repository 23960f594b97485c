//! What a fit says of itself, as findings.

use super::finding::{Code, Finding, Severity};
use crate::fit::{Fit, FitWarning};
use runtime::ModelKind;

/// The warnings of a fit, and why it is not the field model.
pub fn findings(fit: &Fit) -> Vec<Finding> {
    let mut findings: Vec<Finding> = fit.warnings.iter().filter_map(of_warning).collect();
    if fit.model.kind != ModelKind::Field && fit.field.is_none() {
        findings.push(Finding {
            message: fit.model_reason.clone(),
            severity: Severity::Note,
            ..finding(Code::ModelLacks)
        });
    }
    findings
}

/// A warning of a fit; `None` for clipped zero deviations, which [`super::zeros`] names.
pub fn of_warning(warning: &FitWarning) -> Option<Finding> {
    let message = warning.to_string();
    let found = match warning {
        FitWarning::ZeroDeviationClipped { .. } => return None,
        FitWarning::AtLimit { id, value } => Finding {
            value: Some(*value),
            unit: Some(id.term.unit),
            channel: Some(format!("hall_{}", ["a", "b", "c"][id.probe])),
            ..finding(Code::TermsAtLimit)
        },
        FitWarning::VerticalTermsAtLimit { count } => Finding {
            value: Some(*count as f64),
            unit: Some(""),
            ..finding(Code::TermsAtLimit)
        },
        FitWarning::MovementsMissed { movements } => Finding {
            value: Some(movements.len() as f64),
            unit: Some("movements"),
            ..finding(Code::RowsMissing)
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
            ..finding(Code::Outliers)
        },
        FitWarning::ReferenceLags { lag_s, .. } => Finding {
            channel: Some("ifm".to_owned()),
            value: Some(lag_s * 1e6),
            unit: Some("us"),
            ..finding(Code::ReferenceLag)
        },
        FitWarning::Undecoded { rows } => Finding {
            value: Some(*rows as f64),
            unit: Some("rows"),
            ..finding(Code::Saturated)
        },
    };
    Some(Finding { message, ..found })
}

fn finding(code: Code) -> Finding {
    Finding {
        code,
        severity: Severity::Warn,
        message: String::new(),
        channel: None,
        movement: None,
        t_us: None,
        value: None,
        unit: None,
    }
}
