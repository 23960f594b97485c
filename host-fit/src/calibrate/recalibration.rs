//! What is said of a calibration that was brought up to date.

use super::name_of;
use crate::report::decision::Decision;
use crate::report::errors::{errors, pose};
use crate::report::figure::{Figure, Group, figure, group, micro};
use crate::report::page::AsFound;
use crate::report::result::{Judged, Report};
use crate::report::table::Table;
use crate::report::verdict::{End, Subject};
use hallstage_calibration::diagnose::refusal::Refusal;
use hallstage_calibration::fit::codes_refused;
use hallstage_calibration::judge::verdict::Verdict;
use hallstage_calibration::judge::{Decoded, Judgement, Zeros};
use hallstage_calibration::recalibrate::{
    RecalibrateError, Recalibration, StoredPosterior, own_logs, recalibrate,
};
use hallstage_calibration::words::{self, WordedRefusal};
use hallstage_input::axis::{PLANAR, PROBES};
use hallstage_input::log::LogReading;
use hallstage_input::stage::Stage;
use hallstage_solver::estimator::update::Change;
use runtime::ParameterSet;
use runtime::parameters::Text;
use serde_json::json;

/// A calibration that was brought up to date, and what is said of it.
#[derive(Debug)]
pub struct Updated {
    /// The calibration.
    pub new: Recalibration,
    /// What the user should know of it.
    pub warnings: Vec<String>,
    /// The figures.
    pub figures: Group,
    /// Why it is no good.
    pub refusal: Option<Refusal>,
    decision: Decision,
}

impl Updated {
    /// Brings a blob, and what is known of it, up to date by a log.
    ///
    /// # Errors
    /// See [`RecalibrateError`].
    pub fn new(
        (old, known): (&ParameterSet, Option<&StoredPosterior>),
        log: &LogReading,
        stage: &Stage,
        change: Change,
        created: Text,
    ) -> Result<Self, RecalibrateError> {
        let own = own_logs(old, known, &log.dataset);
        if !own.is_empty() {
            return Err(RecalibrateError::OwnLog(own));
        }
        let mut new = recalibrate(old, known, &log.dataset, stage, change, created)?;
        let warnings = warnings(log, &new);
        let predicted = new.diagnosis.predicted.as_ref();
        let limits = [stage.certificate.limits, [None; 3]];
        let decision = Decision::new(limits, stage, &new.diagnosis, true);
        let refusal = Refusal::from_findings(&new.diagnosis.findings)
            .or_else(|| decision.refusal(predicted?.rms));
        if refusal.is_some() {
            new.diagnosis.verdict = Some(Verdict::Refused);
        }
        let mut updated = Self {
            figures: figures(change, &new, log, &warnings),
            refusal,
            decision,
            new,
            warnings,
        };
        let left = updated.subject().decision();
        updated.figures.set("decision", json!(left));
        let findings = &updated.new.diagnosis.findings;
        let refusal = updated.refusal.as_ref();
        let refusal = refusal.map(|refusal| WordedRefusal(refusal, findings));
        updated.figures.set("refusal", json!(refusal));
        let found = updated.new.predicted_before.rms;
        let found = decision.figures(found, decision.passes(found));
        updated.figures.set("decision_as_found", json!(found));
        Ok(updated)
    }

    /// Why it is no good, in words.
    pub fn refusal_message(&self) -> Option<String> {
        let refusal = self.refusal.as_ref()?;
        Some(words::refusal(refusal, &self.new.diagnosis.findings))
    }

    /// The figures of a page, and those of the old blob.
    pub fn report(&self, old: &ParameterSet, log: &LogReading, stage: &Stage) -> (Report, AsFound) {
        let (new, dataset) = (&self.new, &log.dataset);
        let by_row = |set: &ParameterSet, judgement: &Judgement| {
            Decoded::new(set, dataset).errors_less(&judgement.zeros, dataset)
        };
        let mut report = Report::from_judgement(Judged {
            set: &new.set,
            judgement: &new.judgement,
            zeros: Zeros::Refit,
            by_row: by_row(&new.set, &new.judgement),
            over_rows: new.judgement.errors,
            stage,
            dataset,
            skipped_rows: log.skipped_rows,
            elapsed_s: 0.0,
            warnings: self.warnings.clone(),
            diagnosis: &new.diagnosis,
            refusal: self.refusal.as_ref(),
        });
        report.figures = self.figures.clone();
        let mut table = Table {
            decimals: Some(2),
            ..Table::new(
                "As found and as left, by one decision rule",
                &[
                    "rms on the log",
                    "rms in service",
                    "limit in service",
                    "pass",
                ],
            )
        };
        let found = new.predicted_before;
        let passes = self.decision.passes(found.rms);
        let left = self.subject().passes();
        for (state, judgement, predicted, passes) in [
            ("as found", &new.judgement_before, Some(found), passes),
            ("as left", &new.judgement, new.diagnosis.predicted, left),
        ] {
            for (k, axis) in PLANAR.iter().enumerate() {
                let service = predicted.map(|of| of.rms[k]);
                let on_log = Some(judgement.errors.axes[k].rms);
                let error = |error: Option<f64>| error.map_or(Figure::None, |of| micro(axis, of));
                let mut cells = [on_log, service, self.decision.accepted(k)]
                    .map(error)
                    .to_vec();
                cells.push(passes[k].map_or(Figure::None, Figure::Is));
                table.row(format!("{}, {state}", axis.name), cells);
            }
        }
        let before = &new.judgement_before;
        let as_found = AsFound {
            by_row: by_row(old, before),
            errors: before.errors,
            tables: vec![table, self.gains()],
        };
        (report, as_found)
    }

    /// The changes of the gains.
    pub fn gains(&self) -> Table {
        let mut table = Table::new("Gains", &["change"]);
        for (probe, (change, error)) in PROBES.iter().zip(self.new.gains) {
            let change = figure(change * 100.0, "%").with_error(Some(error * 100.0));
            table.row(format!("Hall {probe}"), [change]);
        }
        table
    }

    /// What its verdict is about.
    pub fn subject(&self) -> Subject<'_> {
        Subject {
            end: self.refusal.as_ref().map_or(End::Written, End::Failed),
            diagnosis: &self.new.diagnosis,
            is_field: true,
            errors: Some(&self.new.judgement.errors),
            corrected: None,
            decision: self.decision,
        }
    }
}

fn warnings(log: &LogReading, new: &Recalibration) -> Vec<String> {
    let mut warnings = words::messages(&log.warnings);
    let refused = codes_refused(new.judgement.undecoded);
    warnings.extend(refused.as_ref().map(words::message));
    if new.known.is_none() {
        warnings.push(
            "no posterior stands beside the old blob: the predicted errors count those of the gains alone, and the new \
             blob can only have its gains recalibrated"
                .to_owned(),
        );
    }
    warnings
}

fn figures(change: Change, new: &Recalibration, log: &LogReading, warnings: &[String]) -> Group {
    let gain = |(change, error): (f64, f64)| group! { "change" => figure(change * 100.0, "%").with_error(Some(error * 100.0)) };
    let [a, b, c] = new.gains.map(gain);
    let before = new.predicted_before;
    let floor = [0, 1, 2].map(|axis| before.noise(axis));
    group! {
        "what" => name_of(&change),
        "rows" => log.dataset.rows.len(),
        "movements" => log.dataset.movements.len(),
        "gains" => group! { "a" => a, "b" => b, "c" => c },
        // Predicted for the declared service: with the old blob, with the new one, and from the noise of the
        // probes alone.
        "predicted_service" => group! {
            "before" => pose(before.rms), "after" => new.diagnosis.predicted.map(|of| pose(of.rms)), "floor" => pose(floor),
        },
        // Whether there was an old posterior, and so a new posterior.
        "posterior" => new.known.is_some(),
        // Over residuals: about 1.
        "chi_squared" => new.chi_squared,
        // Over the log, zero deviations refitted.
        "errors" => errors(&new.judgement.errors),
        "errors_before" => errors(&new.judgement_before.errors),
        "serial" => new.set.serial.as_str(),
        "warnings" => json!(warnings),
        "verdict" => json!(new.diagnosis.verdict),
        "predicted" => json!(new.diagnosis.predicted),
        "findings" => json!(words::worded(&new.diagnosis.findings)),
    }
}
