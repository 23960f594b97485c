//! What is wrong with a log, and by how much it can be trusted: between the fit and the blob.
//!
//! | module | what it does |
//! |---|---|
//! | `mistakes` | what labs mix up: order, signs, scales, places |
//! | [`structure`] | which of them alone explains a log |
//! | [`bank`] | faults of channels, logs or parts of one that contradict each other, with their cost |
//! | [`range`] | poses beyond the range of a calibration |
//! | `left_out` | rows that a fit left out of account |
//! | `short_movements` | movements whose zero deviations take their errors |
//! | [`of_fit`] | what a fit says of itself |
//! | [`signals`] | what the signals show by themselves |
//! | `slopes` | how an error of each channel shows in the Hall signals |
//! | [`temperature`] | k and h, a drift of temperature, how far a calibration is good |
//! | [`trusted`] | the inputs that no log can show to be wrong |
//!
//! ```
//! # use hall_input::input::shipped::STAGE_TOML;
//! # use hall_input::input::stage::Stage;
//! # let stage = Stage::from_toml(STAGE_TOML, "stage.toml".as_ref())?;
//! # use hall_input::input::log::{self, ReadOptions};
//! # use hall_input::input::shipped::RUN_GZ;
//! # let reading = log::read_bytes(RUN_GZ, "run30.csv.gz".as_ref(), &stage, &ReadOptions::FIT)?;
//! # let dataset = reading.dataset;
//! # use hall_calibration::fit::{FitSettings, ModelChoice, fit};
//! # let fit = fit(&dataset, &stage, &FitSettings::new(ModelChoice::Auto))?;
//! use hall_calibration::judge::verdict::Verdict;
//!
//! let diagnosis = hall_calibration::diagnose::of_log(&dataset, &stage, Ok(&fit));
//! assert!(diagnosis.findings.is_empty());
//! assert_eq!(diagnosis.verdict, Some(Verdict::Good));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod bank;
mod left_out;
mod mistakes;
pub mod of_fit;
pub mod range;
mod short_movements;
pub mod signals;
mod slopes;
pub mod structure;
#[cfg(test)]
mod structure_tests;
pub mod temperature;
pub mod trusted;

use crate::finding::{Code, Finding, Severity, in_order, is_explained};
use crate::fit::{Fit, FitError, Repair};
use crate::input::dataset::Dataset;
use crate::input::stage::Stage;
use crate::judge::identify::FitFailure;
use crate::judge::verdict::{GOOD_MAX, LIMITED_MAX, Predicted, Validity, Verdict};
use crate::problem::parameters::Parameters;
use crate::solve::field::parameters::FieldParameters;
use bank::Fitted;
use runtime::{ModelKind, ParameterSet};
use std::borrow::Cow;

/// What is wrong with a log, and what a calibration is good for.
#[derive(Clone, Debug, Default)]
pub struct Diagnosis {
    /// What is wrong, the most severe first.
    pub findings: Vec<Finding>,
    /// Whether the calibration can be used; `None` where a log cannot show that for a blob.
    pub verdict: Option<Verdict>,
    /// The errors that it has to expect at work; `None` where the log is too short or too still to show them.
    pub predicted: Option<Predicted>,
    /// The parameters without the faults of the log, for which the verdict is: see [`Fit::repaired`].
    pub repair: Option<Repair>,
    /// How far from the temperature of the log a calibration by the field model is good.
    pub validity: Option<Validity>,
}

/// Everything that is wrong with a log, and the verdict; `fitted` is what came of the fit to it.
///
/// Rows that the fit left out of account are for the tests of the signals and the channels alone.
pub fn of_log(dataset: &Dataset, stage: &Stage, fitted: Result<&Fit, &FitError>) -> Diagnosis {
    let compensated = fitted.map(|fit| dataset.compensated(fit.calibration.temperature));
    let dataset = compensated.as_deref().unwrap_or(dataset);
    let outliers = fitted.map_or(&[][..], |fit| &fit.outliers);
    let sound = match outliers {
        [] => Cow::Borrowed(dataset),
        outliers => Cow::Owned(dataset.without(outliers)),
    };
    let errors = (fitted.ok()).map(|fit| &fit.decoded.errors[..]);
    let (parameters, lag_s) = parameters_of(fitted, stage);
    let model = fitted.map_or(ModelKind::M31, |fit| fit.model.kind);
    let field = fitted.ok().and_then(|fit| fit.field.as_ref());
    let for_service = field.is_some_and(|field| !field.verdict.by_resets);
    let of_signals = || signals::signal_findings(dataset, stage, (&parameters, lag_s), errors);
    let (of_structure, (mut findings, bad)) =
        rayon::join(|| structure::structure(&sound, stage), of_signals);
    // A log that determines nothing says nothing of its channels.
    let is_described = match fitted {
        Ok(_) | Err(FitError::Failed(FitFailure::NotDescribed { .. })) => true,
        Err(_) => false,
    };
    let (mut predicted, mut repair) = (None, None);
    let described = is_described.then(|| {
        let fitted = Fitted {
            parameters: &parameters,
            model,
            for_service,
        };
        of_channels(dataset, stage, &bad, &findings, fitted)
    });
    let mut described = described.flatten();
    // A fault that leaves nothing of the residuals when it is taken off explains what a mistake would.
    let explains = |of: &&mut bank::Diagnosis| of.repair.is_some() && of.rest < LIMITED_MAX;
    if described.as_mut().filter(explains).is_none() || fitted.is_err() {
        let refuses = |found: &Finding| found.severity == Severity::Refuse;
        if let Some(of) = described
            .as_mut()
            .filter(|_| of_structure.iter().any(refuses))
        {
            (of.findings, of.repair) = (Vec::new(), None);
        }
        findings.extend(of_structure);
    }
    if let Some(of) = described {
        // The failure of a fit says more of what the log leaves open.
        let is_own = |found: &Finding| fitted.is_ok() || found.code != Code::NotDetermined;
        let found = of.findings.into_iter().filter(is_own);
        match of.repair.filter(|_| fitted.is_ok()) {
            Some((mut found_repair, expected)) => {
                for found in found {
                    found_repair.faults.push(found.message.clone());
                    findings.push(bank::repaired(found));
                }
                (predicted, repair) = (Some(expected), Some(found_repair));
            }
            None => {
                findings.extend(found);
                predicted = Some(of.predicted).filter(|_| fitted.is_ok());
            }
        }
    }
    findings.extend(short_movements::finding(fitted.ok(), dataset));
    if let Ok(fit) = fitted {
        // Rows that a fault explains are no riddle.
        if repair.is_none() {
            findings.extend(left_out::finding(fit, dataset));
        }
        // One beam that is late is a lag of all of them to a fit.
        let is_late = findings
            .iter()
            .any(|found| found.code == Code::ReferenceLag);
        let of_fit = fit.warnings.iter();
        let of_fit = of_fit.filter(|found| !is_late || found.code != Code::ReferenceLag);
        findings.extend(of_fit.cloned());
        findings.extend(temperature::findings(fit, dataset, stage));
        let ranged = |found: &Finding| {
            let is_of =
                |other: &Finding| other.code == found.code && other.channel == found.channel;
            fit.warnings.iter().any(is_of)
        };
        findings.extend(range::undeclared(dataset, stage).filter(|found| !ranged(found)));
        if !is_explained(&findings) {
            findings.extend(of_fit::undescribed(fit, dataset));
            findings.extend(of_fit::not_field(fit, predicted.as_ref()));
        }
        // Of the field model the bank says what is left.
        let is_other = fit.field.is_none();
        if is_other && findings.iter().all(|f| f.severity == Severity::Note) {
            findings.extend(of_fit::unexplained(fit, dataset));
        }
    }
    let mut findings = in_order(findings);
    let beyond = predicted
        .filter(|_| for_service)
        .and_then(|p| beyond_service(&p, &findings));
    findings.splice(0..0, beyond);
    let verdict = match fitted {
        Ok(_) => Verdict::new(for_service, predicted.as_ref(), &findings),
        Err(_) => Verdict::Refused,
    };
    Diagnosis {
        findings,
        verdict: Some(verdict),
        predicted,
        repair,
        validity: (fitted.ok())
            .and_then(|fit| fit.field.as_ref())
            .and_then(|field| {
                let (white_mm, covariance) = (field.noise.white_mm, &field.posterior.covariance);
                temperature::validity(stage, &field.parameters, white_mm, covariance)
            }),
    }
}

/// The parameters of a fit, those of the drawing where there is none, and the lag of the reference, s.
fn parameters_of(fitted: Result<&Fit, &FitError>, stage: &Stage) -> (FieldParameters, f64) {
    let of_31 = |parameters| FieldParameters::of_model_31(parameters, stage);
    match fitted {
        Ok(fit) => (
            (fit.field.as_ref()).map_or_else(|| of_31(&fit.solution.parameters), |f| f.parameters),
            fit.lag.map_or(0.0, |lag| lag.value_s),
        ),
        Err(_) => (of_31(&Parameters::designed(stage)), 0.0),
    }
}

/// That a calibration is refused for what is predicted, where no finding refuses it by itself.
fn beyond_service(predicted: &Predicted, findings: &[Finding]) -> Option<Finding> {
    let ratio = predicted.worst_ratio();
    let is_refused = findings.iter().any(|f| f.severity == Severity::Refuse);
    (ratio > LIMITED_MAX && !is_refused).then(|| {
        let message = format!(
            "all that is wrong with the log together makes errors of {ratio:.2} times the noise floor at work"
        );
        Finding::new(Code::NotDetermined, message).costing(ratio)
    })
}

/// What the bank of faults finds in the rows that are not `bad`, unless the log is refused already, and
/// what it predicts.
fn of_channels(
    dataset: &Dataset,
    stage: &Stage,
    bad: &[usize],
    others: &[Finding],
    fitted: Fitted,
) -> Option<bank::Diagnosis> {
    if dataset.logs.iter().any(|log| !log.has_reference) {
        return None;
    }
    let mut found = bank::diagnose(&dataset.without(bad), stage, fitted)?;
    let is_refused = others
        .iter()
        .any(|found| found.severity == Severity::Refuse);
    if is_refused {
        found.findings.clear();
        found.repair = None;
        return Some(found);
    }
    let all_notes = |findings: &[Finding]| findings.iter().all(|f| f.severity == Severity::Note);
    let rest = found.rest;
    if rest > LIMITED_MAX && all_notes(others) && all_notes(&found.findings) {
        let message = format!(
            "the log does not fit to itself: {rest:.1} times the noise are left of the Hall signals, and no single fault explains \
             them. Fit parts of it"
        );
        // Of other models it is what they lack.
        let cost = found.predicted.worst_ratio();
        let severity = match fitted.model {
            ModelKind::Field => bank::severity(cost).max(Severity::Warn),
            _ => Severity::Refuse,
        };
        let lacks = Finding::new(Code::ModelLacks, message).severe(severity);
        found.findings.push(lacks.of(rest, "times").costing(cost));
    }
    Some(found)
}

/// Everything that is wrong with a log that a blob is judged on; `errors` as in
/// [`signals::signal_findings`]. Of a blob that was `fitted` to it with what was known before, this is what
/// service has to expect.
pub fn of_judged(
    dataset: &Dataset,
    stage: &Stage,
    set: &ParameterSet,
    errors: &[Option<[f64; 3]>],
    fitted: Option<Predicted>,
) -> Diagnosis {
    let dataset = &*dataset.compensated(set.constants.temperature.rounded());
    let (parameters, model) = match FieldParameters::of_set(set, stage) {
        Some(parameters) => (parameters, ModelKind::Field),
        None => (
            FieldParameters::of_model_31(&Parameters::of_set(set), stage),
            set.model,
        ),
    };
    let (more, bad) = signals::signal_findings(dataset, stage, (&parameters, 0.0), Some(errors));
    let of_structure = structure::structure(dataset, stage);
    let mut findings: Vec<Finding> = of_structure.into_iter().chain(more).collect();
    let of_blob = Fitted {
        parameters: &parameters,
        model,
        for_service: model == ModelKind::Field,
    };
    let of_channels = of_channels(dataset, stage, &bad, &findings, of_blob);
    let (of_channels, predicted) =
        of_channels.map_or((Vec::new(), None), |of| (of.findings, Some(of.predicted)));
    // A log that leaves a calibration open says nothing of one that is not fitted to it.
    let is_open = |found: &Finding| found.code == Code::NotDetermined;
    let predicted = predicted.filter(|_| !of_channels.iter().any(is_open));
    let predicted = fitted.or(predicted);
    let of_channels = of_channels.into_iter().filter(|found| !is_open(found));
    // A fault bends only what is fitted.
    findings.extend(of_channels.map(|found| {
        let most = if fitted.is_some() {
            Severity::Refuse
        } else {
            Severity::Warn
        };
        let severity = found.severity.min(most);
        found.severe(severity)
    }));
    findings.extend(range::out_of_range(set, dataset));
    findings.extend(temperature::missing(&set.constants.temperature, dataset));
    let findings = in_order(findings);
    let is_bent = fitted.is_some() && findings.iter().any(|f| f.cost > Some(GOOD_MAX));
    let verdict = predicted.map(|predicted| {
        match Verdict::new(of_blob.for_service, Some(&predicted), &findings) {
            Verdict::Good if is_bent => Verdict::Limited,
            verdict => verdict,
        }
    });
    Diagnosis {
        findings,
        verdict,
        predicted,
        repair: None,
        validity: None,
    }
}
