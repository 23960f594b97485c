//! What is wrong with a log, and by how much it can be trusted: between the fit and the blob.
//!
//! | module | what it does |
//! |---|---|
//! | [`finding`] | a finding: code, severity, place, size |
//! | [`hypothesis`] | mistakes that labs make, and how to undo each |
//! | [`trials`] | how well a log fits with one undone |
//! | [`causes`] | which of them alone explains a log |
//! | `consequences` | what is not told beside its cause |
//! | [`zeros`] | zero deviations beyond their range |
//! | [`logs`] | logs that contradict each other |
//! | [`change`] | a log whose two parts do |
//! | [`range`] | poses beyond the range of a calibration |
//! | `left_out` | rows that a fit left out of account |
//! | `short_movements` | movements whose zero deviations take their errors |
//! | [`of_fit`] | what a fit says of itself |
//! | [`signals`] | what the signals tell by themselves |
//! | `stretches` | parts of a long log that an excerpt of it may have missed |
//! | [`trusted`] | the inputs that no log can show to be wrong |

pub mod causes;
pub mod change;
mod consequences;
pub mod finding;
pub mod hypothesis;
mod left_out;
pub mod logs;
pub mod of_fit;
pub mod range;
mod short_movements;
pub mod signals;
mod stretches;
pub mod trials;
pub mod trusted;
pub mod zeros;

use crate::fit::{Fit, FitError};
use crate::input::dataset::Dataset;
use crate::input::stage::Stage;
use finding::{Code, Finding, Severity};
use runtime::ParameterSet;
use std::borrow::Cow;

/// Everything that is wrong with a log, the gravest first; `fitted` is what came of the fit to it.
///
/// Rows that the fit left out of account are for the tests of the signals alone.
pub fn of_log(dataset: &Dataset, stage: &Stage, fitted: Result<&Fit, &FitError>) -> Vec<Finding> {
    let outliers = fitted.map_or(&[][..], |fit| &fit.outliers);
    let sound = match outliers {
        [] => Cow::Borrowed(dataset),
        outliers => Cow::Owned(dataset.without(outliers)),
    };
    let errors = (fitted.ok()).map(|fit| &fit.decoded.errors[..]);
    let of_models = || {
        let mut findings = causes::causes(&sound, stage);
        findings.extend(logs::disagreement(&sound, stage));
        findings.extend(change::changes(dataset, &sound, stage));
        findings
    };
    let of_signals = || {
        let wider = (dataset.whole.as_ref().zip(fitted.ok()))
            .and_then(|(whole, fit)| stretches::findings(dataset, whole, stage, fit));
        wider.unwrap_or_else(|| signals::signal_findings(dataset, stage, errors))
    };
    let (mut findings, more) = rayon::join(of_models, of_signals);
    findings.extend(more);
    if let Ok(fit) = fitted {
        findings.extend(left_out::finding(fit, dataset, stage, &findings));
        findings.extend(short_movements::finding(fit, dataset));
        findings.extend(fit.warnings.iter().filter_map(of_fit::of_warning));
        if !is_explained(&findings) {
            findings.extend(of_fit::undescribed(fit, dataset));
            findings.extend(of_fit::not_field(fit));
        }
        if findings
            .iter()
            .all(|found| found.severity == Severity::Note)
        {
            findings.extend(of_fit::unexplained(fit, dataset));
        }
    }
    in_order(findings)
}

/// Everything that is wrong with a log that a blob is judged on; `errors` as in
/// [`signals::signal_findings`].
pub fn of_judged(
    dataset: &Dataset,
    stage: &Stage,
    set: &ParameterSet,
    errors: &[Option<[f64; 3]>],
) -> Vec<Finding> {
    let mut findings = causes::causes(dataset, stage);
    findings.extend(signals::signal_findings(dataset, stage, Some(errors)));
    findings.extend(range::out_of_range(set, dataset));
    in_order(findings)
}

/// Causes without their consequences, the gravest first.
fn in_order(findings: Vec<Finding>) -> Vec<Finding> {
    let mut findings = consequences::without(findings);
    findings.sort_by_key(|finding| std::cmp::Reverse(finding.severity));
    findings
}

/// Whether they name why a log cannot be fitted as it is.
pub fn is_explained(findings: &[Finding]) -> bool {
    let explains =
        |found: &Finding| found.severity == Severity::Refuse || found.code == Code::ZeroClipped;
    findings.iter().any(explains)
}

/// The messages of the findings of at least this severity, one after the other.
pub fn messages(findings: &[Finding], least: Severity) -> String {
    let grave = findings.iter().filter(|finding| finding.severity >= least);
    let messages: Vec<&str> = grave.map(|finding| finding.message.as_str()).collect();
    messages.join(". ")
}

/// A warning without message, place and size.
const fn warning(code: Code) -> Finding {
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
