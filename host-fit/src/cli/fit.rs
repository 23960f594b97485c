//! `host-fit fit`.

use super::args::{Json, Logs, Threads};
use super::arguments::choice;
use super::interrupt;
use super::report::finish;
use crate::calibrate::FitOptions;
use crate::cli::error::HostError;
use crate::cli::terminal;
use crate::output::{Outputs, blob_file, posterior_file};
use crate::report::page::Source;
use crate::report::parameters;
use crate::report::result::Report;
use crate::report::verdict::{End, Subject};
use clap::Args;
use hallstage_calibration::fit::Fit;
use hallstage_calibration::words;
use hallstage_input::log::{BadRows, LogReading, ReadOptions};
use hallstage_input::stage::Stage;
use std::path::PathBuf;
use std::time::Instant;

/// Arguments of `fit`.
#[derive(Debug, Args)]
pub(super) struct FitArgs {
    #[command(flatten)]
    logs: Logs,
    /// Where to write the parameter blob.
    #[arg(long, value_name = "params.bin")]
    out: PathBuf,
    #[command(flatten)]
    options: FitOptions,
    #[command(flatten)]
    pub(super) threads: Threads,
    /// What to do with rows that cannot be used.
    #[arg(long, value_parser = choice::<BadRows>(), default_value = "refuse")]
    bad_rows: BadRows,
    #[command(flatten)]
    report: super::report::Report,
    #[command(flatten)]
    json: Json,
}

/// Reads, fits, judges; then writes JSON, report and blob, in this order.
pub(super) fn run(args: &FitArgs) -> Result<(), HostError> {
    let started = Instant::now();
    let posterior = posterior_file::beside(&args.out);
    let outputs = [Some(&args.out), posterior.as_ref(), args.json.path.as_ref()];
    let outputs = outputs.map(|path| path.map(PathBuf::as_path));
    super::check_outputs(outputs, Some(&args.report), args.logs.inputs())?;
    let created = args.report.created.clone().unwrap_or_default();
    let order = args.options.order(created, interrupt::watch());
    let order = order.map_err(HostError::from_mismatch)?;
    let stage = args.logs.stage.read()?;
    let log = args.logs.read(
        &stage,
        ReadOptions {
            bad_rows: args.bad_rows,
            ..ReadOptions::FIT
        },
    )?;
    let outcome = terminal::timed("fit and diagnosis", || order.run(&log, &stage));
    let outcome = outcome.map_err(HostError::from_calibrate)?;
    let of_log = (&log, &stage);
    let report = outcome.report(&order, of_log, started.elapsed().as_secs_f64());
    let mut outputs = Outputs::default();
    match &report {
        None => {
            args.json.add(&mut outputs, &outcome.checked(&log))?;
        }
        Some(report) => args.json.add(&mut outputs, report)?,
    }
    let found = outcome.fitted.as_ref().ok().zip(report.as_ref());
    let subject = outcome.subject();
    args.report
        .add(&mut outputs, || source(args, of_log, subject, found))?;
    let warnings = words::messages(&log.warnings);
    let (Some((fit, report)), true) = (found, outcome.has_blob) else {
        finish(outputs, &[], &warnings, &subject)?;
        let cause = outcome.refusal_message().unwrap_or_default();
        let force = match &outcome.fitted {
            Ok(_) => "; --force writes one that says so",
            Err(_) => "",
        };
        let cause = format!("{cause} No parameter blob was written{force}.");
        return Err(HostError::rejected(cause));
    };
    if let Some(cause) = outcome.refusal_message() {
        terminal::warn(&[format!("written all the same, as --force asks: {cause}")]);
    }
    let known = outcome.known();
    posterior_file::add_calibration(&mut outputs, &args.out, &fit.set, known.as_ref())?;
    let designed = [("designed", parameters::designed(&stage))];
    let mut details = report.figures.tables();
    details.splice(1..1, parameters::tables(&report.parameters, &designed));
    finish(outputs, &details, &warnings, &subject)?;
    match interrupt::is_requested() {
        true => Err(HostError::interrupted(format!(
            "{} holds the best so far",
            args.out.display()
        ))),
        false => Ok(()),
    }
}

/// What the report says of a fit with its figures, or of a log that has none.
fn source<'a>(
    args: &FitArgs,
    (log, stage): (&'a LogReading, &'a Stage),
    subject: Subject<'a>,
    fit: Option<(&'a Fit, &'a Report)>,
) -> Result<Source<'a>, HostError> {
    let serial = args.options.serial.as_deref().unwrap_or_default();
    let what = ("Calibration certificate", serial);
    let mut source = args.report.source(what, &args.logs, (log, stage), subject);
    if let (Some((fit, _)), End::Written | End::Interrupted) = (fit, subject.end) {
        let blob = blob_file::to_bytes(&args.out, &fit.set)?;
        let provenance = &mut source.provenance;
        provenance.add_bytes(&args.out, &blob, "parameter blob, written");
    }
    source.report = fit.map(|(_, report)| report);
    Ok(source)
}
