//! The commands: arguments, one file a command, and nothing that the library could do.

pub mod args;
mod decode;
mod demo;
mod eval;
mod fit;
mod inspect;

use crate::error::HostError;
use crate::least_squares::starts::LeastSquares;
use crate::solver::Solver;
use args::{Cli, Command};
use clap::Parser;
use runtime::ParameterSet;
use std::path::Path;
use std::process::ExitCode;

/// Names of the solvers.
pub const SOLVERS: [&str; 1] = ["lm"];
/// The solver that gives the best result.
pub const DEFAULT_SOLVER: &str = "lm";

/// The solver of a name.
fn solver(name: &str) -> Option<Box<dyn Solver>> {
    match name {
        "lm" => Some(Box::new(LeastSquares)),
        _ => None,
    }
}

/// Parses the command line, runs the command, prints an error if there is one.
pub fn main() -> ExitCode {
    let cli = Cli::parse();
    let result = match &cli.command {
        Command::Demo(args) => demo::run(args),
        Command::Fit(args) => fit::run(args),
        Command::Eval(args) => eval::run(args),
        Command::Decode(args) => decode::run(args),
        Command::Inspect(args) => inspect::run(args),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("host-fit: {error}");
            ExitCode::from(error.exit_status())
        }
    }
}

/// Writes a report as JSON to a file, or to standard output for `-`.
fn write_json(report: &impl serde::Serialize, path: &Path) -> Result<(), HostError> {
    let mut text = serde_json::to_string_pretty(report).map_err(HostError::json)?;
    text.push('\n');
    if path == Path::new("-") {
        print!("{text}");
        return Ok(());
    }
    Ok(crate::output::write_atomically(path, text.as_bytes())?)
}

/// Reads a parameter blob and refuses one that is not exactly that.
fn read_blob(path: &Path) -> Result<ParameterSet, HostError> {
    crate::blob_file::read(path).map_err(HostError::from)
}
