//! `host-fit check`.

use super::args::{Json, Logs};
use super::interrupt;
use super::report::{Report, finish};
use crate::calibrate::checked;
use crate::cli::error::HostError;
use crate::cli::terminal;
use crate::output::Outputs;
use crate::report::result::{self, Circumstances, Judged};
use crate::report::verdict::{End, Subject};
use clap::Args;
use hallstage_calibration::diagnose::refusal::Refusal;
use hallstage_calibration::diagnose::{Diagnosis, diagnose_log};
use hallstage_calibration::fit::{FitSettings, ModelChoice, fit};
use hallstage_calibration::judge::Zeros;
use hallstage_calibration::words;
use hallstage_input::finding::{Finding, Severity};
use hallstage_input::log::ReadOptions;
use hallstage_solver::solve::{Projection, SolverOptions};
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

/// Reads and fits, keeps nothing, and reports what was found.
pub(super) fn run(args: &CheckArgs) -> Result<(), HostError> {
    let started = Instant::now();
    super::check_outputs(
        [args.json.path.as_deref()],
        Some(&args.report),
        args.logs.inputs(),
    )?;
    interrupt::watch();
    let stage = args.logs.stage.read()?;
    let log = args.logs.read(&stage, ReadOptions::FIT)?;
    let mut options = SolverOptions::new(Projection::Linear, 1);
    options.watch = interrupt::watch();
    let settings = FitSettings {
        options,
        ..FitSettings::new(ModelChoice::Auto)
    };
    let fitted = terminal::timed("fit", || fit(&log.dataset, &stage, &settings));
    if interrupt::is_requested() {
        return Err(HostError::interrupted("nothing was written"));
    }
    let diagnosis = terminal::timed("diagnosis", || {
        diagnose_log(&log.dataset, &stage, fitted.as_ref())
    });
    let findings = &diagnosis.findings;
    let refusal = Refusal::from_fit(fitted.as_ref(), findings);
    let fit = fitted.as_ref().ok();
    let subject = Subject {
        end: refusal.as_ref().map_or(End::Checked, End::Failed),
        diagnosis: &diagnosis,
        is_field: fit.is_some_and(|fit| fit.field.is_some()),
        errors: fit.map(|fit| &fit.judgement.errors),
        limits: [None; 3],
        in_service: false,
    };
    let mut outputs = Outputs::default();
    let checked = checked(&log, fitted.as_ref(), &diagnosis);
    args.json.add(&mut outputs, &checked)?;
    let elapsed_s = started.elapsed().as_secs_f64();
    let circumstances = Circumstances {
        dataset: fit.map_or(&log.dataset, |fit| fit.rows(&log.dataset)),
        ..Circumstances::new(&log, &stage, elapsed_s, Diagnosis::default())
    };
    let judged = fit.map(|fit| {
        let by_row = fit.errors_by_row(circumstances.dataset);
        let judged = Judged {
            set: &fit.set,
            judgement: &fit.judgement,
            zeros: Zeros::for_model(fit.model),
            by_row: &by_row,
            over_rows: fit.judgement.errors,
        };
        result::Report::from_judgement(judged, &circumstances)
    });
    args.report.add(&mut outputs, || {
        let what = ("Check of a log", "");
        let mut source = args
            .report
            .source(what, &args.logs, (&log, &stage), subject);
        source.report = judged.as_ref();
        Ok(source)
    })?;
    let is_note = |found: &Finding| found.severity == Severity::Note;
    if refusal.is_none() && findings.iter().all(is_note) {
        terminal::print("no fault found\n")?;
    }
    finish(
        outputs,
        &checked.tables(),
        &words::messages(&log.warnings),
        &subject,
    )?;
    match &refusal {
        Some(refusal) => Err(HostError::rejected(words::refusal(refusal, findings))),
        None => Ok(()),
    }
}
