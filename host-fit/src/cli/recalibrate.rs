//! `host-fit recalibrate`.

use super::arguments::{Json, Logs, choice};
use super::eval::{add_page, evaluate};
use super::report::{ReportArgs, finish};
use crate::calibrate::{EvalOrder, Updated};
use crate::cli::error::HostError;
use crate::cli::terminal;
use crate::output::kept::CERTIFICATE;
use crate::output::posterior_file::PosteriorFileError;
use crate::output::{Outputs, blob_file, kept, posterior_file};
use crate::report::text::as_text;
use crate::report::verdict::{End, Subject};
use clap::Args;
use hallstage_calibration::diagnose::refusal::Refusal;
use hallstage_calibration::recalibrate::{RecalibrateError, StoredPosterior};
use hallstage_input::log::ReadOptions;
use hallstage_input::stage::Stage;
use hallstage_solver::estimator::model::Model;
use hallstage_solver::estimator::update::Change;
use runtime::{ModelKind, ParameterSet};
use std::path::PathBuf;

/// Arguments of `recalibrate`.
#[derive(Debug, Args)]
pub(super) struct RecalibrateArgs {
    /// The blob to bring up to date: of the field model.
    #[arg(value_name = "old.bin")]
    params: PathBuf,
    #[command(flatten)]
    logs: Logs,
    /// What has changed.
    #[arg(long, value_parser = choice::<Change>())]
    what: Change,
    /// Where to write the new blob.
    #[arg(long, value_name = "new.bin")]
    out: PathBuf,
    #[command(flatten)]
    report: ReportArgs,
    #[command(flatten)]
    json: Json,
}

/// Reads blob, posterior and log, brings the calibration up to date, writes posterior, blob, JSON.
pub(super) fn run(args: &RecalibrateArgs) -> Result<(), HostError> {
    let old_posterior = posterior_file::beside(&args.params);
    let new_posterior = posterior_file::beside(&args.out);
    let inputs = [args.params.as_path()]
        .into_iter()
        .chain(args.logs.inputs());
    let outputs = [
        Some(args.out.as_path()),
        new_posterior.as_deref(),
        args.json.path.as_deref(),
    ];
    super::check_outputs(
        outputs,
        Some(&args.report),
        inputs.chain(old_posterior.as_deref()),
    )?;
    args.report.check_own(&args.json)?;
    let (old, stage) = super::blob_of_stage(&args.params, &args.logs.stage)?;
    kept::check_own_blob(&args.out, &old.serial)?;
    args.report.check_not_before(&args.params, &old)?;
    if old.model != ModelKind::Field {
        let model = Model::from_kind(old.model).title();
        return Err(RecalibrateError::OtherModel { model }.into());
    }
    let known = posterior_file::read(&old, &args.params)?;
    if known.is_none() && matches!(args.what, Change::All | Change::Temperature) {
        let blob = args.params.clone();
        return Err(PosteriorFileError::Missing { blob }.into());
    }
    let options = ReadOptions {
        rows_max: ReadOptions::FIT.rows_max,
        ..ReadOptions::default()
    };
    let log = args.logs.read(&stage, options)?;
    let created = args.report.created.clone().unwrap_or_default();
    let blob = (&old, known.as_ref());
    let mut updated = match Updated::new(blob, &log, &stage, args.what, created) {
        Ok(updated) => updated,
        Err(cause) => {
            as_found(args, blob, &stage, &cause)?;
            return Err(cause.into());
        }
    };
    let mut outputs = Outputs::default();
    args.json.add(&mut outputs, &updated.figures)?;
    let set = &updated.new.set;
    let mut number = None;
    if let Some(known) = &mut updated.new.known {
        let before = &known.certificates.before;
        known.certificates = kept::certificates(&args.out, set, before, &mut updated.warnings);
    }
    let (report, as_found) = updated.report(&old, &log, &stage);
    args.report.add(&mut outputs, || {
        let what = (CERTIFICATE, set.serial.as_str());
        let mut source = args
            .report
            .source(what, &args.logs, (&log, &stage), updated.subject());
        for (path, set, what) in [
            (&args.params, &old, "parameter blob, as found"),
            (&args.out, set, "parameter blob, as left"),
        ] {
            let blob = blob_file::to_bytes(path, set)?;
            source.provenance.add_bytes(path, &blob, what);
        }
        source.warnings.clone_from(&updated.warnings);
        source.report = Some(&report);
        source.as_found = Some(as_found);
        let known = updated.new.known.as_ref();
        source.certificates = known.map(|known| known.certificates.clone());
        number = source.number();
        Ok(source.html()?)
    })?;
    if let (Some(known), Some(number)) = (&mut updated.new.known, number) {
        known.certificates = std::mem::take(&mut known.certificates).with(number);
    }
    if updated.refusal.is_none() {
        let (set, known) = (&updated.new.set, updated.new.known.as_ref());
        posterior_file::add_calibration(&mut outputs, &args.out, set, known)?;
    }
    terminal::print(&as_text(&[updated.gains()]))?;
    let details = updated.figures.tables();
    finish(outputs, &details, &updated.warnings, &updated.subject())?;
    updated
        .refusal_message()
        .map_or(Ok(()), |why| Err(HostError::rejected(why)))
}

/// Writes the page of a blob that is not brought up to date: as it was found.
fn as_found(
    args: &RecalibrateArgs,
    blob: (&ParameterSet, Option<&StoredPosterior>),
    stage: &Stage,
    cause: &RecalibrateError,
) -> Result<(), HostError> {
    if args.report.folder.is_none() {
        return Ok(());
    }
    let evaluation = evaluate(blob, stage, &args.logs, EvalOrder::default())?;
    let report = evaluation.report(0.0);
    let refusal = Refusal::NotUpdated(cause.clone());
    let subject = Subject {
        end: End::Failed(&refusal),
        ..evaluation.subject()
    };
    let mut outputs = Outputs::default();
    let page = ("Calibration as found", subject, args.params.as_path());
    let judged = (&evaluation, &report);
    add_page(
        &args.report,
        &mut outputs,
        page,
        judged,
        (&args.logs, stage),
    )?;
    super::wrote(outputs.commit()?)
}
