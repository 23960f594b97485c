//! `host-fit decode`.

use super::args::on_invalid;
use crate::cli::error::HostError;
use crate::cli::terminal;
use crate::input::stage::Stage;
use crate::interrupt;
use crate::output::blob_file;
use crate::output::pose_file::{self, DecodeSettings, PoseFormat};
use crate::output::posterior_file::{self, PosteriorFileError};
use crate::output::streamed_file::StreamedFile;
use crate::problem::model::Model;
use crate::solve::field::parameters::FieldParameters;
use crate::solve::field::posterior::Posterior;
use clap::{Args, ValueEnum};
use runtime::ParameterSet;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;

/// Arguments of `decode`.
#[derive(Debug, Args)]
pub(super) struct DecodeArgs {
    /// The parameter blob.
    #[arg(value_name = "params.bin")]
    params: PathBuf,
    /// The log: CSV or CSV.gz, or `-` for standard input; it needs no reference.
    #[arg(value_name = "LOG")]
    log: PathBuf,
    /// The stage as designed.
    #[arg(long, value_name = "stage.toml")]
    stage: PathBuf,
    /// Where to write the poses.
    #[arg(long, value_name = "pose.csv")]
    out: PathBuf,
    /// Repeat the last valid pose for at most so many rows where codes are bad.
    #[arg(long, value_name = "N", default_value_t = 0)]
    hold: u16,
    /// Add the standard uncertainty of X, Y, Rz to each line, by parameters and noise: three
    /// columns. For a blob of the field model with its posterior beside it.
    #[arg(long)]
    uncertainty: bool,
    /// How poses are written.
    #[arg(long, value_enum, default_value = "csv")]
    format: FormatChoice,
}

/// How `decode` writes poses.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum FormatChoice {
    /// Text.
    Csv,
    /// A structured array for numpy.load, in SI units, the decoder's words bit for bit.
    Npy,
}

impl FormatChoice {
    const fn format(self) -> PoseFormat {
        match self {
            Self::Csv => PoseFormat::Csv,
            Self::Npy => PoseFormat::Npy,
        }
    }
}

/// Decodes a log into a pose file.
pub(super) fn run(args: &DecodeArgs) -> Result<(), HostError> {
    let inputs = [
        args.params.as_path(),
        args.log.as_path(),
        args.stage.as_path(),
    ];
    super::keep_apart(&[Some(&args.out)], &inputs)?;
    let set = blob_file::read(&args.params)?;
    let stage = Stage::from_file(&args.stage)?;
    super::same_scales(&set, &stage, &args.stage)?;
    let posterior = if args.uncertainty {
        Some(posterior(&set, &stage, &args.params)?)
    } else {
        None
    };
    let out = StreamedFile::create(&args.out)?;
    if args.format == FormatChoice::Npy && !out.is_file() {
        return Err(HostError::Usage {
            argument: "--format npy",
            problem: "the number of rows stands at the start of the array, so that it cannot be written to a pipe or device: name a file".to_owned(),
        });
    }
    let settings = DecodeSettings {
        decoder: &set.decoder(),
        on_invalid: on_invalid(args.hold),
        posterior: posterior.as_ref(),
        format: args.format.format(),
    };
    let stop = interrupt::watch();
    let go_on = || match stop.load(Ordering::Relaxed) {
        false => Ok(()),
        true => Err(HostError::Interrupted {
            kept: "no pose file was written".to_owned(),
        }),
    };
    let decode = || pose_file::decode_log(&args.log, &stage, &settings, out, go_on);
    let (counts, log) = terminal::timed("decoding", decode)?;
    let mut summary = format!(
        "{} rows, {} of them with status 0\n",
        counts.rows, counts.good
    );
    for (name, rows) in counts.named() {
        summary.push_str(&format!("  {rows} rows: {name}\n"));
    }
    terminal::print(&summary)?;
    super::wrote([Some(args.out.clone())])?;
    let warnings: Vec<String> = log.warnings.iter().map(ToString::to_string).collect();
    terminal::warn(&warnings);
    Ok(())
}

/// What is known of a blob's errors, from the file beside it.
fn posterior(set: &ParameterSet, stage: &Stage, blob: &Path) -> Result<Posterior, HostError> {
    let parameters = FieldParameters::of_set(set, stage);
    let parameters = parameters.ok_or_else(|| HostError::NoUncertainty {
        path: blob.to_owned(),
        model: Model::of(set.model).name,
    })?;
    let path = posterior_file::beside(blob).ok_or_else(|| PosteriorFileError::Missing {
        path: blob.to_owned(),
    })?;
    let known = posterior_file::read(&path, set, blob)?;
    Ok(Posterior::of_parameters(
        known.covariance,
        &parameters,
        &known.noise,
    ))
}
