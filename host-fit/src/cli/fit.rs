//! `host-fit fit`.

use super::args::{Json, Logs, Threads, Train, blob_text, choice};
use super::check::{checked, failed};
use super::limit::Limits;
use super::report::finish;
use crate::cli::error::HostError;
use crate::cli::terminal;
use crate::diagnose;
use crate::diagnose::of_fit;
use crate::finding::{self, Finding, Severity};
use crate::fit::{
    Fit, FitError, FitSettings, ModelChoice, cross_validate, fit_compensated, fit_log,
};
use crate::input::log::{BadRows, LogReading, ReadOptions};
use crate::input::stage::Stage;
use crate::interrupt;
use crate::output::{Outputs, blob_file, posterior_file};
use crate::problem::draw::Draw;
use crate::problem::model::MODELS;
use crate::problem::parameters::Parameters;
use crate::recalibrate::Known;
use crate::report::json::{Choice, Circumstances, Report, of_cross_validation, of_fit};
use crate::report::page::{Errors, Source};
use crate::report::parameters;
use crate::report::table::tables;
use crate::report::verdict::{End, Subject};
use crate::solve::robust::Loss;
use crate::solve::{Projection, SolveError, Solver, SolverOptions};
use clap::Args;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use runtime::ModelKind;
use runtime::parameters::Text;
use std::path::PathBuf;
use std::time::Instant;

/// The models on the command line, `auto` and those of the table.
fn models() -> impl TypedValueParser<Value = ModelChoice> {
    let auto =
        PossibleValue::new("auto").help("The field model where the log can carry it, else 31");
    let named = MODELS
        .iter()
        .map(|model| PossibleValue::new(model.name).help(model.summary));
    let names: Vec<PossibleValue> = [auto].into_iter().chain(named).collect();
    PossibleValuesParser::new(names).map(|name| {
        let named = MODELS.iter().find(|model| model.name == name);
        named.map_or(ModelChoice::Auto, ModelChoice::Named)
    })
}

/// Arguments of `fit`.
#[derive(Debug, Args)]
pub(super) struct FitArgs {
    #[command(flatten)]
    logs: Logs,
    /// Where to write the parameter blob.
    #[arg(long, value_name = "params.bin")]
    out: PathBuf,
    /// Measurement model.
    #[arg(long, value_name = "MODEL", value_parser = models(), default_value = "auto")]
    model: ModelChoice,
    /// Solver. The default searches by SHTLBO and finishes by least squares, `lm` is least squares
    /// alone, the others search only.
    #[arg(long, value_name = "NAME", value_parser = choice::<Solver>(), default_value = Solver::Finished.name())]
    solver: Solver,
    /// How much of the problem is solved in closed form.
    #[arg(long, value_parser = choice::<Projection>(), default_value = "linear")]
    project: Projection,
    /// How much rows count that the model does not explain.
    #[arg(long, value_name = "NAME", value_parser = choice::<Loss>())]
    loss: Option<Loss>,
    /// Rows to fit: `all` or a number.
    #[arg(long, value_name = "N|all", default_value = "all")]
    train: Train,
    /// How rows are drawn.
    #[arg(long, value_parser = choice::<Draw>(), default_value = "stratified")]
    draw: Draw,
    /// Individuals of a population: 100 as in the paper, or 16 with --project linear.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(4..=100_000))]
    population: Option<u32>,
    /// Generations of a population: 100 as in the paper; with --project linear at most 1000,
    /// fewer once the fitness hardly falls any more.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=10_000_000))]
    generations: Option<u32>,
    /// Seed of everything random.
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Warm start: a search begins with the parameters of this blob among its population.
    #[arg(long, value_name = "params.bin")]
    start: Option<PathBuf>,
    #[command(flatten)]
    pub(super) threads: Threads,
    /// Take the lag of the reference off, as the fit finds it.
    #[arg(long)]
    compensate_lag: bool,
    /// Also report the errors on rows left out: five more fits.
    #[arg(long)]
    cross_validate: bool,
    /// Serial number of the stage, for the blob; at most 32 bytes.
    #[arg(long, value_name = "TEXT", value_parser = blob_text)]
    serial: Option<Text>,
    /// What to do with rows that cannot be used.
    #[arg(long, value_parser = choice::<BadRows>(), default_value = "refuse")]
    bad_rows: BadRows,
    /// Largest rms errors, of the field model in service, of others over all rows; beyond, no blob is
    /// written.
    #[arg(long, value_name = "x=1.5um,...")]
    limit: Option<Limits>,
    /// Write the blob of a log that is refused, or of a fit beyond --limit; the blob says so.
    #[arg(long)]
    force: bool,
    #[command(flatten)]
    report: super::report::Report,
    #[command(flatten)]
    json: Json,
}

/// Reads, fits, judges; then writes JSON, report and blob, in this order.
pub(super) fn run(args: &FitArgs) -> Result<(), HostError> {
    let started = Instant::now();
    let posterior = posterior_file::beside(&args.out);
    let outputs = [Some(&args.out), posterior.as_ref(), args.json.path.as_ref()];
    let outputs = outputs.map(|path| path.map(PathBuf::as_path));
    let inputs = args.logs.inputs().chain(args.start.as_deref());
    super::keep_apart_with(outputs, &args.report, inputs)?;
    check_arguments(args)?;
    interrupt::watch();
    let stage = args.logs.stage.read()?;
    let mut log = args.logs.read(
        &stage,
        ReadOptions {
            bad_rows: args.bad_rows,
            // With the lag taken off all rows are other rows.
            rows_max: ReadOptions::FIT.rows_max.filter(|_| !args.compensate_lag),
            ..ReadOptions::FIT
        },
    )?;
    let settings = settings(args)?;
    let mut fitted = terminal::timed("fit", || {
        if args.compensate_lag {
            let found = fit_compensated(&log.dataset, &stage, &settings);
            Ok(found.map(|(fit, compensated)| {
                log.dataset = compensated;
                fit
            }))
        } else {
            fit_log(&log, &stage, &settings)
        }
    })?;
    let is_interrupted = interrupt::requested();
    match &fitted {
        // No fit was tried: the arguments do not go together.
        Err(FitError::Solver(error @ SolveError::Unsupported { .. })) => {
            return Err(HostError::usage("--project", error));
        }
        Err(error) if is_interrupted => {
            let kept = format!("nothing was written: {error}");
            return Err(HostError::interrupted(kept));
        }
        _ => {}
    }
    let diagnosis = terminal::timed("diagnosis", || {
        diagnose::of_log(&log.dataset, &stage, fitted.as_ref())
    });
    if let Some(repair) = &diagnosis.repair {
        fitted = match fitted {
            Ok(fit) => fit.repaired(&log, &stage, repair)?,
            failed => failed,
        };
    }
    let findings = &diagnosis.findings;
    // The field model is made for service, other models for movements like those of the log.
    let is_field = fitted.as_ref().is_ok_and(|fit| fit.field.is_some());
    let in_service = diagnosis
        .predicted
        .map(|predicted| predicted.rms)
        .filter(|_| is_field);
    let refusal = match &fitted {
        Err(error) => Some(failed(error, findings).to_string()),
        Ok(fit) => refusal(
            findings,
            in_service.map_or_else(
                || (fit.all.errors.axes.map(|axis| axis.rms), "on the log"),
                |rms| (rms, "in service"),
            ),
            args.limit.as_ref(),
        )
        .or_else(|| unfinished(fit, &log).filter(|_| is_interrupted)),
    };
    let has_blob = fitted.is_ok() && (refusal.is_none() || args.force);
    if let (Some(cause), true, false) = (&refusal, is_interrupted, has_blob) {
        let kept = format!("nothing was written: {cause}. --force writes it all the same");
        return Err(HostError::interrupted(kept));
    }
    let mut outputs = Outputs::default();
    let report = match &mut fitted {
        Err(error) => {
            let checked = checked(&log, Err(error), &diagnosis);
            args.json.add(&mut outputs, &checked)?;
            None
        }
        Ok(fit) => {
            fit.set.fit.forced = refusal.is_some();
            let circumstances = Circumstances {
                diagnosis: diagnosis.clone(),
                ..super::circumstances(&log, &stage, started)
            };
            let (solver, project) = match fit.field {
                Some(_) => (Solver::LeastSquares, Projection::Linear),
                None => (args.solver, args.project),
            };
            let choice = Choice {
                solver: solver.name(),
                project: project.name(),
                seed: args.seed,
                lag_compensated: args.compensate_lag,
            };
            let mut report = of_fit(fit, choice, &circumstances);
            if args.cross_validate && refusal.is_none() {
                match cross_validate(fit, &log.dataset, &stage, &settings) {
                    Ok(found) => report.of_fit["cross_validation"] = of_cross_validation(&found),
                    Err(error) => {
                        let warning =
                            format!("no cross-validation: without a fifth of the rows, {error}");
                        terminal::warn(std::slice::from_ref(&warning));
                        report.warnings.push(warning);
                    }
                }
            }
            args.json.add(&mut outputs, &report)?;
            Some(report)
        }
    };
    let found = fitted.as_ref().ok().zip(report.as_ref());
    let end = match &refusal {
        Some(cause) if !has_blob => End::Failed(cause),
        _ if interrupt::requested() => End::Interrupted,
        _ => End::Written,
    };
    let subject = Subject {
        end,
        diagnosis: &diagnosis,
        is_field,
        errors: found.map(|(fit, _)| &fit.all.errors),
        limits: args.limit.unwrap_or_default().0,
        in_service: in_service.is_some(),
    };
    let source = || source(args, (&log, &stage), subject, found);
    args.report.add(&mut outputs, source)?;
    let warnings = super::warnings_of(&log);
    let (Some((fit, report)), true) = (found, has_blob) else {
        finish(outputs, &[], &warnings, &subject)?;
        return Err(match (fitted, refusal) {
            (Ok(_), Some(cause)) => HostError::rejected(format!(
                "{cause}. No parameter blob was written; --force writes one that says so"
            )),
            (_, cause) => HostError::rejected(cause.unwrap_or_default()),
        });
    };
    if let Some(cause) = &refusal {
        terminal::warn(&[format!("written all the same, as --force asks: {cause}")]);
    }
    let repaired = diagnosis
        .repair
        .as_ref()
        .map(|repair| repair.faults.clone());
    let known = fit.field.as_ref().map(|field| Known {
        repaired: repaired.unwrap_or_default(),
        ..Known::of_fit(field)
    });
    posterior_file::add_calibration(&mut outputs, &args.out, &fit.set, known.as_ref())?;
    let designed = [("designed", parameters::designed(&stage))];
    let mut details = tables(&report, &report.hidden());
    details.splice(1..1, parameters::tables(&report.parameters, &designed));
    finish(outputs, &details, &warnings, &subject)?;
    match interrupt::requested() {
        true => Err(HostError::interrupted(format!(
            "{} holds the best so far",
            args.out.display()
        ))),
        false => Ok(()),
    }
}

/// How the fit is made, by the arguments.
fn settings(args: &FitArgs) -> Result<FitSettings, HostError> {
    let start = args.start.as_deref().map(blob_file::read).transpose()?;
    let usual = SolverOptions::new(args.project, args.seed);
    let options = SolverOptions {
        population: args.population.map_or(usual.population, |n| n as usize),
        generations: args.generations.map_or(usual.generations, |n| n as usize),
        known: start.as_ref().map(Parameters::of_set),
        interrupt: Some(interrupt::watch()),
        ..usual
    };
    Ok(FitSettings {
        model: args.model,
        train: args.train.0,
        draw: args.draw,
        solver: args.solver,
        loss: args.loss.unwrap_or(match args.solver {
            Solver::Search(_) => Loss::None,
            Solver::Finished | Solver::LeastSquares => Loss::Cauchy,
        }),
        options,
        serial: args.serial.clone().unwrap_or_default(),
        created: args.report.created.clone().unwrap_or_default(),
        force: args.force,
    })
}

/// Why a fit is not to be written.
fn refusal(
    findings: &[Finding],
    (rms, which): ([f64; 3], &str),
    limits: Option<&Limits>,
) -> Option<String> {
    let refused = finding::messages(findings, Severity::Refuse);
    if refused.is_empty() {
        return limits?.exceeded(rms, which);
    }
    Some(format!("the log is refused: {refused}"))
}

/// Why a search that was interrupted is not to be written: a finished one leaves little but noise.
fn unfinished(fit: &Fit, log: &LogReading) -> Option<String> {
    let found = of_fit::unexplained(fit, &log.dataset)?;
    let (rms, unit) = (found.value?, found.unit?);
    Some(format!(
        "the best so far has errors of {rms:.1} {unit} rms, more than {} times the noise from sample to sample: let it run longer",
        of_fit::ERROR_TO_NOISE_MAX
    ))
}

/// Only least squares has weights, and the field model has one way to be fitted.
fn check_arguments(args: &FitArgs) -> Result<(), HostError> {
    let is_field =
        matches!(args.model, ModelChoice::Named(model) if model.kind == ModelKind::Field);
    let refused = |argument, problem: String| Err(HostError::usage(argument, problem));
    match (args.solver, args.loss) {
        (Solver::Search(_), Some(Loss::Huber | Loss::Cauchy)) => refused(
            "--loss",
            format!(
                "a search alone counts all rows alike: leave --solver {} out, or take --loss none",
                args.solver.name()
            ),
        ),
        (solver, _) if is_field && solver != Solver::Finished => refused(
            "--solver",
            "--model field has a solver of its own; leave --solver out".to_owned(),
        ),
        _ if is_field && args.project != Projection::Linear => refused(
            "--project",
            "--model field has a projection of its own; leave --project out".to_owned(),
        ),
        _ => Ok(()),
    }
}

/// What the report says of a fit with its figures, or of a log that has none.
fn source<'a>(
    args: &FitArgs,
    (log, stage): (&'a LogReading, &'a Stage),
    subject: Subject<'a>,
    fit: Option<(&'a Fit, &'a Report)>,
) -> Result<Source<'a>, HostError> {
    let serial = args.serial.as_deref().unwrap_or_default();
    let what = ("Calibration certificate", serial);
    let mut source = args.report.source(what, &args.logs, (log, stage), subject);
    if let Some(start) = &args.start {
        source
            .provenance
            .add_file(start, "parameters to start from");
    }
    if let (Some((fit, _)), End::Written | End::Interrupted) = (fit, subject.end) {
        let blob = blob_file::to_bytes(&args.out, &fit.set)?;
        let provenance = &mut source.provenance;
        provenance.add_bytes(&args.out, &blob, "parameter blob, written");
    }
    source.errors = fit.map(|(fit, report)| {
        let details = tables(report, &[&report.hidden()[..], &["errors"]].concat());
        Errors::of_fit(fit, &log.dataset, report, details)
    });
    Ok(source)
}
