//! `host-fit check`.

use super::args::{Json, Logs};
use super::report::{Report, finish};
use crate::cli::error::{HostError, NOT_WRITTEN};
use crate::cli::terminal;
use crate::diagnose::trusted::trusted;
use crate::diagnose::{self, Diagnosis};
use crate::finding::{self, Code, Finding, Severity};
use crate::fit::{Fit, FitError, FitSettings, ModelChoice, fit_log};
use crate::input::log::{LogReading, ReadOptions};
use crate::interrupt;
use crate::judge::Zeros;
use crate::judge::identify::FitFailure;
use crate::output::Outputs;
use crate::report::errors::errors;
use crate::report::json::of_eval;
use crate::report::page::Errors;
use crate::report::table::tables;
use crate::report::verdict::{End, Subject};
use crate::solve::{Projection, SolverOptions};
use clap::Args;
use serde_json::{Value, json};
use std::time::Instant;

/// Arguments of `check`.
#[derive(Debug, Args)]
pub(super) struct CheckArgs {
    #[command(flatten)]
    logs: Logs,
    #[command(flatten)]
    report: Report,
    #[command(flatten)]
    json: Json,
}

/// What is said of a log of which no calibration is kept: model and errors of the fit over all rows, null
/// without a fit; why there is no fit, null if there is one.
pub(super) fn checked(
    log: &LogReading,
    fitted: Result<&Fit, &FitError>,
    diagnosis: &Diagnosis,
) -> Value {
    let (rows, movements) = log.dataset.read();
    let fit = fitted.ok();
    json!({
        "rows": rows,
        "movements": movements,
        "skipped_rows": log.skipped_rows,
        "model": fit.map(|fit| fit.model.name),
        "errors": fit.map(|fit| errors(&fit.all.errors)),
        "failure": fitted.err().map(ToString::to_string),
        "warnings": super::warnings_of(log),
        "verdict": diagnosis.verdict,
        "predicted": diagnosis.predicted,
        "findings": diagnosis.findings,
        "trusted_inputs": fit.map_or_else(Vec::new, |fit| trusted(&fit.set)),
    })
}

/// Whether findings explain why a fit failed.
fn is_explained(error: &FitError, findings: &[Finding]) -> bool {
    let spoils = |found: &Finding| {
        let harmless = [
            Code::TermsAtLimit,
            Code::Jitter,
            Code::RowsMissing,
            Code::NotDetermined,
        ];
        found.severity >= Severity::Warn && !harmless.contains(&found.code)
    };
    match error {
        // What it says may be wrong is for logs of which nothing is known.
        FitError::Failed(FitFailure::NotDescribed { .. }) => findings.iter().any(spoils),
        // What a log leaves open, the failure says better.
        _ => {
            let names = |found: &Finding| finding::is_explained(std::slice::from_ref(found));
            findings
                .iter()
                .any(|found| found.code != Code::NotDetermined && names(found))
        }
    }
}

/// The end of a run whose fit failed, with what the diagnosis found.
pub(super) fn failed(error: &FitError, findings: &[Finding]) -> HostError {
    let messages = finding::messages(findings, Severity::Warn);
    match is_explained(error, findings) {
        _ if messages.is_empty() => HostError::rejected(format!("{NOT_WRITTEN}{error}")),
        true => HostError::rejected(refused(&messages)),
        false => HostError::rejected(format!("{NOT_WRITTEN}{error}. {messages}")),
    }
}

/// How the command ends of a log that is refused.
fn refused(findings: &str) -> String {
    format!("the log is refused, and no parameter blob was written: {findings}")
}

/// Reads and fits, keeps nothing, and reports what was found.
pub(super) fn run(args: &CheckArgs) -> Result<(), HostError> {
    let started = Instant::now();
    super::keep_apart_with(
        [args.json.path.as_deref()],
        &args.report,
        args.logs.inputs(),
    )?;
    interrupt::watch();
    let stage = args.logs.stage.read()?;
    let log = args.logs.read(&stage, ReadOptions::FIT)?;
    let mut options = SolverOptions::new(Projection::Linear, 1);
    options.interrupt = Some(interrupt::watch());
    let settings = FitSettings {
        options,
        ..FitSettings::new(ModelChoice::Auto)
    };
    let fitted = terminal::timed("fit", || fit_log(&log, &stage, &settings))?;
    if interrupt::requested() {
        return Err(HostError::interrupted("nothing was written"));
    }
    let diagnosis = terminal::timed("diagnosis", || {
        diagnose::of_log(&log.dataset, &stage, fitted.as_ref())
    });
    let findings = &diagnosis.findings;
    let refusals = finding::messages(findings, Severity::Refuse);
    let failure = match &fitted {
        Err(error) => Some(failed(error, findings)),
        Ok(_) if refusals.is_empty() => None,
        Ok(_) => Some(HostError::rejected(refused(&refusals))),
    };
    let why = failure.as_ref().map(ToString::to_string);
    let fit = fitted.as_ref().ok();
    let subject = Subject {
        end: why.as_deref().map_or(End::Checked, End::Failed),
        diagnosis: &diagnosis,
        is_field: fit.is_some_and(|fit| fit.field.is_some()),
        errors: fit.map(|fit| &fit.all.errors),
        limits: [None; 3],
        in_service: false,
    };
    let mut outputs = Outputs::default();
    let checked = checked(&log, fitted.as_ref(), &diagnosis);
    args.json.add(&mut outputs, &checked)?;
    let circumstances = super::circumstances(&log, &stage, started);
    let judged = fit.map(|fit| {
        let zeros = Zeros::of_model(fit.model);
        of_eval(&fit.set, &fit.all, zeros, &circumstances)
    });
    args.report.add(&mut outputs, || {
        let what = ("Check of a log", "");
        let mut source = args
            .report
            .source(what, &args.logs, (&log, &stage), subject);
        source.errors = fit.zip(judged.as_ref()).map(|(fit, judged)| {
            let details = tables(judged, &[&judged.hidden()[..], &["errors"]].concat());
            Errors::of_fit(fit, &log.dataset, judged, details)
        });
        Ok(source)
    })?;
    let hidden = ["failure", "warnings", "verdict", "predicted", "findings"];
    let is_note = |found: &Finding| found.severity == Severity::Note;
    if failure.is_none() && findings.iter().all(is_note) {
        terminal::print("nothing is wrong with it\n")?;
    }
    finish(
        outputs,
        &tables(&checked, &hidden),
        &super::warnings_of(&log),
        &subject,
    )?;
    failure.map_or(Ok(()), Err)
}
