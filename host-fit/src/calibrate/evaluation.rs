//! A blob judged on logs with reference.

use crate::report::decision::Decision;
use crate::report::errors::{RowErrors, errors};
use crate::report::result::{Judged, Report};
use crate::report::verdict::{End, Subject};
use hallstage_calibration::diagnose::range::faster;
use hallstage_calibration::diagnose::refusal::{Beyond, Refusal, are_elsewhere};
use hallstage_calibration::diagnose::{BlobUse, Diagnosis, diagnose_blob, diagnose_log};
use hallstage_calibration::fit::{FitSettings, ModelChoice, counted, fit};
use hallstage_calibration::judge::predicted::Validity;
use hallstage_calibration::judge::statistics::PoseError;
use hallstage_calibration::judge::verdict::Verdict;
use hallstage_calibration::judge::{Decoded, Judge, Judgement, Zeros, error};
use hallstage_calibration::recalibrate::{Certificates, StoredPosterior, own_logs};
use hallstage_calibration::words;
use hallstage_input::axis::{Axis, PLANAR};
use hallstage_input::finding::{Finding, Severity};
use hallstage_input::log::{LogError, LogReading, LogRow, ReadOptions, ReferenceUse};
use hallstage_input::stage::Stage;
use hallstage_solver::estimator::model::Model;
use hallstage_solver::estimator::paper::Parameters;
use hallstage_solver::estimator::parameters::FieldParameters;
use runtime::{ModelKind, ParameterSet};
use serde_json::json;

/// The most rows that the diagnosis looks at: three minutes, in less than 64 MB with all else.
const ROWS_MAX: usize = 100_000;

/// What an evaluation is asked for.
#[derive(Clone, Copy, Debug, Default)]
pub struct EvalOrder {
    /// Which zero deviations are taken off; as the blob's model has them if `None`.
    pub zeros: Option<Zeros<'static>>,
    /// Largest rms error over the rms error of the logs that the blob was fitted to. If `None` it is 3, and 10 for
    /// models (12) to (31): their own logs may not show the terms that they lack.
    pub limit: Option<f64>,
}

/// How a blob does on logs.
#[derive(Debug)]
pub struct Evaluation {
    set: ParameterSet,
    stage: Stage,
    /// Rows of the logs: all, or a sample.
    pub log: LogReading,
    /// Over all rows.
    pub judgement: Judgement,
    /// What is wrong with the logs.
    pub diagnosis: Diagnosis,
    /// Errors of the rows, zero deviations taken off.
    pub by_row: RowErrors,
    /// Over these.
    sampled: Judgement,
    /// Over these, with poses corrected by speed and acceleration; `None` for a blob without a correction.
    corrected: Option<PoseError>,
    zeros: Zeros<'static>,
    decision: Decision,
    /// Why the blob does not do for these logs; `None` if it does.
    pub refusal: Option<Refusal>,
    /// The logs that the blob was fitted to: they verify nothing.
    pub own_logs: Vec<String>,
    /// The certificates of the blob, and of those before it.
    pub certificates: Certificates,
}

impl Evaluation {
    /// How logs are read: the reference is needed, and the decoder marks saturated codes.
    pub const OPTIONS: ReadOptions = ReadOptions {
        reference: ReferenceUse::Required,
        rows_max: ROWS_MAX,
        ..ReadOptions::DECODE
    };

    /// Decodes the rows of `logs` logs, counts the errors and diagnoses the logs. `read` reads them and calls its
    /// argument with each row. `known` is the posterior beside the blob: from it follows how far from its temperature
    /// the blob is good.
    ///
    /// # Errors
    /// The errors of `read`.
    pub fn new(
        (set, known): (&ParameterSet, Option<&StoredPosterior>),
        stage: &Stage,
        order: EvalOrder,
        logs: usize,
        read: impl FnOnce(&mut dyn FnMut(usize, &LogRow)) -> Result<LogReading, LogError>,
    ) -> Result<Self, LogError> {
        let mut judge = Judge::new(&Parameters::from_set(set), stage, logs);
        let decoder = set.decoder();
        let log = read(&mut |log, row| {
            let error = error(&decoder, &row.row);
            judge.take((log, row.movement, row.begins), &row.row, error);
        })?;
        let own_zeros = Zeros::for_model(Model::from_kind(set.model));
        let zeros = order.zeros.unwrap_or(own_zeros);
        let judgement = judge.clone().judgement(zeros);
        let decoded = Decoded::new(set, &log.dataset);
        let sampled = decoded.judge(&log.dataset, stage, zeros);
        let corrected = set.motion_correction.as_ref().map(|correction| {
            let corrected = decoded.corrected(correction, &log.dataset);
            corrected.judge(&log.dataset, stage, zeros).errors
        });
        let by_row = decoded.errors_less(&sampled.zeros, &log.dataset);
        // As the blob's own errors were counted, whatever zeros are asked for.
        let comparable = judge.judgement(own_zeros).errors;
        let rms = |errors: &PoseError| errors.axes.map(|axis| axis.rms);
        let blob_use = BlobUse::Evaluated {
            is_refitted: zeros == Zeros::Refit,
            errors: rms(&comparable),
            corrected: corrected.as_ref().map(rms),
            trusted: decoded.trusted(&log.dataset),
        };
        let usual = if is_field(set) { 3.0 } else { 10.0 };
        let limit = order.limit.unwrap_or(usual);
        let mut other = other_log(set, &comparable, limit);
        let mut diagnosis = match &mut other {
            Some(Refusal::OtherLog { apart, .. }) => {
                let own = fit(&log.dataset, stage, &FitSettings::new(ModelChoice::Auto));
                *apart = own.as_ref().ok().map(|own| apart_from(set, &own.set));
                let of_fit = diagnose_log(&log.dataset, stage, own.as_ref());
                // A blob that describes the log without some rows: these rows have the faults, also small ones.
                let describes_rest = own.as_ref().is_ok_and(|own| {
                    let outliers: Vec<usize> = own.fitted.outliers().collect();
                    let rest = own.rows(&log.dataset).without(&outliers);
                    let errors = Decoded::new(set, &rest).judge(&rest, stage, own_zeros);
                    other_log(set, &errors.errors, limit).is_none()
                });
                let least = match describes_rest {
                    true => Severity::Warn,
                    false => Severity::Refuse,
                };
                let mut faults = faults_of(of_fit, least);
                // It is about the fit to the log.
                let predicted = faults.predicted.take();
                if !apart.is_some_and(are_elsewhere) {
                    let errors = (rms(&comparable), corrected.as_ref().map(rms));
                    let trusted = decoded.trusted(&log.dataset);
                    let fast = predicted
                        .and_then(|of| faster((&log.dataset, &trusted), stage, errors, &of));
                    faults.findings.extend(fast);
                }
                faults
            }
            _ => diagnose_blob(&log.dataset, stage, set, blob_use),
        };
        diagnosis.validity = known.and_then(|known| {
            let parameters = FieldParameters::from_set(set, stage)?;
            let (white_m, covariance) = (known.noise.white_m, &known.covariance);
            Validity::new(stage, &parameters, white_m, covariance)
        });
        let predicted = diagnosis.predicted.as_ref().filter(|_| is_field(set));
        diagnosis.up_to = known.and_then(|known| known.up_to);
        // The reference of the fit decides.
        let of_fit = known.and_then(|known| known.budget.clone());
        diagnosis.budget = of_fit.zip(predicted).map(|(of, by)| of.with_service(by));
        let on_log = set.fit.rms.map(f64::from);
        let on_log = on_log.map(|rms| (rms > 0.0).then_some(limit * rms));
        let limits = [stage.certificate.limits, on_log];
        let decision = Decision::new(limits, stage, &diagnosis, is_field(set));
        let refusal = other
            .or_else(|| Refusal::from_findings(&diagnosis.findings))
            .or_else(|| decision.refusal(predicted?.rms));
        if refusal.is_some() {
            diagnosis.verdict = Some(Verdict::Refused);
        }
        Ok(Self {
            refusal,
            certificates: known
                .map_or_else(Certificates::default, |known| known.certificates.clone()),
            own_logs: own_logs(set, known, &log.dataset),
            set: set.clone(),
            stage: stage.clone(),
            log,
            judgement,
            diagnosis,
            by_row,
            sampled,
            corrected,
            zeros,
            decision,
        })
    }

    /// The figures.
    pub fn report(&self, elapsed_s: f64) -> Report {
        let mut warnings = words::messages(&self.log.warnings);
        if !self.own_logs.is_empty() {
            warnings.push(words::own_logs(&self.own_logs));
        }
        let zeros = match self.refusal {
            Some(Refusal::OtherLog { .. }) => &[][..],
            _ => &self.judgement.zeros,
        };
        let counts = counted(zeros, self.judgement.undecoded);
        warnings.extend(counts.map(|found| words::message(&found)));
        let mut report = Report::from_judgement(Judged {
            set: &self.set,
            judgement: &self.judgement,
            zeros: self.zeros,
            by_row: self.by_row.clone(),
            over_rows: self.sampled.errors,
            stage: &self.stage,
            dataset: &self.log.dataset,
            skipped_rows: self.log.skipped_rows,
            elapsed_s,
            warnings,
            diagnosis: &self.diagnosis,
            refusal: self.refusal.as_ref(),
        });
        let corrected = self.corrected.as_ref().map(errors);
        report.figures.set("errors_corrected", corrected);
        let decision = json!(self.subject().decision());
        report.figures.set("decision", decision);
        report
    }

    /// The title of its page.
    pub const fn title(&self) -> &'static str {
        match self.own_logs.is_empty() {
            true => "Verification of a calibration",
            false => "Errors on the log of a calibration",
        }
    }

    /// How it ended, for reports.
    pub fn subject(&self) -> Subject<'_> {
        let end = match &self.refusal {
            None | Some(Refusal::BeyondLimit { .. }) => End::Judged,
            Some(refusal) => End::Failed(refusal),
        };
        Subject {
            end,
            diagnosis: &self.diagnosis,
            is_field: is_field(&self.set),
            errors: Some(&self.judgement.errors),
            corrected: self.corrected.as_ref(),
            decision: self.decision,
        }
    }

    /// Why the blob does not do for these logs, and what to do; `None` if it does.
    pub fn refusal_message(&self) -> Option<String> {
        let refusal = self.refusal.as_ref()?;
        Some(words::refusal(refusal, &self.diagnosis.findings))
    }
}

/// The largest difference of lever arms, m, and of angles, rad.
fn apart_from(a: &ParameterSet, b: &ParameterSet) -> [f64; 2] {
    let largest = |a: [f32; 3], b: [f32; 3]| {
        let apart = a.into_iter().zip(b).map(|(a, b)| f64::from(a - b).abs());
        apart.fold(0.0, f64::max)
    };
    let (a, b) = (&a.geometry, &b.geometry);
    [
        largest(a.lever_arm_m, b.lever_arm_m),
        largest(a.misalignment_rad, b.misalignment_rad),
    ]
}

/// What is wrong with a log, of the diagnosis of a fit to the log itself: the residuals of a blob that does not describe it
/// say nothing of its channels. Faults that the fit repairs count, and those from a severity on.
fn faults_of(of_fit: Diagnosis, least: Severity) -> Diagnosis {
    let mut findings = of_fit.findings;
    let is_fault = |found: &Finding| found.severity >= least || found.is_repaired;
    findings.retain(|found| is_fault(found) && found.code().entry().explains_from.is_some());
    findings
        .iter_mut()
        .for_each(|found| found.is_repaired = false);
    Diagnosis {
        findings,
        columns: of_fit.columns,
        predicted: of_fit.predicted,
        ..Diagnosis::default()
    }
}

fn is_field(set: &ParameterSet) -> bool {
    set.model == ModelKind::Field
}

/// The refusal by the largest ratio of an error to the blob's own error, if that is beyond the limit. The blob of an
/// exact fit has no errors to compare with.
fn other_log(set: &ParameterSet, errors: &PoseError, factor: f64) -> Option<Refusal> {
    let beyond = |(k, axis): (usize, &'static Axis)| Beyond {
        axis,
        rms: errors.axes[k].rms,
        limit: f64::from(set.fit.rms[k]),
    };
    let errors = PLANAR.iter().enumerate().map(beyond);
    let ratio = |error: &Beyond| error.rms / error.limit;
    let errors = errors.filter(|error| error.limit > 0.0);
    let worst = errors.max_by(|a, b| ratio(a).total_cmp(&ratio(b)))?;
    let is_field = is_field(set);
    (ratio(&worst) > factor).then_some(Refusal::OtherLog {
        worst,
        factor,
        is_field,
        apart: None,
    })
}
