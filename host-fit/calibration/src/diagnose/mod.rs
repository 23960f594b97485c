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
//! let diagnosis = hallstage_calibration::diagnose::diagnose_log(&dataset, &stage, Ok(&fit));
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

use crate::fit::{Fit, FitError, FitSettings, ModelChoice, Repair, fit};
use crate::judge::identify::FitFailure;
use crate::judge::predicted::{Predicted, Validity};
use crate::judge::verdict::{Basis, LIMITED_MAX, Verdict, conclude, is_refused, severity};
use bank::Fitted;
use hallstage_input::dataset::Dataset;
use hallstage_input::finding::{Code, Finding, Kind, Severity};
use hallstage_input::stage::Stage;
use hallstage_solver::estimator::paper::Parameters;
use hallstage_solver::estimator::parameters::FieldParameters;
use runtime::{ModelKind, ParameterSet};
use std::borrow::Cow;

/// What is wrong with a log, and what a calibration is good for.
#[derive(Clone, Debug, Default)]
pub struct Diagnosis {
    /// What is wrong, the most severe first.
    pub findings: Vec<Finding>,
    /// Whether the calibration can be used; `None` for a blob where the log cannot predict its errors.
    pub verdict: Option<Verdict>,
    /// The errors to expect in service; `None` where the log is too short or too still to predict them.
    pub predicted: Option<Predicted>,
    /// The parameters without the faults of the log, for which the verdict is: see [`Fit::repaired`].
    pub repair: Option<Repair>,
    /// How far from the temperature of the log a calibration by the field model is good.
    pub validity: Option<Validity>,
}

/// The diagnosis of a log and of the fit to it.
///
/// Only the tests of the signals and the channels use rows that the fit rejected.
pub fn diagnose_log(
    dataset: &Dataset,
    stage: &Stage,
    fitted: Result<&Fit, &FitError>,
) -> Diagnosis {
    let dataset = fitted.map_or(dataset, |fit| fit.rows(dataset));
    let compensated = fitted.map(|fit| dataset.compensated(fit.calibration.temperature));
    let dataset = compensated.as_deref().unwrap_or(dataset);
    let outliers = fitted.map_or_else(|_| Vec::new(), |fit| fit.fitted.outliers().collect());
    let without_outliers = match outliers.as_slice() {
        [] => Cow::Borrowed(dataset),
        outliers => Cow::Owned(dataset.without(outliers)),
    };
    let own = Described::by_fit(fitted, stage);
    let best = fitted
        .ok()
        .and_then(|fit| Described::better(fit, dataset, stage));
    let best = best.unwrap_or(own);
    let field = fitted.ok().and_then(|fit| fit.field.as_ref());
    let by = Fitted {
        parameters: &own.parameters,
        start: &best.parameters,
        model: fitted.map_or(ModelKind::M31, |fit| fit.model.kind),
        for_service: field.is_some_and(|field| !field.comparison.by_resets),
        is_to_rows: fitted.is_ok(),
    };
    let mut out = Diagnosis::default();
    // A log that determines no parameters shows nothing of its channels.
    let is_described = match fitted {
        Ok(_) => true,
        Err(error) => matches!(error, FitError::Failed(FitFailure::NotDescribed { .. })),
    };
    out.add_faults(
        dataset,
        &without_outliers,
        stage,
        (by, best.lag_s),
        is_described,
    );
    match fitted {
        Ok(fit) => out.add_fit(fit, dataset, stage),
        Err(_) => out.predicted = None,
    }
    let short = of_fit::short_movements(fitted.ok(), dataset);
    out.findings.extend(short);
    let is_for_service = by.for_service;
    let basis = match fitted {
        Ok(_) => Basis::Fit { is_for_service },
        Err(_) => Basis::NoFit,
    };
    out.conclude(basis);
    out.validity = field.and_then(|field| {
        let estimate = fitted.ok().map(|fit| &fit.estimate)?;
        let (mut parameters, mut covariance) =
            (estimate.parameters, estimate.posterior.covariance.clone());
        if let Some(repair) = &out.repair {
            parameters = repair.parameters;
            covariance
                .view_mut((0, 0), repair.covariance.shape())
                .copy_from(&repair.covariance);
        }
        Validity::new(stage, &parameters, field.noise.white_mm, &covariance)
    });
    out
}

/// What predicts the signals of a log.
#[derive(Clone, Copy, Debug)]
struct Described {
    parameters: FieldParameters,
    /// The lag of the reference, s.
    lag_s: f64,
}

impl Described {
    /// The parameters of a fit, or of the drawing where there is no fit.
    fn by_fit(fitted: Result<&Fit, &FitError>, stage: &Stage) -> Self {
        let of_31 = |parameters| FieldParameters::from_model_31(parameters, stage);
        match fitted {
            Ok(fit) => Self {
                parameters: fit.estimate.parameters,
                lag_s: match (&fit.later, fit.estimate.lag) {
                    (None, Some(lag)) => lag.value_s,
                    // It is taken off the rows.
                    _ => 0.0,
                },
            },
            Err(_) => Self {
                parameters: of_31(&Parameters::designed(stage)),
                lag_s: 0.0,
            },
        }
    }

    /// The best description of the log where this fit is a poor one, as of a search that has not converged: the
    /// signals show no fault of their own there.
    fn better(poor: &Fit, dataset: &Dataset, stage: &Stage) -> Option<Self> {
        let over_noise = of_fit::over_noise(poor, dataset);
        if poor.field.is_some() || over_noise <= of_fit::ERROR_TO_NOISE_MAX {
            return None;
        }
        let best = fit(dataset, stage, &FitSettings::new(ModelChoice::Auto)).ok()?;
        let is_better = of_fit::over_noise(&best, best.rows(dataset)) < over_noise;
        is_better.then(|| Self::by_fit(Ok(&best), stage))
    }
}

fn are_notes(findings: &[Finding]) -> bool {
    findings.iter().all(|f| f.severity == Severity::Note)
}

/// Whether the rows of a finding are left out, so that the calibration can be free of it.
const fn stands(found: &Finding) -> bool {
    matches!(found.code(), Code::Stuck | Code::Saturated)
}

impl Diagnosis {
    /// Adds the faults of signals, channels and structure, and what they predict. `is_described` where the
    /// parameters describe the log.
    fn add_faults(
        &mut self,
        dataset: &Dataset,
        without_outliers: &Dataset,
        stage: &Stage,
        (by, lag_s): (Fitted, f64),
        is_described: bool,
    ) {
        let (findings, bad) = signals::signal_findings(dataset, stage, (by.start, lag_s));
        self.findings = findings;
        // Rows that jump are for the loss of the fit.
        let is_bent = self.findings.iter().any(stands);
        let has_channels = is_described && dataset.logs.iter().all(|log| log.has_reference);
        let rows = has_channels.then(|| bank::diagnose(&dataset.without(&bad), stage, by, is_bent));
        let of_rows = rows.flatten();
        // A fault whose repair leaves no more than noise explains what a mistake would.
        let explains = |of: &bank::Diagnosis| of.repair.is_some() && of.rest < LIMITED_MAX;
        if is_refused(&self.findings) || !of_rows.as_ref().is_some_and(explains) {
            let parts = |found: &Finding| found.code() == Code::LogsDisagree;
            let disagree = of_rows
                .as_ref()
                .is_some_and(|of| of.findings.iter().any(parts));
            let mistake = structure::structure(without_outliers, stage, disagree);
            self.findings.extend(mistake);
        }
        let Some(mut of) = of_rows else { return };
        self.predicted = of.predicted;
        if is_refused(&self.findings) {
            return;
        }
        if of.rest > LIMITED_MAX && are_notes(&self.findings) && are_notes(&of.findings) {
            // Of other models it is what they lack.
            let cost = of.predicted.map_or(1.0, |of| of.worst_ratio());
            let severity = match by.model {
                ModelKind::Field => severity(cost).max(Severity::Warn),
                _ => Severity::Refuse,
            };
            let found = Finding::new(Kind::Inconsistent { ratio: of.rest });
            of.findings
                .push(found.with_severity(severity).with_cost(cost));
        }
        if let Some((repair, expected)) = of.repair {
            let stand = self.findings.iter_mut().filter(|found| stands(found));
            for found in stand.chain(&mut of.findings) {
                found.is_repaired = true;
                found.severity = found.severity.min(Severity::Warn);
            }
            (self.predicted, self.repair) = (Some(expected), Some(repair));
        }
        self.findings.extend(of.findings);
    }

    /// Adds what only the fit shows, where no fault explains it.
    fn add_fit(&mut self, fit: &Fit, dataset: &Dataset, stage: &Stage) {
        let findings = &mut self.findings;
        // A fault explains the rows that are left out.
        if self.repair.is_none() {
            findings.extend(of_fit::left_out(fit, dataset));
        }
        // One beam that is late is a lag of all of them to a fit.
        let is_late = findings
            .iter()
            .any(|found| found.code() == Code::ReferenceLag);
        let warnings = fit.warnings(dataset, stage).into_iter();
        let warnings = warnings.filter(|found| !is_late || found.code() != Code::ReferenceLag);
        findings.extend(warnings);
        findings.extend(temperature::findings(fit, dataset, stage));
        findings.extend(range::undeclared(fit, stage));
        let explains = |found: &Finding| {
            found.severity >= Severity::Refuse
                || found.code().entry().explains_from == Some(Severity::Note)
        };
        if !findings.iter().any(explains) {
            findings.extend(of_fit::undescribed(fit, dataset, stage));
            let unexplained = are_notes(findings).then(|| of_fit::over_noise(fit, dataset));
            findings.extend(of_fit::not_field(fit, self.predicted.as_ref(), unexplained));
        }
    }

    fn conclude(&mut self, basis: Basis) {
        let findings = std::mem::take(&mut self.findings);
        (self.findings, self.verdict) = conclude(findings, self.predicted.as_ref(), basis);
    }

    /// The faults of the log that the calibration is free of.
    pub fn repaired(&self) -> impl Iterator<Item = &Finding> {
        self.findings.iter().filter(|found| found.is_repaired)
    }
}

/// How a blob came to the log on which it is diagnosed.
#[derive(Clone, Copy, Debug)]
pub enum BlobUse {
    /// It was recalibrated by the log, with these errors to expect in service.
    Recalibrated(Option<Predicted>),
    /// It is from another log; zero deviations are refitted or not.
    Evaluated {
        /// Whether they are.
        is_refitted: bool,
    },
}

/// The diagnosis of a log on which a blob is judged.
pub fn diagnose_blob(
    dataset: &Dataset,
    stage: &Stage,
    set: &ParameterSet,
    blob_use: BlobUse,
) -> Diagnosis {
    let dataset = &*dataset.compensated(set.constants.temperature.rounded());
    let of_field = FieldParameters::from_set(set, stage);
    let of_31 = || FieldParameters::from_model_31(&Parameters::from_set(set), stage);
    let is_for_service = of_field.is_some();
    let parameters = &of_field.unwrap_or_else(of_31);
    let by = Fitted {
        parameters,
        start: parameters,
        model: if is_for_service {
            ModelKind::Field
        } else {
            set.model
        },
        for_service: is_for_service,
        is_to_rows: false,
    };
    let mut out = Diagnosis::default();
    out.add_faults(dataset, dataset, stage, (by, 0.0), true);
    out.findings.extend(range::out_of_range(set, dataset));
    let temperature = &set.constants.temperature;
    out.findings
        .extend(temperature::missing(temperature, dataset));
    let basis = match blob_use {
        BlobUse::Recalibrated(Some(predicted)) => {
            out.predicted = Some(predicted);
            Basis::Recalibrated
        }
        BlobUse::Recalibrated(None) => Basis::Blob { is_for_service },
        BlobUse::Evaluated { is_refitted } => {
            let rezero = temperature::rezero(temperature, dataset, is_refitted);
            out.findings.extend(rezero);
            Basis::Blob { is_for_service }
        }
    };
    out.conclude(basis);
    out
}
