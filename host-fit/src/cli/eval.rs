//! `host-fit eval`.

use crate::cli::error::HostError;
use crate::fit::FitWarning;
use crate::input::log;
use crate::input::stage::Stage;
use crate::judge::{Decoded, Zeros};
use crate::output::blob_file;
use crate::problem::model::Model;
use crate::report::json::of_eval;
use crate::report::text;
use clap::{Args, ValueEnum};
use std::path::PathBuf;
use std::time::Instant;

/// How `eval` treats zero deviations.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum DeltaChoice {
    /// Refit them for each movement.
    Fit,
    /// None: as the target reads without a re-zero.
    Zero,
}

/// Arguments of `eval`.
#[derive(Debug, Args)]
pub(super) struct EvalArgs {
    /// The parameter blob.
    #[arg(value_name = "params.bin")]
    params: PathBuf,
    /// Logs: CSV or CSV.gz, one or more.
    #[arg(required = true, value_name = "LOG")]
    logs: Vec<PathBuf>,
    /// The stage as designed.
    #[arg(long, value_name = "stage.toml")]
    stage: PathBuf,
    /// Zero deviations; as the blob's model has them if not given: models (12) and (15) have none.
    #[arg(long, value_enum)]
    delta: Option<DeltaChoice>,
    /// Write the figures as JSON; `-` for standard output.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// Judges a blob on logs with reference.
pub(super) fn run(args: &EvalArgs) -> Result<(), HostError> {
    let started = Instant::now();
    let mut inputs = vec![args.params.as_path(), args.stage.as_path()];
    inputs.extend(args.logs.iter().map(PathBuf::as_path));
    super::keep_apart(&[args.json.as_deref()], &inputs)?;
    let set = blob_file::read(&args.params)?;
    let stage = Stage::from_file(&args.stage)?;
    super::same_scales(&set, &stage, &args.stage)?;
    let log = log::read(&args.logs, &stage, &super::EVAL)?;
    let zeros = match args.delta {
        None => Zeros::of_model(Model::of(set.model)),
        Some(DeltaChoice::Fit) => Zeros::Refit,
        Some(DeltaChoice::Zero) => Zeros::None,
    };
    let judgement = Decoded::new(&set, &log.dataset).judge(&log.dataset, &stage, zeros);
    let mut circumstances = super::circumstances(&log, &stage, started);
    if judgement.undecoded > 0 {
        let undecoded = FitWarning::Undecoded {
            rows: judgement.undecoded,
        };
        circumstances.warnings.push(undecoded.to_string());
    }
    let clipped = judgement.zeros.iter().filter(|zero| zero.clipped).count();
    if clipped > 0 {
        circumstances.warnings.push(format!(
            "the zero deviation of {clipped} of {} movements was clipped to its range",
            judgement.zeros.len()
        ));
    }
    let report = of_eval(&set, &judgement, zeros, &circumstances);
    if let Some(path) = &args.json {
        super::write_json(&report, path)?;
    }
    if !super::is_standard_output(args.json.as_deref()) {
        super::print(&format!(
            "{}, {} rows in {} movements\n\n{}",
            report.model_title,
            report.rows,
            report.movements,
            text::errors(
                &format!("errors, {}", report.zeros_in_words),
                &judgement.errors,
                None
            )
        ))?;
    }
    super::warn(&report.warnings);
    Ok(())
}
