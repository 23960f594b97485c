//! What is wrong with a log, and by how much it can be trusted: between the fit and the blob.
//!
//! | module | what it does |
//! |---|---|
//! | `mistakes` | what labs mix up: order, signs, scales, places |
//! | [`structure`] | which of them alone explains a log |
//! | [`bank`] | faults of channels, logs or parts of one that contradict each other, with their cost |
//! | [`range`] | poses beyond the range of a calibration |
//! | [`of_fit`] | what a fit says of itself |
//! | [`signals`] | what the signals show by themselves |
//! | `slopes` | how an error of each channel shows in the Hall signals |
//! | [`temperature`] | k and h, a drift of temperature, how far a calibration is good |
//!
//! ```
//! # use hallstage_input::shipped::STAGE_TOML;
//! # use hallstage_input::stage::Stage;
//! # let stage = Stage::from_toml(STAGE_TOML, "stage.toml".as_ref())?;
//! # use hallstage_input::log::{self, ReadOptions};
//! # use hallstage_input::shipped::RUN_GZ;
//! # let reading = log::read_bytes(RUN_GZ, "run30.csv.gz".as_ref(), &stage, &ReadOptions::FIT)?;
//! # let dataset = reading.dataset;
//! # use hallstage_calibration::fit::{FitSettings, ModelChoice, fit};
//! # let fit = fit(&dataset, &stage, &FitSettings::new(ModelChoice::Auto))?;
//! use hallstage_calibration::judge::verdict::Verdict;
//!
//! let diagnosis = hallstage_calibration::diagnose::of_log(&dataset, &stage, Ok(&fit));
//! assert!(diagnosis.findings.is_empty());
//! assert_eq!(diagnosis.verdict, Some(Verdict::Good));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod bank;
mod mistakes;
pub mod of_fit;
pub mod range;
pub mod signals;
mod slopes;
pub mod structure;
#[cfg(test)]
mod structure_tests;
pub mod temperature;

use crate::fit::{Fit, FitError, Repair};
use crate::judge::identify::FitFailure;
use crate::judge::verdict::{GOOD_MAX, LIMITED_MAX, Predicted, Validity, Verdict};
use bank::Fitted;
use hallstage_input::dataset::Dataset;
use hallstage_input::finding::{Code, Finding, Severity, in_order, is_explained};
use hallstage_input::stage::Stage;
use hallstage_solver::problem::parameters::Parameters;
use hallstage_solver::solve::field::parameters::FieldParameters;
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
    let dataset = fitted.map_or(dataset, |fit| fit.rows(dataset));
    let compensated = fitted.map(|fit| dataset.compensated(fit.calibration.temperature));
    let dataset = compensated.as_deref().unwrap_or(dataset);
    let sound = match fitted.map_or(&[][..], |fit| &fit.outliers) {
        [] => Cow::Borrowed(dataset),
        outliers => Cow::Owned(dataset.without(outliers)),
    };
    let (parameters, lag_s) = parameters_of(fitted, stage);
    let field = fitted.ok().and_then(|fit| fit.field.as_ref());
    let by = Fitted {
        parameters: &parameters,
        model: fitted.map_or(ModelKind::M31, |fit| fit.model.kind),
        for_service: field.is_some_and(|field| !field.verdict.by_resets),
        is_to_rows: fitted.is_ok(),
    };
    let mut out = Diagnosis::default();
    match fitted {
        Err(error) => {
            // A log that determines nothing says nothing of its channels.
            let described = matches!(error, FitError::Failed(FitFailure::NotDescribed { .. }));
            out.shown(dataset, &sound, stage, by, lag_s, described);
            out.predicted = None;
        }
        Ok(fit) => {
            out.shown(dataset, &sound, stage, by, lag_s, true);
            out.add_of_fit(fit, dataset, stage);
        }
    }
    let findings = &mut out.findings;
    findings.extend(of_fit::short_movements(fitted.ok(), dataset));
    *findings = in_order(std::mem::take(findings));
    let (refused, ratio) = (is_refused(findings), out.predicted.map(|p| p.worst_ratio()));
    if let Some(ratio) = ratio.filter(|ratio| by.for_service && *ratio > LIMITED_MAX && !refused) {
        let message = format!(
            "all that is wrong with the log together makes errors of {ratio:.2} times the noise floor at work"
        );
        findings.insert(0, Finding::new(Code::NotDetermined, message).costing(ratio));
    }
    out.verdict = Some(match fitted {
        Ok(_) => Verdict::new(by.for_service, out.predicted.as_ref(), findings),
        Err(_) => Verdict::Refused,
    });
    out.validity = field.and_then(|field| {
        let (mut parameters, mut covariance) =
            (field.parameters, field.posterior.covariance.clone());
        if let Some(repair) = &out.repair {
            parameters = repair.parameters;
            covariance
                .view_mut((0, 0), repair.covariance.shape())
                .copy_from(&repair.covariance);
        }
        temperature::validity(stage, &parameters, field.noise.white_mm, &covariance)
    });
    out
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

fn is_refused(findings: &[Finding]) -> bool {
    findings.iter().any(|f| f.severity == Severity::Refuse)
}

fn are_notes(findings: &[Finding]) -> bool {
    findings.iter().all(|f| f.severity == Severity::Note)
}

impl Diagnosis {
    /// What signals, channels and structure show, and what that predicts. `has_channels` where the log is
    /// described by the parameters.
    fn shown(
        &mut self,
        dataset: &Dataset,
        sound: &Dataset,
        stage: &Stage,
        by: Fitted,
        lag_s: f64,
        has_channels: bool,
    ) {
        let (findings, bad) = signals::signal_findings(dataset, stage, (by.parameters, lag_s));
        self.findings = findings;
        // Rows that jump are for the loss of the fit.
        let stands = |found: &&Finding| matches!(found.code, Code::Stuck | Code::Saturated);
        let stand = self.findings.iter().any(|found| stands(&found));
        let has_channels = has_channels && dataset.logs.iter().all(|log| log.has_reference);
        let of_rows =
            has_channels.then(|| bank::diagnose(&dataset.without(&bad), stage, by, stand));
        let of_rows = of_rows.flatten();
        // A fault that leaves nothing of the residuals when it is taken off explains what a mistake would.
        let explains = |of: &bank::Diagnosis| of.repair.is_some() && of.rest < LIMITED_MAX;
        if is_refused(&self.findings) || !of_rows.as_ref().is_some_and(explains) {
            let parts = |found: &Finding| found.code == Code::LogsDisagree;
            let disagree = of_rows
                .as_ref()
                .is_some_and(|of| of.findings.iter().any(parts));
            self.findings
                .extend(structure::structure(sound, stage, disagree));
        }
        let Some(mut of) = of_rows else { return };
        self.predicted = of.predicted;
        if is_refused(&self.findings) {
            return;
        }
        if of.rest > LIMITED_MAX && are_notes(&self.findings) && are_notes(&of.findings) {
            let message = format!(
                "the log does not fit to itself: {:.1} times the noise are left of the Hall signals, and no single fault explains them. Fit parts of it",
                of.rest
            );
            // Of other models it is what they lack.
            let cost = of
                .predicted
                .map_or(1.0, |predicted| predicted.worst_ratio());
            let severity = match by.model {
                ModelKind::Field => bank::severity(cost).max(Severity::Warn),
                _ => Severity::Refuse,
            };
            let lacks = Finding::new(Code::ModelLacks, message).severe(severity);
            of.findings.push(lacks.of(of.rest, "times").costing(cost));
        }
        if let Some((repair, expected)) = of.repair {
            for found in &mut of.findings {
                found.message += ". The calibration has this taken off, and is that of the stage at the end of the log: zero the stage before it is used";
                found.severity = found.severity.min(Severity::Warn);
            }
            let of_both = of
                .findings
                .iter()
                .chain(self.findings.iter().filter(stands));
            let faults = of_both.map(|found| found.message.clone()).collect();
            (self.predicted, self.repair) = (Some(expected), Some(Repair { faults, ..repair }));
        }
        self.findings.extend(of.findings);
    }

    /// What a fit says of itself, where no fault says it already.
    fn add_of_fit(&mut self, fit: &Fit, dataset: &Dataset, stage: &Stage) {
        let findings = &mut self.findings;
        // Rows that a fault explains are no riddle.
        if self.repair.is_none() {
            findings.extend(of_fit::left_out(fit, dataset));
        }
        // One beam that is late is a lag of all of them to a fit.
        let is_late = findings
            .iter()
            .any(|found| found.code == Code::ReferenceLag);
        let of_fit = fit.warnings.iter();
        let of_fit = of_fit.filter(|found| !is_late || found.code != Code::ReferenceLag);
        findings.extend(of_fit.cloned());
        findings.extend(temperature::findings(fit, dataset, stage));
        findings.extend(range::undeclared(fit, stage));
        if !is_explained(findings) {
            findings.extend(of_fit::undescribed(fit, dataset));
            let unexplained = are_notes(findings).then(|| of_fit::over_noise(fit, dataset));
            findings.extend(of_fit::not_field(fit, self.predicted.as_ref(), unexplained));
        }
    }
}

/// Everything that is wrong with a log that a blob is judged on. Of a blob that was `fitted` to it with what was
/// known before, this is what service has to expect.
pub fn of_judged(
    dataset: &Dataset,
    stage: &Stage,
    set: &ParameterSet,
    fitted: Option<Predicted>,
) -> Diagnosis {
    let dataset = &*dataset.compensated(set.constants.temperature.rounded());
    let of_field = FieldParameters::of_set(set, stage);
    let of_31 = || FieldParameters::of_model_31(&Parameters::of_set(set), stage);
    let for_service = of_field.is_some();
    let by = Fitted {
        parameters: &of_field.unwrap_or_else(of_31),
        model: if for_service {
            ModelKind::Field
        } else {
            set.model
        },
        for_service,
        is_to_rows: false,
    };
    let mut out = Diagnosis::default();
    out.shown(dataset, dataset, stage, by, 0.0, true);
    out.predicted = fitted.or(out.predicted);
    let findings = &mut out.findings;
    if fitted.is_none() {
        // A fault bends only what is fitted.
        for found in findings.iter_mut().filter(|found| found.cost.is_some()) {
            found.severity = found.severity.min(Severity::Warn);
        }
    }
    findings.extend(range::out_of_range(set, dataset));
    findings.extend(temperature::missing(&set.constants.temperature, dataset));
    *findings = in_order(std::mem::take(findings));
    let is_bent = fitted.is_some() && findings.iter().any(|f| f.cost > Some(GOOD_MAX));
    out.verdict = (out.predicted).map(|predicted| {
        match Verdict::new(for_service, Some(&predicted), findings) {
            Verdict::Good if is_bent => Verdict::Limited,
            verdict => verdict,
        }
    });
    out
}
