//! The verdict of a report: one sentence that says whether the calibration can be used.

use super::errors::Errors;
use super::field::PosePrediction;
use super::json::Report;
use crate::diagnose::finding::{Finding, Severity};
use crate::diagnose::of_fit::ERROR_TO_NOISE_MAX;
use serde::Serialize;

/// What the reader is told first.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Verdict {
    /// How the page marks it: `good`, `warn` or `refuse`.
    pub mark: &'static str,
    /// The word for it.
    pub word: String,
    /// What follows the word: what was refused and why, or how large the errors are.
    pub sentence: String,
}

/// How a run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End<'a> {
    /// With a parameter blob.
    Written,
    /// With the best so far in the blob; the log was not diagnosed.
    Interrupted,
    /// Without a blob, for this reason.
    Failed(&'a str),
}

/// X and Y in um, Rz in urad.
fn three([x, y, rz]: [f64; 3]) -> String {
    format!("{x:.2} um, {y:.2} um, {rz:.2} urad")
}

/// How large the errors are, beside what noise gives, and what is predicted for service.
fn accuracy(report: &Report, noise: [f64; 3]) -> String {
    let Errors { x, y, rz } = report.errors;
    let mut words = format!(
        "errors in X, Y, Rz of {} rms over all {} rows (peaks {}); noise from row to row {}",
        three([x.rmse_um, y.rmse_um, rz.rmse_urad]),
        report.rows,
        three([x.peak_um, y.peak_um, rz.peak_urad]),
        three(noise.map(|noise| noise * 1e6)),
    );
    if let Some(field) = &report.field {
        let add = |p: &PosePrediction| {
            let by = p.systematic;
            format!("{} ({})", three([by.x_um, by.y_um, by.rz_urad]), p.place)
        };
        let all: Vec<String> = field.pose_uncertainty.iter().map(add).collect();
        words += &format!(
            "; standard deviation that the parameters add to a pose {}",
            all.join(", ")
        );
    }
    words + "."
}

impl Verdict {
    /// Of a run; of its fit the figures, and the noise of its errors from row to row (m, m, rad).
    pub fn new(end: End, findings: &[Finding], fit: Option<(&Report, [f64; 3])>) -> Self {
        let of = |severity| findings.iter().filter(|f| f.severity == severity).count();
        let sentence = fit.map(|(report, noise)| accuracy(report, noise));
        let verdict = |mark, word: &str| Self {
            mark,
            word: word.to_owned(),
            sentence: sentence.unwrap_or_default(),
        };
        match (end, of(Severity::Refuse), of(Severity::Warn)) {
            (End::Failed(why), ..) => Self {
                mark: "refuse",
                word: "Refused".to_owned(),
                sentence: format!("no parameter blob was written: {why}."),
            },
            (End::Interrupted, ..) => verdict("warn", "Interrupted, the best so far"),
            (End::Written, 1.., _) => verdict("refuse", "Written in spite of a refusal"),
            (End::Written, 0, 0) => verdict("good", "Good"),
            (End::Written, 0, n) => {
                // A wrong log may still give a good fit, which the errors show.
                let beyond = |(report, noise): (&Report, [f64; 3])| {
                    let Errors { x, y, rz } = report.errors;
                    let rms = [x.rmse_um, y.rmse_um, rz.rmse_urad];
                    (0..3).any(|axis| rms[axis] > ERROR_TO_NOISE_MAX * noise[axis] * 1e6)
                };
                let word = if fit.is_some_and(beyond) {
                    "Doubtful"
                } else {
                    "Good"
                };
                let warnings = if n == 1 {
                    "a warning".to_owned()
                } else {
                    format!("{n} warnings")
                };
                verdict("warn", &format!("{word}, with {warnings}"))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::finding::Code;

    #[test]
    fn a_failure_or_the_gravest_finding_decides() {
        let finding = |severity| Finding {
            code: Code::Hum,
            severity,
            message: String::new(),
            channel: None,
            movement: None,
            t_us: None,
            value: None,
            unit: None,
        };
        let (note, warn, refuse) = (
            finding(Severity::Note),
            finding(Severity::Warn),
            finding(Severity::Refuse),
        );
        let verdict = |findings: &[Finding]| {
            let verdict = Verdict::new(End::Written, findings, None);
            (verdict.mark, verdict.word)
        };
        assert_eq!(
            verdict(std::slice::from_ref(&note)),
            ("good", "Good".to_owned())
        );
        let one = verdict(&[warn.clone(), note]);
        assert_eq!(one, ("warn", "Good, with a warning".to_owned()));
        assert_eq!(verdict(&[warn.clone(), warn]).1, "Good, with 2 warnings");
        // What is written all the same is not good.
        assert_eq!(verdict(&[refuse]).0, "refuse");
        let failed = Verdict::new(End::Failed("no motion in X"), &[], None);
        assert!(failed.word == "Refused" && failed.sentence.contains("no motion in X"));
    }
}
