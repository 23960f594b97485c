//! The commands: arguments, one file a command, and nothing that the library could do.

pub mod args;
mod compare;
mod decode;
mod demo;
mod error;
mod eval;
pub mod export;
mod fit;
mod inspect;

use crate::bus::import::ImportArgs;
use crate::bus::live::LiveArgs;
use crate::bus::replay::ReplayArgs;
use crate::cli::error::HostError;
use crate::input::log::{LogReading, ReadOptions, ReferenceUse};
use crate::input::stage::Stage;
use crate::interrupt;
use crate::output::write_atomically;
use crate::report::json::Circumstances;
use crate::solve::Solver;
use args::{Cli, Command};
use clap::Parser;
use runtime::ParameterSet;
use std::io::{ErrorKind, Write};
use std::path::Path;
use std::process::ExitCode;
use std::time::Instant;

/// Names of the solvers, the default first.
pub fn solver_names() -> Vec<&'static str> {
    Solver::all().map(Solver::name).collect()
}

/// How `eval` reads: it needs the reference, and the decoder marks saturated codes.
const EVAL: ReadOptions = ReadOptions {
    reference: ReferenceUse::Required,
    ..ReadOptions::DECODE
};

/// Parses the command line, runs the command, prints an error if there is one.
pub fn main() -> ExitCode {
    let cli = Cli::parse();
    let result = match &cli.command {
        Command::Demo(args) => demo::run(args),
        Command::Fit(args) => fit::run(args),
        Command::Eval(args) => eval::run(args),
        Command::Decode(args) => decode::run(args),
        Command::Inspect(args) => inspect::run(args),
        Command::Live(args) => live(args),
        Command::Replay(args) => replay(args),
        Command::Export(args) => export::run(args),
        Command::Compare(args) => compare::run(args),
        Command::Import(args) => import(args),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            let _ = writeln!(std::io::stderr(), "host-fit: {error}");
            ExitCode::from(error.exit_status())
        }
    }
}

/// Decodes a bus. The record is made anew, so it must not be the blob.
fn live(args: &LiveArgs) -> Result<(), HostError> {
    keep_apart(&[args.record.as_deref()], &[&args.params])?;
    Ok(crate::bus::live::run(args)?)
}

/// Plays a log onto a bus and says how it went.
fn replay(args: &ReplayArgs) -> Result<(), HostError> {
    let done = crate::bus::replay::run(args)?;
    print(&format!(
        "{} rows in {} frames, {:.3} s of the log in {:.3} s ({:.1} times real time), at most {:.1} ms late\n",
        done.rows,
        done.frames,
        done.logged_s,
        done.elapsed_s,
        done.logged_s / done.elapsed_s,
        done.late_max_s * 1e3
    ))?;
    if interrupt::requested() {
        return Err(HostError::Interrupted {
            kept: "the rows above were sent, the rest of the log was not".to_owned(),
        });
    }
    Ok(())
}

/// Joins a record of the bus and a reference, and says how it went.
fn import(args: &ImportArgs) -> Result<(), HostError> {
    keep_apart(
        &[Some(&args.out)],
        &[&args.bus, &args.reference, &args.stage],
    )?;
    let report = crate::bus::import::run(args)?;
    print(&format!("{report}wrote {}\n", args.out.display()))
}

/// Writes to standard output. A reader that has gone away, as `head` does, is no error.
fn print(text: &str) -> Result<(), HostError> {
    let mut out = std::io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => Err(HostError::Standard(error)),
        _ => Ok(()),
    }
}

/// Writes warnings to standard error.
fn warn(warnings: &[String]) {
    for warning in warnings {
        // Nobody is left to tell when standard error is gone.
        let _ = writeln!(std::io::stderr(), "warning: {warning}");
    }
}

/// Whether a report goes to standard output, where nothing else may then be written.
fn is_standard_output(path: Option<&Path>) -> bool {
    path.is_some_and(|path| path.as_os_str() == "-")
}

/// Writes a report as JSON to a file, or to standard output for `-`.
fn write_json(report: &impl serde::Serialize, path: &Path) -> Result<(), HostError> {
    let mut text = serde_json::to_string_pretty(report)?;
    text.push('\n');
    if is_standard_output(Some(path)) {
        print(&text)
    } else {
        Ok(write_atomically(path, text.as_bytes())?)
    }
}

/// Refuses outputs that would replace an input, or each other.
fn keep_apart(outputs: &[Option<&Path>], inputs: &[&Path]) -> Result<(), HostError> {
    // A file that is not there yet is known by its folder and its name.
    let new = |path: &Path| {
        let folder = match path.parent()? {
            parent if parent.as_os_str().is_empty() => Path::new("."),
            parent => parent,
        };
        Some(folder.canonicalize().ok()?.join(path.file_name()?))
    };
    let place = |path: &Path| {
        let there = path.canonicalize().ok().or_else(|| new(path));
        there.unwrap_or_else(|| path.to_owned())
    };
    let mut taken: Vec<_> = inputs.iter().map(|path| place(path)).collect();
    for output in outputs.iter().flatten() {
        let here = place(output);
        if taken.contains(&here) && !is_standard_output(Some(output)) {
            return Err(HostError::Usage {
                argument: "output",
                problem: format!(
                    "{} is an input or another output of this command; name another file",
                    output.display()
                ),
            });
        }
        taken.push(here);
    }
    Ok(())
}

/// Limits the threads of everything that follows. The results do not depend on it.
fn use_threads(threads: Option<u16>) {
    if let Some(threads) = threads {
        // Fails only if the pool exists already, which no command makes before this.
        let _ = rayon::ThreadPoolBuilder::new()
            .num_threads(threads.into())
            .build_global();
    }
}

/// Refuses a blob that was made for other scales than `stage.toml` gives.
fn same_scales(set: &ParameterSet, stage: &Stage, path: &Path) -> Result<(), HostError> {
    let pairs = [
        (
            "hall.m_per_count",
            stage.hall.m_per_count,
            set.hall.m_per_code,
        ),
        (
            "capacitive.m_per_count",
            stage.capacitive.m_per_count,
            set.capacitive.m_per_code,
        ),
    ];
    for (key, stage, blob) in pairs {
        if stage as f32 != blob {
            return Err(HostError::OtherScale {
                path: path.to_owned(),
                key,
                stage,
                blob: blob.into(),
            });
        }
    }
    Ok(())
}

/// What the reports say of the logs.
fn circumstances<'s>(log: &'s LogReading, stage: &'s Stage, started: Instant) -> Circumstances<'s> {
    Circumstances {
        stage,
        dataset: &log.dataset,
        skipped_rows: log.skipped_rows,
        elapsed_s: started.elapsed().as_secs_f64(),
        warnings: log.warnings.iter().map(ToString::to_string).collect(),
    }
}
