//! The command line: what the commands take and print, and with which exit status they end.
//! One file a command; the work is the library's.

mod args;
mod check;
mod compare;
mod decode;
mod demo;
mod diff;
mod error;
mod eval;
mod export;
mod fit;
mod identify;
mod import;
mod init;
mod inspect;
mod limit;
mod live;
mod plan;
mod read_back;
mod recalibrate;
mod record;
mod replay;
mod shell;
mod simulate;
mod terminal;
mod threads;
mod update;

use crate::cli::error::HostError;
use crate::input::log::{LogReading, LogWarning, ReadOptions, ReferenceUse};
use crate::input::stage::Stage;
use crate::output::{Place, is_standard, is_standard_output, posterior_file, write_atomically};
use crate::progress;
use crate::report::json::Circumstances;
use clap::{Parser, Subcommand};
use runtime::ParameterSet;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

/// Calibrates the Hall-sensor array of a 6-DOF precision stage from logged data.
///
/// Exit status: 0 good; 2 wrong usage; 3 bad input or output; 4 the fit failed its own checks, a log
/// is refused or not described, or no run can be planned; 130 interrupted, best so far kept.
#[derive(Debug, Parser)]
#[command(name = "host-fit", version, max_term_width = 100)]
struct Cli {
    /// What to do.
    #[command(subcommand)]
    command: Command,
    /// Tell errors only.
    #[arg(short, long, global = true)]
    quiet: bool,
    /// Tell how long each step takes.
    #[arg(short, long, global = true, conflicts_with = "quiet")]
    verbose: bool,
}

/// The commands.
#[derive(Debug, Subcommand)]
enum Command {
    /// Run the main job on logs that ship with the program, beside the figures of the paper.
    Demo(demo::DemoArgs),
    /// Fit a calibration to one or more logs and write the parameter blob.
    Fit(Box<fit::FitArgs>),
    /// Tell what is wrong with one or more logs, or with stage.toml; nothing is kept.
    Check(check::CheckArgs),
    /// Judge a parameter blob on one or more logs with reference.
    Eval(eval::EvalArgs),
    /// Decode a log with a parameter blob, by the code that runs on the target.
    Decode(decode::DecodeArgs),
    /// Show what a parameter blob holds.
    Inspect(inspect::InspectArgs),
    /// Show what changed between two parameter blobs, and by how much their poses differ.
    Diff(diff::DiffArgs),
    /// Decode the sensor frames of a CAN bus as they come, and publish the pose (Linux).
    Live(live::LiveArgs),
    /// Record the codes of a controller's own converter from a CAN bus (Linux).
    Record(record::RecordArgs),
    /// Tell which controller is on a CAN bus, and which parameters it runs (Linux).
    Identify(identify::IdentifyArgs),
    /// Store new parameters in a controller over a CAN bus (Linux).
    Update(update::UpdateArgs),
    /// Write the parameters that a controller runs as a parameter blob (Linux).
    ReadBack(read_back::ReadBackArgs),
    /// Play a log onto a CAN bus as the sensor node would send it (Linux).
    Replay(replay::ReplayArgs),
    /// Write a parameter blob as the file that a flash tool takes.
    Export(export::ExportArgs),
    /// Compare the solvers on one or more logs, over several seeds at equal evaluations.
    Compare(compare::CompareArgs),
    /// Join a record of the CAN bus and a log of the interferometers into a calibration log.
    Import(Box<import::ImportArgs>),
    /// Draft a stage.toml for logs: their columns mapped, and what must be filled in.
    Init(init::InitArgs),
    /// Plan the run to make for the field model, and tell what to expect of it.
    Plan(plan::PlanArgs),
    /// Bring a parameter blob up to date by a few seconds of log.
    Recalibrate(recalibrate::RecalibrateArgs),
    /// Write the log of a simulated stage, to rehearse a calibration.
    Simulate(simulate::SimulateArgs),
    /// Write the completions of a shell to standard output.
    Completions(shell::CompletionsArgs),
    /// Write the manual pages into a folder.
    Man(shell::ManArgs),
}

/// How `eval` reads: it needs the reference, and the decoder marks saturated codes.
const EVAL: ReadOptions = ReadOptions {
    reference: ReferenceUse::Required,
    ..ReadOptions::DECODE
};

/// Parses the command line, runs the command, prints an error if there is one.
pub fn main() -> ExitCode {
    run(Cli::parse())
}

/// As [`main`], of these arguments, the name of the program first: for programs that run commands
/// in their own process. Wrong usage is not explained.
pub fn main_of(arguments: &[&OsStr]) -> ExitCode {
    Cli::try_parse_from(arguments).map_or_else(|_| ExitCode::from(2), run)
}

fn run(cli: Cli) -> ExitCode {
    terminal::set_level(i8::from(cli.verbose) - i8::from(cli.quiet));
    if !cli.quiet {
        progress::show();
    }
    threads::start(match &cli.command {
        Command::Fit(args) => args.threads,
        Command::Compare(args) => args.threads,
        _ => None,
    });
    let result = match cli.command {
        Command::Demo(args) => demo::run(&args),
        Command::Fit(args) => fit::run(&args),
        Command::Check(args) => check::run(&args),
        Command::Eval(args) => eval::run(&args),
        Command::Decode(args) => decode::run(&args),
        Command::Inspect(args) => inspect::run(&args),
        Command::Diff(args) => diff::run(&args),
        Command::Live(args) => live::run(args),
        Command::Record(args) => record::run(args),
        Command::Identify(args) => identify::run(&args),
        Command::Update(args) => update::run(args),
        Command::ReadBack(args) => read_back::run(&args),
        Command::Replay(args) => replay::run(args),
        Command::Export(args) => export::run(&args),
        Command::Compare(args) => compare::run(&args),
        Command::Import(args) => import::run(*args),
        Command::Init(args) => init::run(&args),
        Command::Plan(args) => plan::run(&args),
        Command::Recalibrate(args) => recalibrate::run(&args),
        Command::Simulate(args) => simulate::run(&args),
        Command::Completions(args) => shell::completions(&args),
        Command::Man(args) => shell::man(&args),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        // Who reads standard output, as `head` does, has seen enough.
        Err(error) if terminal::is_closed(&error) => ExitCode::SUCCESS,
        Err(error) => {
            terminal::fail(&error);
            ExitCode::from(error.exit_status())
        }
    }
}

/// Writes a report as JSON to a file, or to standard output for `-`.
fn write_json(report: &impl serde::Serialize, path: &Path) -> Result<(), HostError> {
    Ok(write_atomically(path, json(report)?.as_bytes())?)
}

/// A report as JSON.
fn json(report: &impl serde::Serialize) -> Result<String, HostError> {
    let mut text = serde_json::to_string_pretty(report)?;
    text.push('\n');
    Ok(text)
}

/// Says which files were written.
fn wrote(paths: impl IntoIterator<Item = Option<PathBuf>>) -> Result<(), HostError> {
    for path in paths.into_iter().flatten() {
        terminal::print(&format!("wrote {}\n", path.display()))?;
    }
    Ok(())
}

/// Refuses outputs that are an input, the posterior beside one, or each other, by whatever name. Where
/// one goes to standard output, nothing else does from now on.
fn keep_apart(outputs: &[Option<&Path>], inputs: &[&Path]) -> Result<(), HostError> {
    let beside = |path: &&&Path| posterior_file::beside(path).filter(|path| path.exists());
    let posteriors = inputs.iter().filter_map(|path| beside(&path));
    let posteriors: Vec<Place> = posteriors.map(|path| Place::of(&path)).collect();
    let named = inputs.iter().filter_map(|path| place_of_input(path));
    let inputs: Vec<Place> = named.chain(posteriors).collect();
    let mut taken: Vec<Place> = Vec::new();
    for output in outputs.iter().flatten() {
        let (name, here) = match is_standard(output) {
            true => (
                "standard output".into(),
                Place::of(Path::new("/dev/stdout")),
            ),
            false => (output.to_string_lossy(), Place::of(output)),
        };
        if is_standard_output(output) {
            terminal::keep_for_output();
        }
        let what = if inputs.contains(&here) {
            "an input"
        } else if taken.contains(&here) {
            "another output"
        } else {
            taken.push(here);
            continue;
        };
        return Err(HostError::Usage {
            argument: "output",
            problem: format!("{name} is {what} of this command; name another file"),
        });
    }
    Ok(())
}

/// The file that an input is read from, also where the shell opened it as standard input; of a
/// pipe or a terminal there is none.
fn place_of_input(path: &Path) -> Option<Place> {
    let standard = Path::new("/dev/stdin");
    match is_standard(path) {
        true => (standard.metadata().ok()?.is_file()).then(|| Place::of(standard)),
        false => Some(Place::of(path)),
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

/// The warnings of a log that is diagnosed, which tells of another rate itself.
fn warnings_of(log: &LogReading) -> Vec<String> {
    let told = |warning: &&LogWarning| !matches!(warning, LogWarning::OtherPeriod { .. });
    let warnings = log.warnings.iter().filter(told);
    warnings.map(ToString::to_string).collect()
}

/// What the reports say of the logs.
fn circumstances<'s>(log: &'s LogReading, stage: &'s Stage, started: Instant) -> Circumstances<'s> {
    Circumstances {
        stage,
        dataset: &log.dataset,
        skipped_rows: log.skipped_rows,
        elapsed_s: started.elapsed().as_secs_f64(),
        warnings: warnings_of(log),
        findings: Vec::new(),
    }
}
