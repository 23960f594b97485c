//! `host-fit eval`.

use super::arguments::{Json, Logs, choice};
use super::report::{ReportArgs, finish};
use crate::calibrate::{EvalOrder, Evaluation};
use crate::cli::error::HostError;
use crate::cli::terminal;
use crate::output::{Outputs, blob_file, posterior_file};
use crate::report::result::Report;
use crate::report::verdict::Subject;
use clap::Args;
use hallstage_calibration::judge::Zeros;
use hallstage_calibration::recalibrate::StoredPosterior;
use hallstage_input::log::{self, LogError};
use hallstage_input::stage::Stage;
use runtime::ParameterSet;
use serde_json::json;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Arguments of `eval`.
#[derive(Debug, Args)]
pub(super) struct EvalArgs {
    /// The parameter blob.
    #[arg(value_name = "params.bin")]
    params: PathBuf,
    #[command(flatten)]
    logs: Logs,
    /// Zero deviations; as the blob's model has them if not given: models (12) and (15) have none.
    #[arg(long, value_parser = choice::<Zeros<'static>>())]
    delta: Option<Zeros<'static>>,
    /// Largest rms error as a multiple of the error on the logs that the blob was fitted to: 3 if not given, and 10 for
    /// models (12) to (31), because their own logs may hide their errors.
    #[arg(long, value_name = "FACTOR", value_parser = factor)]
    limit: Option<f64>,
    #[command(flatten)]
    report: ReportArgs,
    #[command(flatten)]
    json: Json,
}

fn factor(value: &str) -> Result<f64, &'static str> {
    let number = value.parse().ok();
    (number.filter(|factor: &f64| factor.is_finite() && *factor > 0.0))
        .ok_or("a factor above zero is needed")
}

/// Judges a blob on logs with reference.
pub(super) fn run(args: &EvalArgs) -> Result<(), HostError> {
    let started = Instant::now();
    let inputs = [args.params.as_path()]
        .into_iter()
        .chain(args.logs.inputs());
    super::check_outputs([args.json.path.as_deref()], Some(&args.report), inputs)?;
    args.report.check_own(&args.json)?;
    let (set, stage) = super::blob_of_stage(&args.params, &args.logs.stage)?;
    let order = EvalOrder {
        zeros: args.delta,
        limit: args.limit,
    };
    // What is known of k and h stands beside the blob.
    let (known, unusable) = match posterior_file::read(&set, &args.params) {
        Ok(known) => (known, None),
        Err(cause) => (None, Some(cause.to_string())),
    };
    let evaluation = evaluate((&set, known.as_ref()), &stage, &args.logs, order)?;
    let mut report = evaluation.report(started.elapsed().as_secs_f64());
    report.warnings.extend(unusable);
    report.figures.set("warnings", json!(report.warnings));
    let subject = evaluation.subject();
    let mut outputs = Outputs::default();
    args.json.add(&mut outputs, &report)?;
    let page = (evaluation.title(), subject, args.params.as_path());
    let judged = (&evaluation, &report);
    add_page(
        &args.report,
        &mut outputs,
        page,
        judged,
        (&args.logs, &stage),
    )?;
    finish(
        outputs,
        &report.figures.tables(),
        &report.warnings,
        &subject,
    )?;
    match evaluation.refusal_message() {
        Some(why) => Err(HostError::rejected(why)),
        None => Ok(()),
    }
}

/// Judges a blob, and what is known of it, on logs.
pub(super) fn evaluate(
    blob: (&ParameterSet, Option<&StoredPosterior>),
    stage: &Stage,
    logs: &Logs,
    order: EvalOrder,
) -> Result<Evaluation, LogError> {
    let options = logs.options(Evaluation::OPTIONS);
    terminal::timed("evaluation", || {
        Evaluation::new(blob, stage, order, logs.paths.len(), |take| {
            log::read_each(&logs.paths, stage, &options, take)
        })
    })
}

/// Adds the page of a blob in this file that was judged, with title and end, if a report is asked for.
pub(super) fn add_page(
    to: &ReportArgs,
    outputs: &mut Outputs,
    (title, subject, blob): (&'static str, Subject, &Path),
    (evaluation, report): (&Evaluation, &Report),
    (logs, stage): (&Logs, &Stage),
) -> Result<(), HostError> {
    to.add(outputs, || {
        let what = (title, report.set.serial.as_str());
        let mut source = to.source(what, logs, (&evaluation.log, stage), subject);
        let bytes = blob_file::to_bytes(blob, &report.set)?;
        let provenance = &mut source.provenance;
        provenance.add_bytes(blob, &bytes, "parameter blob, judged");
        source.certificates = Some(evaluation.certificates.clone());
        source.warnings.clone_from(&report.warnings);
        source.report = Some(report);
        Ok(source.html()?)
    })
}
