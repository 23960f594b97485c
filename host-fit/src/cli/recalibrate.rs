//! `host-fit recalibrate`.

use super::args::choice;
use super::args::{Json, Logs};
use super::report::finish;
use crate::cli::error::HostError;
use crate::finding::{self, Finding, Severity};
use crate::fit::of_undecoded;
use crate::input::log::{LogReading, ReadOptions};
use crate::output::posterior_file::PosteriorFileError;
use crate::output::{Outputs, posterior_file};
use crate::problem::model::Model;
use crate::recalibrate::{Known, RecalibrateError, Recalibration, recalibrate};
use crate::report::errors::errors;
use crate::report::field::by_axis;
use crate::report::table::tables;
use crate::report::verdict::{End, Subject};
use crate::solve::field::update::Change;
use clap::Args;
use runtime::parameters::Text;
use runtime::{ModelKind, ParameterSet};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

super::args::values! {
    Change {
        Gain: "gain", "One gain for all probes: 2 s of a sine along Y tell it";
        Gains: "gains", "A gain for each probe: 2 s of X, Y and Rz moving at once";
        All: "all", "All parameters, as after a probe was seated anew: 8 s of all six axes moving at once";
    }
}

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
    /// Creation time, for the blob, as you want it to read; at most 32 bytes.
    #[arg(long, value_name = "TIME", value_parser = super::args::blob_text)]
    created: Option<Text>,
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
    super::keep_apart(outputs, inputs.chain(old_posterior.as_deref()))?;
    let (old, stage) = super::blob_of_stage(&args.params, &args.logs.stage)?;
    if old.model != ModelKind::Field {
        let model = Model::of(old.model).title();
        return Err(RecalibrateError::OtherModel { model }.into());
    }
    let known = match &old_posterior {
        Some(path) => read_known(path, &old, args)?,
        None => None,
    };
    let options = ReadOptions {
        rows_max: ReadOptions::FIT.rows_max,
        ..ReadOptions::default()
    };
    let log = args.logs.read(&stage, options)?;
    let created = args.created.clone().unwrap_or_default();
    let new = recalibrate(
        &old,
        known.as_ref(),
        &log.dataset,
        &stage,
        args.what,
        created,
    )?;
    let warnings = warnings(&log, &new);
    let figures = figures(args.what, &new, &log, &warnings);
    let refusal = finding::messages(&new.diagnosis.findings, Severity::Refuse);
    let mut outputs = Outputs::default();
    args.json.add(&mut outputs, &figures)?;
    if refusal.is_empty() {
        posterior_file::add_calibration(&mut outputs, &args.out, &new.set, new.known.as_ref())?;
    }
    let subject = Subject {
        end: match refusal.as_str() {
            "" => End::Written,
            refusal => End::Failed(refusal),
        },
        diagnosis: &new.diagnosis,
        is_field: true,
        errors: Some(&new.judgement.errors),
        limits: [None; 3],
        in_service: false,
    };
    let hidden = ["warnings", "findings", "verdict", "predicted"];
    finish(outputs, &tables(&figures, &hidden), &warnings, &subject)?;
    if !refusal.is_empty() {
        return Err(HostError::rejected(refusal));
    }
    Ok(())
}

/// What is known beside the old blob; gains can be found without it.
fn read_known(
    path: &Path,
    old: &ParameterSet,
    args: &RecalibrateArgs,
) -> Result<Option<Known>, HostError> {
    match posterior_file::read(path, old, &args.params) {
        Ok(known) => Ok(Some(known)),
        Err(PosteriorFileError::Missing { .. }) if args.what != Change::All => Ok(None),
        Err(error) => Err(error.into()),
    }
}

fn warnings(log: &LogReading, new: &Recalibration) -> Vec<String> {
    let message = |found: &Finding| found.message.clone();
    let mut warnings: Vec<String> = log.warnings.iter().map(message).collect();
    let undecoded = of_undecoded(new.judgement.undecoded);
    warnings.extend(undecoded.map(|found| found.message));
    if new.known.is_none() {
        warnings.push(
            "no posterior stands beside the old blob: the predicted errors count those of the gains alone, and the new \
             blob can only have its gains recalibrated"
                .to_owned(),
        );
    }
    warnings
}

fn figures(change: Change, new: &Recalibration, log: &LogReading, warnings: &[String]) -> Value {
    let gain = |(change, error): (f64, f64)| json!({ "change_percent": change * 100.0, "standard_error_percent": error * 100.0 });
    let [a, b, c] = new.gains.map(gain);
    // rms errors, from ratios to the noise floor.
    let rms = |ratios: [f64; 3]| by_axis([0, 1, 2].map(|k| new.floor[k] * ratios[k]));
    json!({
        "what": change.name(),
        "rows": log.dataset.rows.len(),
        "movements": log.dataset.movements.len(),
        "gains": { "a": a, "b": b, "c": c },
        // What is predicted for service over the calibrated range: with the old blob, with the new one,
        // and by the noise of the probes alone.
        "predicted_service": {
            "before": rms(new.before), "after": rms(new.after), "floor": rms([1.0; 3]),
        },
        // Whether an old posterior was there, and a new one is.
        "posterior": new.known.is_some(),
        // Over residuals: about 1.
        "chi_squared": new.chi_squared,
        // Over the log, zero deviations refitted.
        "errors": errors(&new.judgement.errors),
        "errors_before": errors(&new.judgement_before.errors),
        "serial": new.set.serial.as_str(),
        "warnings": warnings,
        "verdict": new.diagnosis.verdict,
        "predicted": new.diagnosis.predicted,
        "findings": new.diagnosis.findings,
    })
}
