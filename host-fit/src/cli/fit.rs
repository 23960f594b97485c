//! `host-fit fit`.

use self::told::{add_report, summary};
use super::args::Train;
use super::check::Checked;
use super::limit::Limits;
use crate::cli::error::HostError;
use crate::cli::terminal;
use crate::diagnose;
use crate::diagnose::finding::{Finding, Severity};
use crate::diagnose::of_fit;
use crate::fit::{Fit, FitError, FitSettings, ModelChoice, cross_validate, fit, fit_compensated};
use crate::input::log;
use crate::input::log::{BadRows, LogReading, ReadOptions};
use crate::input::stage::Stage;
use crate::interrupt;
use crate::output;
use crate::output::{Outputs, blob_file, posterior_file};
use crate::problem::draw::Draw;
use crate::problem::model::MODELS;
use crate::problem::parameters::Parameters;
use crate::recalibrate::Known;
use crate::report;
use crate::report::json::{Choice, Circumstances, of_fit};
use crate::report::verdict::End;
use crate::solve::robust::Loss;
use crate::solve::{Projection, SolveError, Solver, SolverOptions};
use clap::Args;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use runtime::ModelKind;
use runtime::parameters::Text;
use std::path::{Path, PathBuf};
use std::time::Instant;

mod told;

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

pub(super) fn blob_text(value: &str) -> Result<Text, &'static str> {
    Text::try_from(value).map_err(|_| "at most 32 bytes fit in the blob")
}

/// Arguments of `fit`.
#[derive(Debug, Args)]
pub(super) struct FitArgs {
    /// Logs: CSV or CSV.gz, one or more; `-` for standard input.
    #[arg(required = true, value_name = "LOG")]
    logs: Vec<PathBuf>,
    /// The stage as designed.
    #[arg(long, value_name = "stage.toml")]
    stage: PathBuf,
    /// Where to write the parameter blob.
    #[arg(long, value_name = "params.bin")]
    out: PathBuf,
    /// Measurement model.
    #[arg(long, value_name = "MODEL", value_parser = models(), default_value = "auto")]
    model: ModelChoice,
    /// Solver. The default searches by SHTLBO and finishes by least squares, `lm` is least squares
    /// alone, the others search only.
    #[arg(long, value_name = "NAME", value_enum, default_value = Solver::Finished.name())]
    solver: Solver,
    /// How much of the problem is solved in closed form.
    #[arg(long, value_enum, default_value = "linear")]
    project: Projection,
    /// How much rows count that the model does not explain.
    #[arg(long, value_name = "NAME", value_enum)]
    loss: Option<Loss>,
    /// Rows to fit: `all` or a number.
    #[arg(long, value_name = "N|all", default_value = "all")]
    train: Train,
    /// How rows are drawn.
    #[arg(long, value_enum, default_value = "stratified")]
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
    /// Threads; all cores if not given. The result does not depend on it.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub(super) threads: Option<u16>,
    /// Take the lag of the reference off, as the fit finds it.
    #[arg(long)]
    compensate_lag: bool,
    /// Tell the errors on rows left out as well: five more fits.
    #[arg(long)]
    cross_validate: bool,
    /// Serial number of the stage, for the blob; at most 32 bytes.
    #[arg(long, value_name = "TEXT", value_parser = blob_text)]
    serial: Option<Text>,
    /// Creation time, for the blob, as you want it to read; at most 32 bytes.
    #[arg(long, value_name = "TIME", value_parser = blob_text)]
    created: Option<Text>,
    /// What to do with rows that cannot be used.
    #[arg(long, value_enum, default_value = "refuse")]
    bad_rows: BadRows,
    /// Logs without a column for the movement: begin one every so many seconds, not only after gaps
    /// in time.
    #[arg(long, value_name = "SECONDS", value_parser = super::args::movement_seconds)]
    split: Option<f64>,
    #[command(flatten)]
    memory: super::args::Memory,
    /// Largest rms errors over all rows; beyond, no blob is written.
    #[arg(long, value_name = "x=1.5um,...")]
    limit: Option<Limits>,
    /// Write the blob of a log that is refused, or of a fit beyond --limit; the blob says so.
    #[arg(long)]
    force: bool,
    /// Write a report with plots into this folder.
    #[arg(long, value_name = "DIR")]
    report: Option<PathBuf>,
    /// Write the figures as JSON; `-` for standard output.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// Reads, fits, judges; then writes blob, JSON and report, in this order.
pub(super) fn run(args: &FitArgs) -> Result<(), HostError> {
    let started = Instant::now();
    let inputs: Vec<&Path> = args
        .logs
        .iter()
        .chain([&args.stage])
        .chain(&args.start)
        .map(PathBuf::as_path)
        .collect();
    let posterior = posterior_file::beside(&args.out);
    let page = args.report.as_deref().map(report::page_in);
    let outputs = [
        Some(args.out.as_path()),
        posterior.as_deref(),
        args.json.as_deref(),
        page.as_deref(),
    ];
    super::keep_apart(&outputs, &inputs)?;
    check_field_arguments(args)?;
    check_loss(args)?;
    interrupt::watch();
    let stage = Stage::from_file(&args.stage)?;
    let options = ReadOptions {
        bad_rows: args.bad_rows,
        split_s: args.split,
        memory_bytes: args.memory.limit_bytes(),
        // With the lag taken off all rows are other rows.
        rows_max: ReadOptions::FIT.rows_max.filter(|_| !args.compensate_lag),
        ..ReadOptions::FIT
    };
    // Before the work, so that no blob is left without the figures that were asked for.
    output::check_writable(&args.out)?;
    if let Some(path) = &args.json {
        output::check_writable(path)?;
    }
    if let Some(folder) = args.report.as_deref().filter(|folder| folder.exists()) {
        output::make_folder(folder)?;
    }
    let mut log = terminal::timed("reading", || log::read(&args.logs, &stage, &options))?;
    let known = match &args.start {
        Some(path) => Some(Parameters::of_set(&blob_file::read(path)?)),
        None => None,
    };
    let mut options = SolverOptions::new(args.project, args.seed);
    options.population = args.population.map_or(options.population, |n| n as usize);
    options.generations = args.generations.map_or(options.generations, |n| n as usize);
    options.known = known;
    options.interrupt = Some(interrupt::watch());
    let settings = FitSettings {
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
        created: args.created.clone().unwrap_or_default(),
        force: args.force,
    };
    let fitted = terminal::timed("fit", || {
        if args.compensate_lag {
            fit_compensated(&log.dataset, &stage, &settings).map(|(fit, compensated)| {
                log.dataset = compensated;
                fit
            })
        } else {
            fit(&log.dataset, &stage, &settings)
        }
    });
    let is_interrupted = interrupt::requested();
    if let (Err(error), true) = (&fitted, is_interrupted) {
        return Err(HostError::Interrupted {
            kept: format!("nothing was written: {error}"),
        });
    }
    let findings = terminal::timed("diagnosis", || {
        diagnose::of_log(&log.dataset, &stage, fitted.as_ref())
    });
    let mut fit = match fitted {
        // No fit was tried: the arguments do not go together.
        Err(FitError::Solver(error @ SolveError::Unsupported { .. })) => {
            return Err(HostError::Usage {
                argument: "--project",
                problem: error.to_string(),
            });
        }
        Err(error) => {
            let mut outputs = Outputs::default();
            if let Some(path) = &args.json {
                let checked = Checked::new(&log, Err(&error), findings.clone());
                outputs.add(path, super::json(&checked)?.as_bytes())?;
            }
            let ended = super::check::failed(error, &findings);
            let why = match (&ended, findings.first()) {
                (HostError::Refused { .. }, Some(gravest)) => {
                    diagnose::messages(&findings, gravest.severity)
                }
                (HostError::Fit(error) | HostError::FitDiagnosed { error, .. }, _) => {
                    error.to_string()
                }
                _ => ended.to_string(),
            };
            let end = (End::Failed(&why), &[][..]);
            add_report(&mut outputs, args, (&log, &stage), &findings, None, end)?;
            outputs.commit()?;
            return Err(ended);
        }
        Ok(fit) => fit,
    };
    let unfinished = || is_interrupted.then(|| unfinished(&fit, &log)).flatten();
    let refusal = refusal(&fit, &findings, args.limit.as_ref()).or_else(unfinished);
    if let (Some(cause), true, false) = (&refusal, is_interrupted, args.force) {
        return Err(HostError::Interrupted {
            kept: format!("nothing was written: {cause}. --force writes it all the same"),
        });
    }
    fit.set.fit.forced = refusal.is_some();
    let circumstances = Circumstances {
        findings,
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
    let mut report = of_fit(&fit, choice, &circumstances);
    if args.cross_validate && refusal.is_none() {
        match cross_validate(&fit, &log.dataset, &stage, &settings) {
            Ok(found) => report.cross_validation = Some((&found).into()),
            Err(error) => {
                let told = format!("no cross-validation: without a fifth of the rows, {error}");
                terminal::warn(std::slice::from_ref(&told));
                report.warnings.push(told);
            }
        }
    }
    let mut outputs = Outputs::default();
    if let Some(path) = &args.json {
        outputs.add(path, super::json(&report)?.as_bytes())?;
    }
    let found = Some((&fit, &report));
    match refusal {
        Some(cause) if args.force => {
            terminal::warn(&[format!("written all the same, as --force asks: {cause}")]);
        }
        Some(cause) => {
            let end = (End::Failed(&cause), &[][..]);
            let findings = &report.findings;
            add_report(&mut outputs, args, (&log, &stage), findings, found, end)?;
            outputs.commit()?;
            terminal::tell(&report.findings);
            return Err(HostError::NotWritten { cause });
        }
        None => {}
    }
    let end = match interrupt::requested() {
        true => End::Interrupted,
        false => End::Written,
    };
    let blob = blob_file::to_bytes(&args.out, &fit.set)?;
    let findings = &report.findings;
    add_report(
        &mut outputs,
        args,
        (&log, &stage),
        findings,
        found,
        (end, &blob),
    )?;
    if let (Some(field), Some(path)) = (&fit.field, &posterior) {
        let known = posterior_file::to_bytes(path, &fit.set, &Known::of_fit(field))?;
        outputs.add(path, &known)?;
    }
    // The blob last: it is what the stage takes.
    outputs.add(&args.out, &blob)?;
    outputs.commit()?;
    terminal::print(&summary(&fit, &report, &stage))?;
    let page = args.report.as_deref().map(report::page_in);
    let beside = posterior.filter(|_| fit.field.is_some());
    super::wrote([Some(args.out.clone()), beside, args.json.clone(), page])?;
    terminal::warn(&circumstances.warnings);
    terminal::tell(&report.findings);
    if interrupt::requested() {
        return Err(HostError::Interrupted {
            kept: format!("{} holds the best so far", args.out.display()),
        });
    }
    Ok(())
}

/// Why a fit is not to be written.
fn refusal(fit: &Fit, findings: &[Finding], limits: Option<&Limits>) -> Option<String> {
    let refused = diagnose::messages(findings, Severity::Refuse);
    if refused.is_empty() {
        return limits?.exceeded(fit.errors());
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

/// Only least squares has weights.
fn check_loss(args: &FitArgs) -> Result<(), HostError> {
    match (args.solver, args.loss) {
        (Solver::Search(_), Some(Loss::Huber | Loss::Cauchy)) => Err(HostError::Usage {
            argument: "--loss",
            problem: format!(
                "a search alone counts all rows alike: leave --solver {} out, or take --loss none",
                args.solver.name()
            ),
        }),
        _ => Ok(()),
    }
}

/// The field model has one way to be fitted.
fn check_field_arguments(args: &FitArgs) -> Result<(), HostError> {
    let refused = |argument, problem: &str| {
        Err(HostError::Usage {
            argument,
            problem: problem.to_owned(),
        })
    };
    if !matches!(args.model, ModelChoice::Named(model) if model.kind == ModelKind::Field) {
        return Ok(());
    }
    if args.solver != Solver::Finished {
        return refused(
            "--solver",
            "--model field has a solver of its own; leave --solver out",
        );
    }
    if args.project != Projection::Linear {
        return refused(
            "--project",
            "--model field has a projection of its own; leave --project out",
        );
    }
    Ok(())
}
