//! `host-fit recalibrate`.

use crate::cli::error::HostError;
use crate::cli::terminal;
use crate::fit::FitWarning;
use crate::input::log::{self, LogReading, LogWarning, ReadOptions};
use crate::input::stage::Stage;
use crate::output::posterior_file::PosteriorFileError;
use crate::output::{Outputs, blob_file, check_writable, posterior_file};
use crate::problem::model::Model;
use crate::recalibrate::{Known, RecalibrateError, Recalibration, recalibrate};
use crate::report::errors::Errors;
use crate::report::text;
use crate::solve::field::update::Change;
use clap::builder::PossibleValue;
use clap::{Args, ValueEnum};
use runtime::parameters::Text;
use runtime::{ModelKind, ParameterSet};
use serde::Serialize;
use std::fmt::Write;
use std::path::{Path, PathBuf};

impl ValueEnum for Change {
    fn value_variants<'a>() -> &'a [Self] {
        &[Self::Gain, Self::Gains, Self::All]
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        let help = match self {
            Self::Gain => "One gain for all probes: 2 s of a sine along Y tell it",
            Self::Gains => "A gain for each probe: 2 s of X, Y and Rz moving at once",
            Self::All => {
                "All parameters, as after a probe was seated anew: 8 s of all six axes moving at once"
            }
        };
        Some(PossibleValue::new(self.name()).help(help))
    }
}

/// Arguments of `recalibrate`.
#[derive(Debug, Args)]
pub(super) struct RecalibrateArgs {
    /// The blob to bring up to date: of the field model.
    #[arg(value_name = "old.bin")]
    params: PathBuf,
    /// Logs: CSV or CSV.gz, a few seconds; `-` for standard input.
    #[arg(required = true, value_name = "LOG")]
    logs: Vec<PathBuf>,
    /// The stage as designed.
    #[arg(long, value_name = "stage.toml")]
    stage: PathBuf,
    /// What has changed.
    #[arg(long, value_enum)]
    what: Change,
    /// Where to write the new blob.
    #[arg(long, value_name = "new.bin")]
    out: PathBuf,
    /// Logs without a column for the movement: begin one every so many seconds, not only after gaps
    /// in time.
    #[arg(long, value_name = "SECONDS", value_parser = super::args::movement_seconds)]
    split: Option<f64>,
    #[command(flatten)]
    memory: super::args::Memory,
    /// Creation time, for the blob, as you want it to read; at most 32 bytes.
    #[arg(long, value_name = "TIME", value_parser = super::fit::blob_text)]
    created: Option<Text>,
    /// Write the figures as JSON; `-` for standard output.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// The change of one probe's gain.
#[derive(Serialize)]
struct Gain {
    change_percent: f64,
    standard_error_percent: f64,
}

/// rms errors.
#[derive(Serialize)]
struct Rms {
    x_um: f64,
    y_um: f64,
    rz_urad: f64,
}

/// What is predicted for service over the calibrated range.
#[derive(Serialize)]
struct Service {
    /// With the old blob.
    before: Rms,
    /// With the new one.
    after: Rms,
    /// By the noise of the probes alone.
    floor: Rms,
}

#[derive(Serialize)]
struct Gains {
    a: Gain,
    b: Gain,
    c: Gain,
}

#[derive(Serialize)]
struct Report<'r> {
    what: &'static str,
    rows: usize,
    movements: usize,
    gains: Gains,
    predicted_service: Service,
    /// Whether an old posterior was there, and a new one is.
    posterior: bool,
    /// Over residuals: about 1.
    chi_squared: f64,
    /// Over the log, zero deviations refitted.
    errors: Errors,
    errors_before: Errors,
    serial: &'r str,
    warnings: &'r [String],
}

/// Reads blob, posterior and log, brings the calibration up to date, writes posterior, blob, JSON.
pub(super) fn run(args: &RecalibrateArgs) -> Result<(), HostError> {
    let old_posterior = posterior_file::beside(&args.params);
    let new_posterior = posterior_file::beside(&args.out);
    let mut inputs: Vec<&Path> = vec![&args.params, &args.stage];
    inputs.extend(args.logs.iter().chain(&old_posterior).map(PathBuf::as_path));
    let json = args.json.as_deref();
    let outputs = [Some(args.out.as_path()), new_posterior.as_deref(), json];
    super::keep_apart(&outputs, &inputs)?;
    for path in outputs.into_iter().flatten() {
        check_writable(path)?;
    }
    let old = blob_file::read(&args.params)?;
    let stage = Stage::from_file(&args.stage)?;
    super::same_scales(&old, &stage, &args.stage)?;
    if old.model != ModelKind::Field {
        let model = Model::of(old.model).title();
        return Err(RecalibrateError::OtherModel { model }.into());
    }
    let known = match &old_posterior {
        Some(path) => read_known(path, &old, args)?,
        None => None,
    };
    let options = ReadOptions {
        split_s: args.split,
        memory_bytes: args.memory.limit_bytes(),
        rows_max: ReadOptions::FIT.rows_max,
        ..ReadOptions::default()
    };
    let log = terminal::timed("reading", || {
        log::read_passing(&args.logs, &stage, &options, |_| (), |_, _| ())
    })?;
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
    let mut outputs = Outputs::default();
    if let Some(path) = json {
        let report = report(args.what, &new, &log, &warnings);
        outputs.add(path, super::json(&report)?.as_bytes())?;
    }
    if let (Some(known), Some(path)) = (&new.known, &new_posterior) {
        outputs.add(path, &posterior_file::to_bytes(path, &new.set, known)?)?;
    }
    // The blob last: it is what the stage takes, and a posterior without its blob is refused.
    outputs.add(&args.out, &blob_file::to_bytes(&args.out, &new.set)?)?;
    outputs.commit()?;
    terminal::print(&summary(args.what, &new, &log))?;
    let beside = new_posterior.filter(|_| new.known.is_some());
    super::wrote([Some(args.out.clone()), beside, args.json.clone()])?;
    terminal::warn(&warnings);
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
    let told = |warning: &LogWarning| match warning {
        LogWarning::Excerpt { rows, taken, runs } => format!(
            "{taken} of {rows} rows are used, in {runs} runs spread over all that moves, and errors are over those; a few \
             seconds of log would do"
        ),
        other => other.to_string(),
    };
    let mut warnings: Vec<String> = log.warnings.iter().map(told).collect();
    if new.judgement.undecoded > 0 {
        let undecoded = FitWarning::Undecoded {
            rows: new.judgement.undecoded,
        };
        warnings.push(undecoded.to_string());
    }
    if new.known.is_none() {
        warnings.push(
            "no posterior stands beside the old blob: the predicted errors count those of the gains alone, and the new \
             blob can only have its gains recalibrated"
                .to_owned(),
        );
    }
    warnings
}

/// rms errors, from ratios to the noise floor.
fn rms(new: &Recalibration, ratios: [f64; 3]) -> Rms {
    let [x_um, y_um, rz_urad] = [0, 1, 2].map(|k| new.floor[k] * ratios[k] * 1e6);
    Rms {
        x_um,
        y_um,
        rz_urad,
    }
}

fn report<'r>(
    change: Change,
    new: &'r Recalibration,
    log: &LogReading,
    warnings: &'r [String],
) -> Report<'r> {
    let [a, b, c] = new.gains.map(|(change, error)| Gain {
        change_percent: change * 100.0,
        standard_error_percent: error * 100.0,
    });
    Report {
        what: change.name(),
        rows: log.dataset.rows.len(),
        movements: log.dataset.movements.len(),
        gains: Gains { a, b, c },
        predicted_service: Service {
            before: rms(new, new.before),
            after: rms(new, new.after),
            floor: rms(new, [1.0; 3]),
        },
        posterior: new.known.is_some(),
        chi_squared: new.chi_squared,
        errors: Errors::from(&new.judgement.errors),
        errors_before: Errors::from(&new.judgement_before.errors),
        serial: new.set.serial.as_str(),
        warnings,
    }
}

/// The figures for a terminal.
fn summary(change: Change, new: &Recalibration, log: &LogReading) -> String {
    let mut out = format!(
        "recalibrated: {}, {} rows in {} movements, chi-square {:.2}\n\n  {:<10}{:>12}{:>12}\n",
        change.name(),
        log.dataset.rows.len(),
        log.dataset.movements.len(),
        new.chi_squared,
        "gain",
        "change",
        "std. error"
    );
    for (probe, (change, error)) in ["A", "B", "C"].iter().zip(new.gains) {
        let (change, error) = (change * 100.0, error * 100.0);
        let _ = writeln!(out, "  {probe:<10}{change:>10.4} %{error:>10.4} %");
    }
    let _ = writeln!(
        out,
        "\nerrors predicted for service over the calibrated range, rms\n  {:<10}{:>10}{:>10}{:>12}",
        "", "before", "after", "noise floor"
    );
    for (k, axis) in ["X (um)", "Y (um)", "Rz (urad)"].iter().enumerate() {
        let [before, after, floor] =
            [new.before[k], new.after[k], 1.0].map(|ratio| ratio * new.floor[k] * 1e6);
        let _ = writeln!(out, "  {axis:<10}{before:>10.3}{after:>10.3}{floor:>12.3}");
    }
    let errors = |title: &str, judgement: &crate::judge::Judgement| {
        text::errors(title, &judgement.errors, None)
    };
    out + "\n"
        + &errors(
            "errors over the log before, zero deviations refitted",
            &new.judgement_before,
        )
        + &errors("after", &new.judgement)
}
