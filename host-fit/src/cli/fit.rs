//! `host-fit fit`.

use super::args::{Json, Logs, Threads, blob_text};
use super::arguments::{choice, train};
use super::interrupt;
use super::report::finish;
use crate::calibrate::{FitOrder, Limits, choose_loss};
use crate::cli::error::HostError;
use crate::cli::terminal;
use crate::output::{Outputs, blob_file, posterior_file};
use crate::report::page::Source;
use crate::report::parameters;
use crate::report::result::Report;
use crate::report::verdict::{End, Subject};
use clap::Args;
use hallstage_calibration::fit::{Fit, FitSettings, ModelChoice};
use hallstage_calibration::words;
use hallstage_input::log::{BadRows, LogReading, ReadOptions};
use hallstage_input::stage::Stage;
use hallstage_solver::estimator::draw::Draw;
use hallstage_solver::estimator::robust::Loss;
use hallstage_solver::solve::{Projection, Solver, SolverOptions};
use runtime::parameters::Text;
use std::path::PathBuf;
use std::time::Instant;

/// Arguments of `fit`.
#[derive(Debug, Args)]
pub(super) struct FitArgs {
    #[command(flatten)]
    logs: Logs,
    /// Where to write the parameter blob.
    #[arg(long, value_name = "params.bin")]
    out: PathBuf,
    /// Measurement model.
    #[arg(long, value_name = "MODEL", value_parser = choice::<ModelChoice>(), default_value = "auto")]
    model: ModelChoice,
    /// Solver: `lm` is least squares, the others are the searches of the paper.
    #[arg(long, value_name = "NAME", value_parser = choice::<Solver>(), default_value = Solver::LeastSquares.name())]
    solver: Solver,
    /// How much of the problem is solved in closed form.
    #[arg(long, value_parser = choice::<Projection>(), default_value = "linear")]
    project: Projection,
    /// How much rows count that the model does not explain.
    #[arg(long, value_name = "NAME", value_parser = choice::<Loss>())]
    loss: Option<Loss>,
    /// Rows to fit: `all` or a number.
    #[arg(long, value_name = "N|all", default_value = "all", value_parser = train)]
    train: std::option::Option<usize>,
    /// How rows are drawn.
    #[arg(long, value_parser = choice::<Draw>(), default_value = "stratified")]
    draw: Draw,
    /// Individuals of a search: 100 as in the paper, or 16 with --project linear.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(4..=100_000))]
    population: Option<u32>,
    /// Generations of a search: 100 as in the paper; with --project linear at most 1000,
    /// fewer once the fitness hardly falls any more.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=10_000_000))]
    generations: Option<u32>,
    /// Seed of everything random.
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    #[command(flatten)]
    pub(super) threads: Threads,
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
    super::check_outputs(outputs, Some(&args.report), args.logs.inputs())?;
    let loss = choose_loss(args.loss, args.model, args.solver, args.project);
    let loss = loss.map_err(HostError::from_mismatch)?;
    interrupt::watch();
    let stage = args.logs.stage.read()?;
    let log = args.logs.read(
        &stage,
        ReadOptions {
            bad_rows: args.bad_rows,
            ..ReadOptions::FIT
        },
    )?;
    let order = FitOrder {
        settings: settings(args, loss),
        limits: args.limit.unwrap_or_default(),
        is_kept: true,
    };
    let fitted = terminal::timed("fit", || order.fit(&log, &stage));
    let fitted = fitted.map_err(HostError::from_calibrate)?;
    let outcome = terminal::timed("diagnosis", || order.judge(fitted, &log, &stage));
    let outcome = outcome.map_err(HostError::from_calibrate)?;
    let of_log = (&log, &stage);
    let report = outcome.report(&order, of_log, started.elapsed().as_secs_f64());
    let mut outputs = Outputs::default();
    match &report {
        None => {
            args.json.add(&mut outputs, &outcome.checked(&log))?;
        }
        Some(report) => args.json.add(&mut outputs, report)?,
    }
    let found = outcome.fitted.as_ref().ok().zip(report.as_ref());
    let subject = outcome.subject();
    args.report
        .add(&mut outputs, || source(args, of_log, subject, found))?;
    let warnings = words::messages(&log.warnings);
    let (Some((fit, report)), true) = (found, outcome.has_blob) else {
        finish(outputs, &[], &warnings, &subject)?;
        let cause = outcome.refusal_message().unwrap_or_default();
        let force = match &outcome.fitted {
            Ok(_) => "; --force writes one that says so",
            Err(_) => "",
        };
        let cause = format!("{cause} No parameter blob was written{force}.");
        return Err(HostError::rejected(cause));
    };
    if let Some(cause) = outcome.refusal_message() {
        terminal::warn(&[format!("written all the same, as --force asks: {cause}")]);
    }
    let known = outcome.known();
    posterior_file::add_calibration(&mut outputs, &args.out, &fit.set, known.as_ref())?;
    let designed = [("designed", parameters::designed(&stage))];
    let mut details = report.figures.tables();
    details.splice(1..1, parameters::tables(&report.parameters, &designed));
    finish(outputs, &details, &warnings, &subject)?;
    match interrupt::is_requested() {
        true => Err(HostError::interrupted(format!(
            "{} holds the best so far",
            args.out.display()
        ))),
        false => Ok(()),
    }
}

/// How the fit is made, by the arguments.
fn settings(args: &FitArgs, loss: Loss) -> FitSettings {
    let usual = SolverOptions::new(args.project, args.seed);
    let options = SolverOptions {
        population: args.population.map_or(usual.population, |n| n as usize),
        generations: args.generations.map_or(usual.generations, |n| n as usize),
        watch: interrupt::watch(),
        ..usual
    };
    FitSettings {
        model: args.model,
        train: args.train,
        draw: args.draw,
        solver: args.solver,
        loss,
        options,
        serial: args.serial.clone().unwrap_or_default(),
        created: args.report.created.clone().unwrap_or_default(),
        force: args.force,
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
    if let (Some((fit, _)), End::Written | End::Interrupted) = (fit, subject.end) {
        let blob = blob_file::to_bytes(&args.out, &fit.set)?;
        let provenance = &mut source.provenance;
        provenance.add_bytes(&args.out, &blob, "parameter blob, written");
    }
    source.report = fit.map(|(_, report)| report);
    Ok(source)
}
