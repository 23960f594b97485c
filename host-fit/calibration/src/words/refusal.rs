//! Why a calibration is not to be used.

use super::{paragraph, sentence};
use crate::diagnose::refusal::{Beyond, Refusal, are_elsewhere};
use hallstage_input::axis::sign;
use hallstage_input::finding::{Finding, Severity};
use serde::ser::SerializeStruct;
use serde::{Serialize, Serializer};

/// What comes before the cause of a fit that failed.
pub const NO_FIT: &str = "The fit failed its own checks: ";

/// A refusal with the findings of its log, as JSON shows it.
#[derive(Clone, Copy, Debug)]
pub struct WordedRefusal<'a>(pub &'a Refusal, pub &'a [Finding]);

impl Serialize for WordedRefusal<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut out = serializer.serialize_struct("Refusal", 2)?;
        out.serialize_field("code", self.0.code())?;
        out.serialize_field("message", &refusal(self.0, self.1))?;
        out.end()
    }
}

/// The reason of a refusal, with the findings of the log.
pub fn refusal(refusal: &Refusal, findings: &[Finding]) -> String {
    match refusal {
        Refusal::NoFit {
            error,
            is_explained,
        } => {
            let warnings = paragraph(findings, Severity::Warn);
            let why = format!("{NO_FIT}{}", sentence_after_colon(&error.to_string()));
            match (is_explained, warnings.as_str()) {
                (_, "") => why,
                (true, _) => format!("The log is refused. {warnings}"),
                (false, _) => format!("{why} {warnings}"),
            }
        }
        Refusal::Findings => {
            format!(
                "The log is refused. {}",
                paragraph(findings, Severity::Refuse)
            )
        }
        Refusal::BeyondLimit {
            errors,
            is_in_service,
        } => {
            let place = if *is_in_service {
                "in service"
            } else {
                "on the log"
            };
            let error = |Beyond { axis, rms, limit }: &Beyond| {
                let (name, unit) = (axis.key, sign(axis.micro));
                let [rms, limit] = [rms, limit].map(|x| x * 1e6);
                format!("{name} {rms:.3} {unit} rms, limit {limit:.3} {unit}")
            };
            let errors: Vec<String> = errors.iter().map(error).collect();
            format!(
                "The errors {place} are beyond the limit: {}.",
                errors.join("; ")
            )
        }
        Refusal::Unfinished { over_noise } => format!(
            "The search was interrupted too early: its errors are {over_noise:.1} times the noise from row to row. Let it run longer."
        ),
        Refusal::OtherLog {
            worst,
            factor,
            is_field,
            apart,
        } => {
            let (axis, unit) = (worst.axis.name, sign(worst.axis.micro));
            let [error, own] = [worst.rms, worst.limit].map(|x| x * 1e6);
            let what = format!(
                "The parameter blob does not describe this log: its error in {axis} is {error:.2} {unit} rms, on its own logs it was {own:.2} {unit}, and the ratio is more than {factor} (--limit). Is it the blob of this stage?"
            );
            let refused = paragraph(findings, Severity::Refuse);
            let has_warning = findings.iter().any(|f| f.severity == Severity::Warn);
            if !refused.is_empty() {
                return format!("{what} If it is: {refused}");
            }
            let remedy = match (has_warning, apart) {
                (_, Some([lever_m, angle_rad])) if are_elsewhere([*lever_m, *angle_rad]) => {
                    let (mm, mrad) = (lever_m * 1e3, angle_rad * 1e3);
                    format!("A fit to this log has the probes elsewhere, by up to {mm:.1} mm in the lever arms and {mrad:.1} mrad in the angles: probes do not age so. If it is, they were seated anew: fit again.")
                }
                (true, _) => "If it is, the log has the faults above.".to_owned(),
                (false, Some(_)) if *is_field => {
                    "A fit to this log has the probes in the same places: if it is, bring it up to date with host-fit recalibrate.".to_owned()
                }
                _ => "If it is, and channels and scales are right, fit again, with a log of all six axes moving at once.".to_owned(),
            };
            format!("{what} {remedy}")
        }
        Refusal::NotUpdated(error) => {
            format!(
                "The calibration was not brought up to date: {}",
                sentence_after_colon(&error.to_string())
            )
        }
    }
}

/// A cause with a full stop.
fn sentence_after_colon(cause: &str) -> String {
    let mut text = sentence(cause);
    if let Some(first) = cause.get(..1) {
        text.replace_range(..1, first);
    }
    text
}
