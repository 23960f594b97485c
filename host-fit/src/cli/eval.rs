//! `host-fit eval`.

use super::args::{Json, Logs};
use super::report::{Report, finish};
use crate::cli::error::HostError;
use crate::cli::terminal;
use crate::diagnose;
use crate::finding::{self, Severity};
use crate::fit::of_counts;
use crate::input::log::{self, ReadOptions, ReferenceUse};
use crate::judge::statistics::PoseError;
use crate::judge::{Decoded, Judge, Zeros, error};
use crate::output::{Outputs, blob_file};
use crate::problem::model::Model;
use crate::problem::parameters::Parameters;
use crate::report::json::of_eval;
use crate::report::page::Errors;
use crate::report::table::tables;
use crate::report::verdict::{End, Subject};
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
    #[command(flatten)]
    logs: Logs,
    /// Zero deviations; as the blob's model has them if not given: models (12) and (15) have none.
    #[arg(long, value_enum)]
    delta: Option<DeltaChoice>,
    /// Largest rms error, in terms of that of the logs that the blob was fitted to: 3 if not given,
    /// and 10 for models (12) to (31), whose own logs may not show what they lack.
    #[arg(long, value_name = "FACTOR", value_parser = factor)]
    limit: Option<f64>,
    #[command(flatten)]
    report: Report,
    #[command(flatten)]
    json: Json,
}

fn factor(value: &str) -> Result<f64, &'static str> {
    let number = value.parse().ok();
    (number.filter(|factor: &f64| factor.is_finite() && *factor > 0.0))
        .ok_or("a factor above zero is needed")
}

/// The largest error in terms of the blob's own, if that is beyond the limit; the blob of an exact fit
/// has none to compare with.
fn beyond_limit(set: &ParameterSet, errors: &PoseError, limit: f64) -> Option<String> {
    const AXES: [(&str, &str); 3] = [("X", "um"), ("Y", "um"), ("Rz", "urad")];
    let own = |axis: usize| f64::from(set.fit.rms[axis]);
    let ratio = |axis: usize| errors.axes[axis].rms / own(axis);
    let worst = (0..3)
        .filter(|&axis| own(axis) > 0.0)
        .max_by(|&a, &b| ratio(a).total_cmp(&ratio(b)))?;
    let (axis, unit) = AXES[worst];
    (ratio(worst) > limit).then(|| {
        let [error, own] = [errors.axes[worst].rms, own(worst)].map(|x| x * 1e6);
        format!(
            "the parameter blob does not describe this log: {error:.2} {unit} rms in {axis}, where it had {own:.2} {unit} in \
             the logs that it was fitted to, more than {limit} times as much (--limit)"
        )
    })
}

/// Judges a blob on logs with reference.
pub(super) fn run(args: &EvalArgs) -> Result<(), HostError> {
    let started = Instant::now();
    let inputs = [args.params.as_path()]
        .into_iter()
        .chain(args.logs.inputs());
    super::keep_apart_with([args.json.path.as_deref()], &args.report, inputs)?;
    let (set, stage) = super::blob_of_stage(&args.params, &args.logs.stage)?;
    // The reference is needed, and the decoder marks saturated codes.
    let options = args.logs.options(ReadOptions {
        reference: ReferenceUse::Required,
        rows_max: Some(ROWS_MAX),
        ..ReadOptions::DECODE
    });
    let parameters = Parameters::of_set(&set);
    let mut judge = Judge::new(&parameters, &stage, args.logs.paths.len());
    let decoder = set.decoder();
    let log = terminal::timed("reading", || {
        log::read_each(&args.logs.paths, &stage, &options, |log, row| {
            let error = error(&decoder, &row.row);
            judge.take((log, row.movement, row.begins), &row.row, error);
        })
    })?;
    let zeros = match args.delta {
        None => Zeros::of_model(Model::of(set.model)),
        Some(DeltaChoice::Fit) => Zeros::Refit,
        Some(DeltaChoice::Zero) => Zeros::None,
    };
    let judgement = judge.clone().judgement(zeros);
    let mut circumstances = super::circumstances(&log, &stage, started);
    let counts = of_counts(&judgement.zeros, judgement.undecoded);
    circumstances
        .warnings
        .extend(counts.map(|found| found.message));
    let decoded = Decoded::new(&set, &log.dataset);
    let of_sample = decoded.judge(&log.dataset, &stage, zeros);
    let by_row = decoded.errors_less(&of_sample.zeros, &log.dataset);
    circumstances.diagnosis = terminal::timed("diagnosis", || {
        diagnose::of_judged(&log.dataset, &stage, &set, &by_row, None)
    });
    let report = of_eval(&set, &judgement, zeros, &circumstances);
    // As the blob's own errors were counted, whatever --delta says.
    let own_zeros = Zeros::of_model(Model::of(set.model));
    let comparable = judge.judgement(own_zeros).errors;
    let is_field = set.model == ModelKind::Field;
    let limit = args.limit.unwrap_or(if is_field { 3.0 } else { 10.0 });
    let problem = beyond_limit(&set, &comparable, limit);
    let own = set.fit.rms.map(f64::from);
    let subject = Subject {
        end: problem.as_deref().map_or(End::Judged, End::Failed),
        diagnosis: &circumstances.diagnosis,
        is_field,
        errors: Some(&judgement.errors),
        limits: own.map(|rms| (rms > 0.0).then_some(limit * rms)),
        in_service: false,
    };
    let mut hidden = report.hidden();
    hidden.push("trusted_inputs");
    let mut outputs = Outputs::default();
    args.json.add(&mut outputs, &report)?;
    args.report.add(&mut outputs, || {
        let what = ("Verification of a calibration", set.serial.as_str());
        let mut source = args
            .report
            .source(what, &args.logs, (&log, &stage), subject);
        let blob = blob_file::to_bytes(&args.params, &set)?;
        let provenance = &mut source.provenance;
        provenance.add_bytes(&args.params, &blob, "parameter blob, judged");
        source.warnings.clone_from(&report.warnings);
        source.errors = Some(Errors {
            set: &set,
            by_row,
            figures: &of_sample.errors,
            movements: &report.zero_deviations,
            parameters: &report.parameters,
            details: tables(&report, &[&hidden[..], &["errors"]].concat()),
        });
        Ok(source)
    })?;
    finish(
        outputs,
        &tables(&report, &hidden),
        &report.warnings,
        &subject,
    )?;
    let Some(problem) = problem.as_deref() else {
        return Ok(());
    };
    // What the diagnosis found explains more than a remedy; warnings stand above already.
    let found = &report.findings;
    let refusals = finding::messages(found, Severity::Refuse);
    let more = match (refusals.as_str(), found.iter().any(|f| f.severity == Severity::Warn)) {
        ("", true) => String::new(),
        ("", false) if is_field => {
            ". Is it the blob of this stage? If it is, and channels and scales are right, bring it up to date with host-fit recalibrate"
                .to_owned()
        }
        ("", false) => {
            ". If channels and scales are right, take the field model, from a log in which all six axes move at once"
                .to_owned()
        }
        (refusals, _) => format!(". {refusals}"),
    };
    Err(HostError::rejected(format!("{problem}{more}")))
}
