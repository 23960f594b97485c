//! A fit with the decisions around it.

use super::{ErrorLimits, name_of};
use crate::report::channels::channels;
use crate::report::decision::Decision;
use crate::report::figure::{Group, group};
use crate::report::result::Report;
use crate::report::verdict::{End, Subject};
use hallstage_calibration::diagnose::fit_checks::over_noise;
use hallstage_calibration::diagnose::refusal::Refusal;
use hallstage_calibration::diagnose::{Diagnosis, ERROR_TO_NOISE_MAX, diagnose_log};
use hallstage_calibration::fit::{self, Fit, FitError, FitSettings};
use hallstage_calibration::judge::verdict::Verdict;
use hallstage_calibration::recalibrate::StoredPosterior;
use hallstage_calibration::words::{self, WordedRefusal};
use hallstage_input::dataset::Dataset;
use hallstage_input::log::LogReading;
use hallstage_input::stage::Stage;
use hallstage_solver::solve::SolveError;
use serde_json::json;

/// What a fit is asked for.
#[derive(Clone, Debug)]
pub struct FitOrder {
    /// How it is made. With `force` the blob of a refused log is written, too.
    pub settings: FitSettings,
    /// Largest rms errors of X, Y, Rz: of the field model in service, of others over all rows.
    pub limits: ErrorLimits,
    /// Whether the calibration is kept. `check` keeps nothing: faults of the log stay in the fit.
    pub is_kept: bool,
}

/// Why nothing is known of a log.
#[derive(Debug, thiserror::Error)]
pub enum CalibrateError {
    /// No fit was tried: the settings do not go together.
    #[error(transparent)]
    Unsupported(FitError),
    /// Ctrl-C, and nothing that is good enough was found before it.
    #[error("{0}")]
    Interrupted(String),
}

/// What a fit made of a log.
#[derive(Clone, Debug)]
pub struct JudgedFit {
    /// The fit, without the faults of the log where these can be taken off.
    pub fitted: Result<Fit, FitError>,
    /// The faults of the log, and the verdict.
    pub diagnosis: Diagnosis,
    /// Why it is not to be used; `None` where it may be.
    pub refusal: Option<Refusal>,
    /// Whether there is a blob to write: of a fit that is not refused, or that is forced.
    pub has_blob: bool,
    /// Whether the search was ended before its time.
    pub is_interrupted: bool,
    is_kept: bool,
    decision: Decision,
}

impl FitOrder {
    fn is_interrupted(&self) -> bool {
        self.settings.options.watch.is_stopped()
    }

    /// Fits a log, diagnoses it with its fit, repairs a calibration that is kept, and says whether it may be used.
    ///
    /// # Errors
    /// See [`CalibrateError`].
    pub fn run(&self, log: &LogReading, stage: &Stage) -> Result<JudgedFit, CalibrateError> {
        self.judge(self.fit(log, stage)?, log, stage)
    }

    fn fit(
        &self,
        log: &LogReading,
        stage: &Stage,
    ) -> Result<Result<Fit, FitError>, CalibrateError> {
        match fit::fit(&log.dataset, stage, &self.settings) {
            Err(error @ FitError::Solver(SolveError::Unsupported { .. })) => {
                Err(CalibrateError::Unsupported(error))
            }
            Err(error) if self.is_interrupted() => Err(CalibrateError::Interrupted(format!(
                "nothing was written: {error}"
            ))),
            Ok(_) if self.is_interrupted() && !self.is_kept => Err(CalibrateError::Interrupted(
                "nothing was written".to_owned(),
            )),
            fitted => Ok(fitted),
        }
    }

    fn judge(
        &self,
        mut fitted: Result<Fit, FitError>,
        log: &LogReading,
        stage: &Stage,
    ) -> Result<JudgedFit, CalibrateError> {
        let is_interrupted = self.is_interrupted();
        let diagnosis = diagnose_log(&log.dataset, stage, fitted.as_ref());
        if let (Some(repair), Some(predicted), true) =
            (&diagnosis.repair, &diagnosis.predicted, self.is_kept)
        {
            fitted = match fitted {
                Ok(fit) => fit.repaired(&log.dataset, stage, repair, predicted),
                failed => failed,
            };
        }
        if let Some(motion) = &diagnosis.motion {
            fitted = fitted.map(|fit| fit.with_motion(&motion.fit));
        }
        let limits = self.limits.or(&stage.certificate);
        let is_field = fitted.as_ref().is_ok_and(|fit| fit.field.is_some());
        let decision = Decision::new([limits; 2], stage, &diagnosis, is_field);
        let mut outcome = JudgedFit {
            fitted,
            diagnosis,
            refusal: None,
            has_blob: false,
            is_interrupted,
            is_kept: self.is_kept,
            decision,
        };
        let refusal = match &outcome.fitted {
            Err(error) => Some(Refusal::no_fit(error, &outcome.diagnosis.findings)),
            Ok(fit) => outcome
                .refusal_of(fit)
                .or_else(|| unfinished(fit, log).filter(|_| is_interrupted)),
        };
        let force = self.settings.force;
        outcome.has_blob = self.is_kept && outcome.fitted.is_ok() && (refusal.is_none() || force);
        if let (Some(cause), true, false) = (&refusal, is_interrupted, outcome.has_blob) {
            let cause = words::refusal(cause, &outcome.diagnosis.findings);
            return Err(CalibrateError::Interrupted(format!(
                "nothing was written. {cause} --force writes it in spite of that"
            )));
        }
        if let Ok(fit) = &mut outcome.fitted {
            fit.set.fit.forced = refusal.is_some();
        }
        if refusal.is_some() {
            outcome.diagnosis.verdict = Some(Verdict::Refused);
        }
        outcome.refusal = refusal;
        Ok(outcome)
    }
}

impl JudgedFit {
    /// Whether the field model was fitted. It is made for service, the other models for the movements of the log.
    fn is_field(&self) -> bool {
        self.fitted.as_ref().is_ok_and(|fit| fit.field.is_some())
    }

    /// Why a fit is not to be used: findings, or errors beyond the limits.
    fn refusal_of(&self, fit: &Fit) -> Option<Refusal> {
        Refusal::from_findings(&self.diagnosis.findings).or_else(|| {
            let on_log = || fit.judgement.errors.axes.map(|axis| axis.rms);
            let predicted = self
                .diagnosis
                .predicted
                .filter(|_| self.decision.in_service);
            self.decision
                .refusal(predicted.map_or_else(on_log, |of| of.rms))
        })
    }

    /// Why it is not to be used, in words.
    pub fn refusal_message(&self) -> Option<String> {
        let refusal = self.refusal.as_ref()?;
        Some(words::refusal(refusal, &self.diagnosis.findings))
    }

    /// What goes beside the blob of these logs: what is known of a field model; `None` of others.
    pub fn known(&self, dataset: &Dataset) -> Option<StoredPosterior> {
        let known = StoredPosterior::from_fit(self.fitted.as_ref().ok()?)?;
        Some(StoredPosterior {
            repaired: self.diagnosis.repaired().map(words::message).collect(),
            budget: self.diagnosis.budget.clone(),
            up_to: self.diagnosis.up_to,
            ..known.with_logs(dataset)
        })
    }

    /// How it ended, for reports.
    pub fn subject(&self) -> Subject<'_> {
        let end = match &self.refusal {
            Some(cause) if !self.has_blob => End::Failed(cause),
            _ if !self.is_kept => End::Checked,
            _ if self.is_interrupted => End::Interrupted,
            _ => End::Written,
        };
        Subject {
            end,
            diagnosis: &self.diagnosis,
            is_field: self.is_field(),
            errors: self.fitted.as_ref().ok().map(|fit| &fit.judgement.errors),
            corrected: None,
            decision: self.decision,
        }
    }

    /// The figures of a log without a fit, and why there is none.
    pub fn without_fit(&self, log: &LogReading) -> Group {
        let (rows, movements) = log.dataset.read();
        let diagnosis = &self.diagnosis;
        let refusal = self.refusal.as_ref();
        group! {
            "rows" => rows,
            "movements" => movements,
            "skipped_rows" => log.skipped_rows,
            "failure" => json!(self.fitted.as_ref().err().map(ToString::to_string)),
            "refusal" => json!(refusal.map(|refusal| WordedRefusal(refusal, &diagnosis.findings))),
            "warnings" => json!(words::messages(&log.warnings)),
            "verdict" => json!(diagnosis.verdict),
            "findings" => json!(words::worded(&diagnosis.findings)),
            "channels" => channels(&diagnosis.columns, &log.dataset),
        }
    }

    /// The figures of the fit; `None` without one.
    pub fn report(
        &self,
        order: &FitOrder,
        (log, stage): (&LogReading, &Stage),
        elapsed_s: f64,
    ) -> Option<Report> {
        let fit = self.fitted.as_ref().ok()?;
        let judged = (&self.diagnosis, self.refusal.as_ref());
        let log_and_stage = (log, stage);
        let mut report = Report::from_fit(
            fit,
            &order.settings,
            log_and_stage,
            (name_of(&fit.fitted.loss), elapsed_s),
            judged,
        );
        let decision = json!(self.subject().decision());
        report.figures.set("decision", decision);
        Some(report)
    }
}

/// The refusal of a search that was interrupted too early: a finished search leaves little but noise.
fn unfinished(fit: &Fit, log: &LogReading) -> Option<Refusal> {
    let over_noise = over_noise(fit, fit.rows(&log.dataset));
    (over_noise > ERROR_TO_NOISE_MAX).then_some(Refusal::Unfinished { over_noise })
}
