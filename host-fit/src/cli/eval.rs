//! `host-fit eval`.

use crate::cli::error::HostError;
use crate::cli::terminal;
use crate::diagnose;
use crate::diagnose::finding::Severity;
use crate::fit::FitWarning;
use crate::input::log::{self, ReadOptions};
use crate::input::stage::Stage;
use crate::input::whole::chunk::Sample;
use crate::judge::statistics::PoseError;
use crate::judge::whole::Judge;
use crate::judge::{Decoded, Zeros, error};
use crate::output::blob_file;
use crate::problem::model::Model;
use crate::report::errors;
use crate::report::json::of_eval;
use crate::report::text;
use clap::{Args, ValueEnum};
use runtime::{ModelKind, ParameterSet};
use std::path::PathBuf;
use std::time::Instant;

/// The most rows that the diagnosis looks at: three minutes, in less than 64 MB with all else.
const ROWS_MAX: usize = 100_000;

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
    /// Logs: CSV or CSV.gz, one or more; `-` for standard input.
    #[arg(required = true, value_name = "LOG")]
    logs: Vec<PathBuf>,
    /// The stage as designed.
    #[arg(long, value_name = "stage.toml")]
    stage: PathBuf,
    /// Zero deviations; as the blob's model has them if not given: models (12) and (15) have none.
    #[arg(long, value_enum)]
    delta: Option<DeltaChoice>,
    /// Logs without a column for the movement: begin one every so many seconds, not only after gaps
    /// in time.
    #[arg(long, value_name = "SECONDS", value_parser = super::args::movement_seconds)]
    split: Option<f64>,
    #[command(flatten)]
    memory: super::args::Memory,
    /// Largest rms error, in terms of that of the logs that the blob was fitted to: 3 if not given,
    /// and 10 for models (12) to (31), whose own logs may not show what they lack.
    #[arg(long, value_name = "FACTOR", value_parser = factor)]
    limit: Option<f64>,
    /// Write the figures as JSON; `-` for standard output.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

fn factor(value: &str) -> Result<f64, &'static str> {
    let number = value.parse().ok();
    (number.filter(|factor: &f64| factor.is_finite() && *factor > 0.0))
        .ok_or("a factor above zero is needed")
}

/// The largest error in terms of the blob's own, if that is beyond the limit; the blob of an exact fit
/// has none to compare with.
fn beyond_limit(set: &ParameterSet, errors: &PoseError, limit: f64) -> Option<HostError> {
    const AXES: [(&str, &str); 3] = [("X", "um"), ("Y", "um"), ("Rz", "urad")];
    let ratio = |axis: usize| errors.axes[axis].rms / f64::from(set.fit.rms[axis]);
    let worst = (0..3)
        .filter(|&axis| set.fit.rms[axis] > 0.0)
        .max_by(|&a, &b| ratio(a).total_cmp(&ratio(b)))?;
    let (axis, unit) = AXES[worst];
    (ratio(worst) > limit).then(|| HostError::BeyondLimit {
        axis,
        unit,
        error: errors.axes[worst].rms * 1e6,
        own: f64::from(set.fit.rms[worst]) * 1e6,
        limit,
        cause: String::new(),
    })
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
    let options = ReadOptions {
        split_s: args.split,
        memory_bytes: args.memory.limit_bytes(),
        rows_max: Some(ROWS_MAX),
        ..super::EVAL
    };
    let mut judge = Judge::new(&set, &stage, args.logs.len());
    let decoder = set.decoder();
    let log = terminal::timed("reading", || {
        let error = |sample: &Sample| error(&decoder, &sample.frame(), sample.reference);
        log::read_passing(&args.logs, &stage, &options, error, |log, row| {
            let (sample, error) = row.item;
            judge.take(log, row.begins, error, sample.reference);
        })
    })?;
    let zeros = match args.delta {
        None => Zeros::of_model(Model::of(set.model)),
        Some(DeltaChoice::Fit) => Zeros::Refit,
        Some(DeltaChoice::Zero) => Zeros::None,
    };
    let decoded = Decoded::new(&set, &log.dataset);
    let judgement = decoded.judge(&log.dataset, &stage, zeros);
    // Of a long log the rows above are an excerpt, which the diagnosis looks at; errors are those of
    // all rows.
    let judge_whole = |zeros| {
        let whole = judge.judgement(zeros);
        (whole.rows() > log.dataset.rows.len()).then_some(whole)
    };
    let whole = judge_whole(zeros);
    let (undecoded, zeros_taken_off) = match &whole {
        Some(whole) => (whole.undecoded, &whole.zeros),
        None => (judgement.undecoded, &judgement.zeros),
    };
    let mut circumstances = super::circumstances(&log, &stage, started);
    if undecoded > 0 {
        let undecoded = FitWarning::Undecoded { rows: undecoded };
        circumstances.warnings.push(undecoded.to_string());
    }
    let clipped = zeros_taken_off.iter().filter(|zero| zero.clipped).count();
    if clipped > 0 {
        let movements = zeros_taken_off.len();
        circumstances.warnings.push(format!(
            "the zero deviation of {clipped} of {movements} movements was clipped to its range"
        ));
    }
    let errors = decoded.errors_less(&judgement.zeros, &log.dataset);
    circumstances.findings = terminal::timed("diagnosis", || {
        diagnose::of_judged(&log.dataset, &stage, &set, &errors)
    });
    let report = of_eval(
        &set,
        &decoded,
        &judgement,
        whole.as_ref(),
        zeros,
        &circumstances,
    );
    if let Some(path) = &args.json {
        super::write_json(&report, path)?;
    }
    terminal::print(&format!(
        "{}, {} rows in {} movements\n\n{}",
        report.model_title,
        report.rows,
        report.movements,
        text::errors(
            &format!("errors, {}", report.zeros_in_words),
            whole
                .as_ref()
                .map_or(&judgement.errors, |whole| &whole.errors),
            None
        ) + &errors::as_text(&report.logs)
    ))?;
    super::wrote([args.json.clone()])?;
    terminal::warn(&report.warnings);
    // As the blob's own errors were counted, whatever --delta says.
    let own_zeros = Zeros::of_model(Model::of(set.model));
    let comparable = match judge_whole(own_zeros) {
        Some(whole) => whole.errors,
        None => decoded.judge(&log.dataset, &stage, own_zeros).errors,
    };
    let usual = if set.model == ModelKind::Field {
        3.0
    } else {
        10.0
    };
    let mut beyond = beyond_limit(&set, &comparable, args.limit.unwrap_or(usual));
    if let Some(HostError::BeyondLimit { cause, .. }) = &mut beyond {
        let found = diagnose::messages(&report.findings, Severity::Warn);
        let remedy = if set.model == ModelKind::Field {
            "bring the blob up to date with host-fit recalibrate"
        } else {
            "take the field model, from a log in which all six axes move at once"
        };
        *cause = if found.is_empty() {
            format!(". If channels and scales are right, {remedy}")
        } else {
            format!(". {found}")
        };
    } else {
        terminal::tell(&report.findings);
    }
    beyond.map_or(Ok(()), Err)
}
