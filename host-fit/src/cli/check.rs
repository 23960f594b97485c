//! `host-fit check`.

use super::args::{Json, Logs};
use super::interrupt;
use super::report::{Report, finish};
use crate::calibrate::{FitOrder, Limits};
use crate::cli::error::HostError;
use crate::cli::terminal;
use crate::output::Outputs;
use clap::Args;
use hallstage_calibration::fit::{FitSettings, ModelChoice};
use hallstage_calibration::words;
use hallstage_input::finding::{Finding, Severity};
use hallstage_input::log::ReadOptions;
use std::time::Instant;

/// Arguments of `check`.
#[derive(Debug, Args)]
#[command(mut_arg("paths", |paths| paths.required(false).required_unless_present("stage")))]
#[command(mut_arg("report", |report| report.requires("paths")))]
#[command(mut_arg("json", |json| json.requires("paths")))]
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
    if args.logs.paths.is_empty() {
        return terminal::print("no fault found in the stage file\n");
    }
    let log = args.logs.read(&stage, ReadOptions::FIT)?;
    let mut settings = FitSettings::new(ModelChoice::Auto);
    settings.options.watch = interrupt::watch();
    let order = FitOrder {
        settings,
        limits: Limits::default(),
        is_kept: false,
    };
    let outcome = terminal::timed("fit and diagnosis", || order.run(&log, &stage));
    let outcome = outcome.map_err(HostError::from_calibrate)?;
    let of_log = (&log, &stage);
    let report = outcome.report(&order, of_log, started.elapsed().as_secs_f64());
    let (checked, subject) = (outcome.checked(&log), outcome.subject());
    let mut outputs = Outputs::default();
    args.json.add(&mut outputs, &checked)?;
    args.report.add(&mut outputs, || {
        let what = ("Check of a log", "");
        let mut source = args.report.source(what, &args.logs, of_log, subject);
        source.report = report.as_ref();
        Ok(source)
    })?;
    let is_note = |found: &Finding| found.severity == Severity::Note;
    if outcome.refusal.is_none() && outcome.diagnosis.findings.iter().all(is_note) {
        terminal::print("no fault found\n")?;
    }
    let warnings = words::messages(&log.warnings);
    finish(outputs, &checked.tables(), &warnings, &subject)?;
    match outcome.refusal_message() {
        Some(refusal) => Err(HostError::rejected(refusal)),
        None => Ok(()),
    }
}
