//! `host-fit eval`.

use super::arguments::{Json, Logs, choice};
use super::report::{ReportArgs, finish};
use crate::calibrate::{EvalOrder, Evaluation};
use crate::cli::error::HostError;
use crate::cli::terminal;
use crate::output::{Outputs, blob_file, posterior_file};
use clap::Args;
use hallstage_calibration::judge::Zeros;
use hallstage_input::log;
use std::path::PathBuf;
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
    let (set, stage) = super::blob_of_stage(&args.params, &args.logs.stage)?;
    let options = args.logs.options(Evaluation::OPTIONS);
    let paths = &args.logs.paths;
    let order = EvalOrder {
        zeros: args.delta,
        limit: args.limit,
    };
    // What is known of k and h stands beside the blob.
    let known = posterior_file::read(&set, &args.params).ok().flatten();
    let blob = (&set, known.as_ref());
    let evaluation = terminal::timed("evaluation", || {
        Evaluation::new(blob, &stage, order, paths.len(), |take| {
            log::read_each(paths, &stage, &options, take)
        })
    })?;
    let report = evaluation.report(started.elapsed().as_secs_f64());
    let subject = evaluation.subject();
    let mut outputs = Outputs::default();
    args.json.add(&mut outputs, &report)?;
    args.report.add(&mut outputs, || {
        let what = ("Verification of a calibration", set.serial.as_str());
        let log_and_stage = (&evaluation.log, &stage);
        let mut source = args.report.source(what, &args.logs, log_and_stage, subject);
        let blob = blob_file::to_bytes(&args.params, &set)?;
        let provenance = &mut source.provenance;
        provenance.add_bytes(&args.params, &blob, "parameter blob, judged");
        source.warnings.clone_from(&report.warnings);
        source.report = Some(&report);
        Ok(source)
    })?;
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
