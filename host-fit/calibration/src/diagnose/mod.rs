//! The faults of a log, their cost in service, and the verdict on the calibration.
//!
//! | module | what it does |
//! |---|---|
//! | [`signals`] | faults in the signals: missing rows, channels that stand still |
//! | `columns` | faults of single channels, found without a fit, with their cost in service |
//! | [`faults`] | faults of channels by score tests, with their cost and their repair |
//! | `mistakes` | mistakes with order, signs, scales and places |
//! | [`structure`] | the mistake that explains a log |
//! | [`fit_checks`] | findings about the fit itself |
//! | `late` | a lag between the reference and all probes |
//! | [`range`] | poses beyond the range of a calibration |
//! | [`temperature`] | findings about temperature |
//! | [`refusal`] | why a calibration is not to be used |
//! | `units` | units that are read as others |
//! | `slopes` | the effect of an error of each channel on the Hall signals |
//! | `limits` | the limits that these tests share |
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

mod columns;
pub mod faults;
pub mod fit_checks;
mod late;
mod limits;
mod mistakes;
pub mod range;
pub mod refusal;
#[cfg(test)]
mod search_tests;
pub mod signals;
mod slopes;
pub mod structure;
#[cfg(test)]
mod structure_tests;
pub mod temperature;
mod units;

use crate::budget::Budget;
use crate::fit::{Estimate, Fit, FitError, Repair};
use crate::judge::identify::FitFailure;
use crate::judge::in_motion::{InMotion, UpTo, by_lags};
use crate::judge::predicted::{Predicted, Validity};
use crate::judge::verdict::{Basis, LIMITED_MAX, Verdict, conclude, is_refused};
use columns::ColumnFaults;
use faults::{Added, Calibrated, Faults, find_faults};
use hallstage_input::channels::{Column, columns, probe_noise_m};
use hallstage_input::dataset::Dataset;
use hallstage_input::finding::{Code, Finding, Kind, Severity};
use hallstage_input::stage::Stage;
use hallstage_solver::estimator::dynamics::MotionFit;
use hallstage_solver::estimator::paper::Parameters;
use hallstage_solver::estimator::parameters::FieldParameters;
use hallstage_solver::estimator::terms::COUNT;
pub use limits::ERROR_TO_NOISE_MAX;
use runtime::{ModelKind, ParameterSet};
use std::borrow::Cow;

/// The faults of a log, and the verdict on its calibration.
#[derive(Clone, Debug, Default)]
pub struct Diagnosis {
    /// The findings, the most severe first.
    pub findings: Vec<Finding>,
    /// Whether the calibration can be used; `None` for a blob where the log cannot predict its errors.
    pub verdict: Option<Verdict>,
    /// The properties of each channel of the log.
    pub columns: Vec<Column>,
    /// The errors to expect in service; `None` where the log is too short or too still to predict them.
    pub predicted: Option<Predicted>,
    /// The parameters without the faults of the log: see [`Fit::repaired`]. The verdict is about them.
    pub repair: Option<Repair>,
    /// The uncertainty in service, source by source, of a calibration by the field model.
    pub budget: Option<Budget>,
    /// How far from the temperature of the log a calibration by the field model is good.
    pub validity: Option<Validity>,
    /// What speed and acceleration add in service; [`Self::predicted`] includes it.
    pub motion: Option<InMotion>,
    /// The largest motion with good errors, by the fit of the calibration.
    pub up_to: Option<UpTo>,
}

/// The diagnosis of a log and of the fit to it.
///
/// Only the tests of the signals and the channels use rows that the fit rejected.
pub fn diagnose_log(
    dataset: &Dataset,
    stage: &Stage,
    fitted: Result<&Fit, &FitError>,
) -> Diagnosis {
    let logged = dataset;
    let dataset = fitted.map_or(dataset, |fit| fit.rows(dataset));
    let compensated = fitted.map(|fit| dataset.compensated(fit.calibration.temperature));
    let dataset = compensated.as_deref().unwrap_or(dataset);
    let outliers = fitted.map_or_else(|_| Vec::new(), |fit| fit.fitted.outliers().collect());
    let without_outliers = match outliers.as_slice() {
        [] => Cow::Borrowed(dataset),
        outliers => Cow::Owned(dataset.without(outliers)),
    };
    let designed = || FieldParameters::from_model_31(&Parameters::designed(stage), stage);
    let own = fitted.map_or_else(|_| designed(), |fit| fit.estimate.parameters);
    let mut out = Diagnosis {
        columns: columns(logged, stage),
        ..Diagnosis::default()
    };
    let field = fitted.ok().and_then(|fit| fit.field.as_ref());
    // A search may end far from the best parameters.
    let is_near = |fit: &&Fit| {
        fit.field.is_some() || fit_checks::over_noise(fit, dataset) <= ERROR_TO_NOISE_MAX
    };
    let start = fitted.ok().filter(is_near).map_or_else(designed, |_| own);
    let by = Calibrated {
        parameters: &own,
        start: &start,
        model: fitted.map_or(ModelKind::M31, |fit| fit.model.kind),
        floor_m: probe_noise_m(&out.columns),
        is_for_service: field.is_some_and(|field| !field.comparison.by_resets),
        is_fitted: fitted.is_ok(),
        shows_acceleration: fitted.is_ok_and(|fit| fit.estimate.motion.shows_acceleration),
        slow_beams_s2: columns::slow_beams_s2(&out.columns, logged, stage),
    };
    // A log that determines no parameters shows nothing of its channels.
    let is_described = match fitted {
        Ok(_) => true,
        Err(error) => matches!(error, FitError::Failed(FitFailure::NotDescribed { .. })),
    };
    let estimate = field.and(fitted.ok()).map(|fit| &fit.estimate);
    let described = (is_described, estimate);
    let added = out.add_faults(dataset, &without_outliers, stage, by, described);
    match fitted {
        Ok(fit) => out.add_fit(fit, dataset, stage),
        Err(_) => out.predicted = None,
    }
    (out.findings).extend(fit_checks::short_movements(fitted.ok(), dataset));
    let columns = ColumnFaults::new(&out.columns, logged, stage, &start, added.bent);
    out.predicted = (out.predicted).map(|predicted| predicted.with_added(added.bent));
    out.findings.extend(columns.findings);
    let is_for_service = by.is_for_service;
    let basis = match fitted {
        Ok(_) => Basis::Fit { is_for_service },
        Err(_) => Basis::NoFit,
    };
    let at_rest = out
        .predicted
        .map(|predicted| predicted.with_added(columns.stays));
    out.motion = fitted.ok().and_then(|fit| {
        let (mut motion, parameters) = (fit.estimate.motion, &fit.estimate.parameters);
        if let Some(repair) = &out.repair {
            motion = MotionFit {
                probe_lag_covariance: motion.probe_lag_covariance,
                ..repair.motion
            };
        }
        if let Some(lags_s) = added.probe_lags_s {
            motion = motion.with_other_lags(lags_s);
        }
        InMotion::new(&motion, parameters, stage, &at_rest?)
    });
    out.up_to = out.motion.map(|motion| motion.up_to);
    let late = out
        .findings
        .iter()
        .filter_map(|found| late::in_service(found, stage));
    let motion = out.motion.iter().map(|motion| motion.added);
    let stays = late.chain(motion).chain([columns.stays, added.drifts]);
    let stays = stays.fold([0.0; 3], |sum, of| {
        [0, 1, 2].map(|axis| sum[axis] + of[axis])
    });
    if let (Some(motion), Some(at_rest)) = (out.motion, at_rest) {
        out.findings.extend(motion.finding(&at_rest));
    }
    out.conclude(stays, basis);
    if let (Some(figures), Ok(fit)) = (field, fitted) {
        let estimate = &fit.estimate;
        let (mut parameters, mut posterior) = (estimate.parameters, estimate.posterior.clone());
        if let Some(repair) = &out.repair {
            parameters = repair.parameters;
            posterior = posterior.with_parameters(&parameters, &repair.covariance);
        }
        let (white_m, covariance) = (posterior.white_m, &posterior.covariance);
        out.validity = Validity::new(stage, &parameters, white_m, covariance);
        let known = (&parameters, &posterior);
        let freedom = figures.score.residuals.saturating_sub(COUNT);
        out.budget = (out.predicted.as_ref())
            .and_then(|of| Budget::new(stage, known, &estimate.temperature, of, freedom));
    }
    out
}

/// Whether the rows of a finding are left out of a repair.
const fn stands(found: &Finding) -> bool {
    matches!(found.code(), Code::Stuck | Code::Saturated)
}

impl Diagnosis {
    /// Adds the faults of signals, channels and structure, and what they predict. `is_described` where the parameters
    /// describe the log, `estimate` of a fit of the field model.
    fn add_faults(
        &mut self,
        dataset: &Dataset,
        without_outliers: &Dataset,
        stage: &Stage,
        by: Calibrated,
        (is_described, estimate): (bool, Option<&Estimate>),
    ) -> Added {
        let (findings, bad) = signals::signal_findings(dataset, stage, &self.columns);
        self.findings = findings;
        let is_bent = self.findings.iter().any(stands);
        let has_channels = is_described && dataset.logs.iter().all(|log| log.has_reference);
        let rows = has_channels.then(|| find_faults(&dataset.without(&bad), stage, by, is_bent));
        let of_rows = rows.flatten();
        // A repair that leads to residuals of noise explains the log, but not a drawing that it contradicts.
        let explains = |of: &&Faults| of.repair.is_some() && of.residual < LIMITED_MAX;
        let repaired = of_rows
            .as_ref()
            .filter(explains)
            .filter(|_| !is_refused(&self.findings));
        let repaired = repaired.and_then(|of| of.repair.as_ref());
        let parts = |found: &Finding| found.code() == Code::LogsDisagree;
        let disagree = (of_rows.as_ref()).is_some_and(|of| of.findings.iter().any(parts));
        // Faults that cost so much bend the fit.
        let bends = |of: &Faults| is_refused(&of.findings);
        let is_bent = is_refused(&self.findings) || of_rows.as_ref().is_some_and(bends);
        let known = match (repaired, estimate) {
            (Some((repair, _)), _) => Some((&repair.parameters, &repair.covariance)),
            (None, Some(own)) if !is_bent => Some((&own.parameters, &own.posterior.covariance)),
            _ => None,
        };
        let mistake = structure::structure(without_outliers, stage, disagree, known);
        let stands_alone = |found: &Finding| {
            repaired.is_none() || matches!(found.kind, Kind::Mistake { is_sure: true, .. })
        };
        self.findings.extend(mistake.filter(stands_alone));
        // Channels in another order, or rows without a channel, show nothing of service.
        let shown = of_rows.filter(|_| !is_refused(&self.findings));
        let Some(mut of) = shown else {
            return Added::default();
        };
        self.predicted = of.predicted;
        if let Some((repair, expected)) = of.repair {
            let stand = self.findings.iter_mut().filter(|found| stands(found));
            let taken_off = |found: &&mut Finding| found.code() != Code::ModelLacks;
            for found in stand.chain(of.findings.iter_mut().filter(taken_off)) {
                found.is_repaired = true;
                found.severity = found.severity.min(Severity::Warn);
            }
            (self.predicted, self.repair) = (Some(expected), Some(repair));
        }
        self.findings.extend(of.findings);
        of.added
    }

    /// Adds the findings about the fit that no fault explains.
    fn add_fit(&mut self, fit: &Fit, dataset: &Dataset, stage: &Stage) {
        let findings = &mut self.findings;
        findings.extend(fit.warnings(dataset, stage));
        let predicted = self.predicted.as_ref();
        let late = late::late_reference(fit, self.repair.as_ref(), findings, stage, predicted);
        findings.extend(late);
        findings.extend(temperature::findings(fit, dataset, stage, predicted));
        findings.extend(range::undeclared(fit, stage));
        let explains = |found: &Finding| {
            found.severity >= Severity::Refuse
                || found.code().entry().explains_from == Some(Severity::Note)
        };
        if !findings.iter().any(explains) {
            findings.extend(fit_checks::not_field(fit, self.predicted.as_ref()));
        }
    }

    /// Findings and verdict, with variances that sensors add in service because they stay late or disturbed.
    fn conclude(&mut self, stays: [f64; 3], basis: Basis) {
        let findings = std::mem::take(&mut self.findings);
        let predicted = self.predicted.as_ref();
        (self.findings, self.verdict) = conclude(findings, predicted, stays, basis);
        self.predicted = predicted.map(|of| of.with_added(stays));
    }

    /// The faults of the log that the calibration is free of.
    pub fn repaired(&self) -> impl Iterator<Item = &Finding> {
        self.findings.iter().filter(|found| found.is_repaired)
    }
}

/// The relation of a blob to the log of its diagnosis.
#[derive(Clone, Debug)]
pub enum BlobUse {
    /// It was recalibrated by the log, with these errors to expect in service.
    Recalibrated(Option<Predicted>),
    /// It is from another log.
    Evaluated {
        /// Whether zero deviations are refitted.
        is_refitted: bool,
        /// Errors of X, Y, Rz on the log, rms: m, m, rad.
        errors: [f64; 3],
        /// The same with the correction for motion, if the blob has one.
        corrected: Option<[f64; 3]>,
        /// Rows that show motion: see [`Decoded::trusted`](crate::judge::Decoded::trusted).
        trusted: Vec<bool>,
    },
}

/// The diagnosis of a log that a blob is judged by.
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
    let mut out = Diagnosis {
        columns: columns(dataset, stage),
        ..Diagnosis::default()
    };
    let by = Calibrated {
        parameters,
        start: parameters,
        model: if is_for_service {
            ModelKind::Field
        } else {
            set.model
        },
        floor_m: probe_noise_m(&out.columns),
        is_for_service,
        is_fitted: false,
        shows_acceleration: set.motion_correction.is_some(),
        slow_beams_s2: columns::slow_beams_s2(&out.columns, dataset, stage),
    };
    let added = out.add_faults(dataset, dataset, stage, by, (true, None));
    out.findings.extend(range::out_of_range(set, dataset));
    let temperature = &set.constants.temperature;
    (out.findings).extend(temperature::missing(temperature, dataset));
    let basis =
        match blob_use {
            BlobUse::Recalibrated(Some(predicted)) => {
                out.predicted = Some(predicted);
                Basis::Recalibrated
            }
            BlobUse::Recalibrated(None) => Basis::Blob { is_for_service },
            BlobUse::Evaluated {
                is_refitted,
                errors,
                corrected,
                trusted,
            } => {
                let at_work = out.predicted.as_ref().filter(|_| is_for_service);
                out.findings.extend(at_work.and_then(|of| {
                    range::faster((dataset, &trusted), stage, (errors, corrected), of)
                }));
                (out.findings).extend(temperature::rezero(temperature, dataset, is_refitted));
                Basis::Blob { is_for_service }
            }
        };
    let columns = ColumnFaults::new(&out.columns, dataset, stage, parameters, added.bent);
    out.findings.extend(columns.findings);
    let late = match basis {
        Basis::Recalibrated => by_lags(late::probe_lags_s(&out.findings), parameters, stage),
        _ => None,
    };
    let late = late.unwrap_or_default();
    let stays = [0, 1, 2].map(|axis| columns.stays[axis] + late[axis]);
    out.conclude(stays, basis);
    out
}
