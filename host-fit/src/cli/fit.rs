//! `host-fit fit`.

use super::args::{BadRowsChoice, FitArgs, Train};
use crate::cli::error::HostError;
use crate::fit::{Fit, FitError, FitSettings, fit};
use crate::input::log;
use crate::input::log::{BadRows, LogReading, ReadOptions};
use crate::input::stage::Stage;
use crate::interrupt;
use crate::judge;
use crate::output;
use crate::output::blob_file;
use crate::problem::parameters::Parameters;
use crate::report::json::{Report, of_fit};
use crate::report::{html, plots, text};
use crate::solve::search_solver::default_size;
use crate::solve::{SolveError, SolverOptions};
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Reads, fits, judges; then writes blob, JSON and report, in this order.
pub fn run(args: &FitArgs) -> Result<(), HostError> {
    let started = Instant::now();
    let inputs: Vec<&Path> = args
        .logs
        .iter()
        .chain([&args.stage])
        .chain(&args.start)
        .map(PathBuf::as_path)
        .collect();
    let outputs = [
        Some(args.out.as_path()),
        args.json.as_deref(),
        args.report.as_deref(),
    ];
    super::keep_apart(&outputs, &inputs)?;
    super::use_threads(args.threads);
    interrupt::watch();
    let stage = Stage::from_file(&args.stage)?;
    let options = ReadOptions {
        bad_rows: match args.bad_rows {
            BadRowsChoice::Refuse => BadRows::Refuse,
            BadRowsChoice::Skip => BadRows::Skip,
        },
        ..ReadOptions::default()
    };
    // Before the work, so that no blob is left without the figures that were asked for.
    output::check_writable(&args.out)?;
    if let Some(path) = &args.json
        && !super::is_standard_output(Some(path))
    {
        output::check_writable(path)?;
    }
    if let Some(folder) = args.report.as_deref().filter(|folder| folder.exists()) {
        output::make_folder(folder)?;
    }
    let log = log::read(&args.logs, &stage, &options)?;
    let known = match &args.start {
        Some(path) => Some(judge::parameters_of(&blob_file::read(path)?)),
        None => None,
    };
    let solver = super::solver(&args.solver, known)?;
    let (population, generations) = default_size(args.project);
    let settings = FitSettings {
        model: args.model.kind(),
        train: match args.train {
            Train::All => None,
            Train::Rows(rows) => Some(rows),
        },
        draw: args.draw,
        solver: SolverOptions {
            projection: args.project,
            seed: args.seed,
            population: args.population.map_or(population, |n| n as usize),
            generations: args.generations.map_or(generations, |n| n as usize),
        },
        serial: args.serial.clone().unwrap_or_default(),
        created: args.created.clone().unwrap_or_default(),
    };
    let fit = match fit(&log.dataset, &stage, solver.as_ref(), &settings) {
        Err(error) if interrupt::requested() => {
            return Err(HostError::Interrupted {
                kept: format!("no parameter blob was written: {error}"),
            });
        }
        // No fit was tried: the arguments do not go together.
        Err(FitError::Solver(error @ SolveError::Unsupported { .. })) => {
            return Err(HostError::Usage {
                argument: "--project",
                problem: error.to_string(),
            });
        }
        result => result?,
    };
    let circumstances = super::circumstances(&log, &stage, started);
    let report = of_fit(
        &fit,
        solver.name(),
        args.project.name(),
        args.seed,
        &circumstances,
    );
    blob_file::write(&args.out, &fit.set)?;
    if let Some(path) = &args.json {
        super::write_json(&report, path)?;
    }
    if let Some(folder) = &args.report {
        let names: Vec<String> = args.logs.iter().map(|p| p.display().to_string()).collect();
        write_report(&report, &fit, &log, &names, folder)?;
    }
    // JSON on standard output is for a program: nothing else goes there.
    if !super::is_standard_output(args.json.as_deref()) {
        super::print(&summary(&fit, &report, &stage))?;
        super::print(&format!("wrote {}\n", args.out.display()))?;
    }
    super::warn(&report.warnings);
    if interrupt::requested() {
        return Err(HostError::Interrupted {
            kept: format!("{} holds the best so far", args.out.display()),
        });
    }
    Ok(())
}

/// The figures of a fit for a terminal.
pub fn summary(fit: &Fit, report: &Report, stage: &Stage) -> String {
    format!(
        "Model ({}), {} rows in {} movements, {} fitted, {} skipped; solver {}: {} evaluations in {:.1} ms, {}\n\
         train fitness {:.4}\n\n{}\n{}",
        report.model,
        report.rows,
        report.movements,
        report.train_rows,
        report.skipped_rows,
        report.solver.as_deref().unwrap_or("-"),
        fit.solution.evaluations,
        fit.solution.elapsed.as_secs_f64() * 1e3,
        fit.solution.stopped,
        fit.train_fitness,
        text::errors(
            &format!("errors over all rows, {}", report.zeros_in_words),
            &fit.judgement.errors,
            None
        ),
        text::parameters(
            &fit.solution.parameters,
            &Parameters::designed(stage),
            &fit.uncertainty.standard_error,
            None
        ),
    )
}

/// Writes `index.html` into a folder, which is made if it is missing.
pub fn write_report(
    report: &Report,
    fit: &Fit,
    log: &LogReading,
    names: &[String],
    folder: &Path,
) -> Result<(), HostError> {
    let mut errors = judge::pose_errors(&*fit.set.decoder(), &log.dataset);
    for (movement, zero) in log.dataset.movements.iter().zip(&fit.judgement.zeros) {
        for error in errors[movement.rows.clone()].iter_mut().flatten() {
            for (error, zero) in error.iter_mut().zip(zero.pose) {
                *error -= zero;
            }
        }
    }
    let plots = [
        (
            "Errors over the log".to_owned(),
            plots::errors_over_rows(report.zeros_in_words, &errors, &log.dataset)?,
        ),
        (
            "Distribution of the errors".to_owned(),
            plots::distribution("errors in units of their rms", &errors)?,
        ),
    ];
    output::make_folder(folder)?;
    let page = html::page(report, names, &plots);
    output::write_atomically(&folder.join("index.html"), page.as_bytes())?;
    Ok(())
}
