//! `host-fit decode`.

use super::arguments::{StageFile, choice, hold};
use super::interrupt;
use crate::cli::error::HostError;
use crate::cli::terminal;
use crate::output::pose_file::{self, DecodeSettings, KnownErrors, PoseFormat};
use crate::output::posterior_file::{self, PosteriorFileError};
use crate::output::{Output, kept};
use clap::Args;
use hallstage_calibration::words;
use hallstage_input::stage::Stage;
use hallstage_solver::estimator::model::Model;
use hallstage_solver::estimator::parameters::FieldParameters;
use hallstage_solver::estimator::posterior::Posterior;
use runtime::{OnInvalid, ParameterSet};
use std::path::{Path, PathBuf};

/// Arguments of `decode`.
#[derive(Debug, Args)]
pub(super) struct DecodeArgs {
    /// The parameter blob.
    #[arg(value_name = "params.bin")]
    params: PathBuf,
    /// The log: CSV or CSV.gz, or `-` for standard input; it needs no reference.
    #[arg(value_name = "LOG")]
    log: PathBuf,
    #[command(flatten)]
    stage: StageFile,
    /// Where to write the poses.
    #[arg(long, value_name = "pose.csv")]
    out: PathBuf,
    /// Repeat the last valid pose for at most N rows where codes are bad.
    #[arg(long, value_name = "N", default_value = "0", value_parser = hold)]
    hold: OnInvalid,
    /// Add the standard uncertainty of X, Y, Rz to each line, by parameters and noise, and by all sources of the
    /// budget: six columns. For a blob of the field model with its posterior beside it.
    #[arg(long)]
    uncertainty: bool,
    /// How poses are written.
    #[arg(long, value_parser = choice::<PoseFormat>(), default_value = "csv")]
    format: PoseFormat,
    /// Replace a file that may hold a measurement.
    #[arg(long)]
    force: bool,
}

/// Decodes a log into a pose file.
pub(super) fn run(args: &DecodeArgs) -> Result<(), HostError> {
    let inputs = [&args.params, &args.log, &args.stage.path].map(PathBuf::as_path);
    super::check_outputs([Some(args.out.as_path())], None, inputs)?;
    if !args.force {
        kept::check_own(&args.out, kept::POSES)?;
    }
    let (set, stage) = super::blob_of_stage(&args.params, &args.stage)?;
    let known = || known_errors(&set, &stage, &args.params);
    let known = args.uncertainty.then(known).transpose()?;
    let out = Output::create(&args.out)?;
    if args.format == PoseFormat::Npy && !out.is_file() {
        return Err(HostError::usage(
            "--format npy",
            "the number of rows stands at the start of the array, so that it cannot be written to a pipe or device: name \
             a file",
        ));
    }
    let settings = DecodeSettings {
        decoder: &set.decoder(),
        on_invalid: args.hold,
        correction: set.motion_correction.as_ref(),
        known: known.as_ref(),
        format: args.format,
        watch: interrupt::watch(),
    };
    let decode = || pose_file::decode_log::<HostError>(&args.log, &stage, &settings, out);
    let (counts, log) = terminal::timed("decoding", decode)?;
    let mut summary = format!(
        "{} rows, {} of them with status 0\n",
        counts.rows, counts.good
    );
    for (name, rows) in counts.named() {
        summary.push_str(&format!("  {rows} rows: {name}\n"));
    }
    if log.has_reference && set.motion_correction.is_some() {
        summary.push_str(
            "  poses corrected by the commanded motion of the log (cmd_x, cmd_y, cmd_rz)\n",
        );
    }
    terminal::print(&summary)?;
    super::wrote([args.out.clone()])?;
    let warnings: Vec<String> = words::messages(&log.warnings);
    terminal::warn(&warnings);
    Ok(())
}

/// What is known of a blob's errors, from the file beside it.
fn known_errors(set: &ParameterSet, stage: &Stage, blob: &Path) -> Result<KnownErrors, HostError> {
    let parameters = FieldParameters::from_set(set, stage);
    let parameters = parameters.ok_or_else(|| {
        HostError::input(format!(
            "{} is of model ({}), which does not know its errors in service: they are several times those on the log that \
             it was fitted to. Fit the field model (--model field), or leave --uncertainty out",
            blob.display(),
            Model::from_kind(set.model).name
        ))
    })?;
    let known = posterior_file::read(set, blob)?;
    let known = known.ok_or_else(|| PosteriorFileError::Missing {
        blob: blob.to_owned(),
    })?;
    Ok(KnownErrors {
        posterior: Posterior::from_covariance(known.covariance, &parameters, &known.noise),
        budget: known.budget,
    })
}
