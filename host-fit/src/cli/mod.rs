//! The command line: arguments, printed texts and exit status of each command.
//! One file a command; the work is the library's.

pub(crate) mod arguments;
mod check;
mod decode;
mod demo;
mod diff;
mod error;
mod eval;
mod export;
mod fit;
mod fit_options;
mod identify;
mod init;
mod inspect;
mod interrupt;
mod join;
pub(crate) mod key;
mod live;
mod plan;
mod progress;
mod read_back;
mod recalibrate;
mod record;
mod report;
mod rezero;
mod scope;
mod shell;
mod simulate;
mod terminal;
mod threads;
mod trend;
mod update;

pub use fit_options::FitOptions;

use crate::bus::live::LiveSettings;
use crate::calibrate::other_scales;
use crate::cli::error::HostError;
use crate::join::JoinSettings;
use crate::output::{
    blob_file, check_writable, is_standard, is_standard_output, keep_apart, posterior_file,
};
use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};
use hallstage_input::stage::Stage;
use runtime::ParameterSet;
use std::ffi::OsString;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

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
    /// Print errors only.
    #[arg(short, long, global = true)]
    quiet: bool,
    /// Show all figures, and the time of each step.
    #[arg(short, long, global = true, conflicts_with = "quiet")]
    verbose: bool,
}

/// The commands, and what runs them.
macro_rules! commands {
    ($($(#[$help:meta])* $name:ident($args:ty) => $run:path,)*) => {
        #[derive(Debug, Subcommand)]
        enum Command {
            $($(#[$help])* $name(Box<$args>),)*
        }

        impl Command {
            fn run(&self) -> Result<(), HostError> {
                match self {
                    $(Self::$name(args) => $run(args),)*
                }
            }
        }
    };
}

commands! {
    /// Run the main job on logs that ship with the program, beside the figures of the paper.
    Demo(demo::DemoArgs) => demo::run,
    /// Draft a stage.toml for logs: their columns mapped, and what must be filled in.
    Init(init::InitArgs) => init::run,
    /// Plan the run to make for the field model, and predict its errors in service.
    Plan(plan::PlanArgs) => plan::run,
    /// Write the log of a simulated stage, to rehearse a calibration.
    Simulate(simulate::SimulateArgs) => simulate::run,
    /// Write the completions of a shell to standard output.
    Completions(shell::CompletionsArgs) => shell::completions,
    /// Write the manual pages into a folder.
    Man(shell::ManArgs) => shell::man,
    /// Report what is wrong with one or more logs, or with stage.toml; nothing is kept.
    Check(check::CheckArgs) => check::run,
    /// Fit a calibration to one or more logs and write the parameter blob.
    Fit(fit::FitArgs) => fit::run,
    /// Judge a parameter blob on one or more logs with reference.
    Eval(eval::EvalArgs) => eval::run,
    /// Bring a parameter blob up to date by a few seconds of log.
    Recalibrate(recalibrate::RecalibrateArgs) => recalibrate::run,
    /// Join the records of the sensors and of the interferometers, each with its own clock, into a log.
    #[command(visible_alias = "import")]
    Join(JoinSettings) => join::run,
    /// Decode a log with a parameter blob, by the code that runs on the target.
    Decode(decode::DecodeArgs) => decode::run,
    /// Show what a parameter blob holds.
    Inspect(inspect::InspectArgs) => inspect::run,
    /// Show what changed between two parameter blobs, and by how much their poses differ.
    Diff(diff::DiffArgs) => diff::run,
    /// Show how the calibrations of a stage change, and when their errors reach a limit.
    Trend(trend::TrendArgs) => trend::run,
    /// Write a parameter blob as the file that a flash tool takes.
    Export(export::ExportArgs) => export::run,
    /// Show the sensors of a log in the terminal, also while the log grows.
    Scope(scope::ScopeArgs) => scope::run,
    /// Decode the sensor frames of a CAN bus as they come, and publish the pose (Linux).
    Live(LiveSettings) => live::run,
    /// Record the codes of a controller's own converter from a CAN bus (Linux).
    Record(record::RecordArgs) => record::run,
    /// Show which controller is on a CAN bus, and which parameters it runs (Linux).
    Identify(identify::IdentifyArgs) => identify::run,
    /// Store new parameters in a controller over a CAN bus (Linux).
    Update(update::UpdateArgs) => update::run,
    /// Write the parameters that a controller runs as a parameter blob (Linux).
    ReadBack(read_back::ReadBackArgs) => read_back::run,
    /// Make the pose of a stage at rest the zero of its controller (Linux).
    Rezero(rezero::RezeroArgs) => rezero::run,
}

/// The first command of each group, in the order of the commands.
const GROUPS: [(&str, &str); 4] = [
    ("Start", "demo"),
    ("Calibrate", "check"),
    ("Use", "decode"),
    ("Controller", "live"),
];

/// The command line, its commands in groups.
fn command() -> clap::Command {
    let command = Cli::command();
    let mut list = String::new();
    for one in command.get_subcommands() {
        if let Some((title, _)) = GROUPS.iter().find(|(_, first)| *first == one.get_name()) {
            let _ = writeln!(list, "\n{title}:");
        }
        let about = one.get_about().map(ToString::to_string).unwrap_or_default();
        let _ = writeln!(list, "  {:<12} {about}", one.get_name());
    }
    command.help_template(format!(
        "{{about-with-newline}}\n{{usage-heading}} {{usage}}\n{list}\nOptions:\n{{options}}{{after-help}}"
    ))
}

/// Parses the command line, runs the command, prints an error if there is one.
pub fn main() -> ExitCode {
    ExitCode::from(main_of(std::env::args_os()))
}

/// As [`main`], with the given arguments, the name of the program first: for programs that run commands
/// in their own process; gives the exit status.
pub fn main_of(arguments: impl IntoIterator<Item = impl Into<OsString> + Clone>) -> u8 {
    let matches = command().try_get_matches_from(arguments);
    match matches.and_then(|matches| Cli::from_arg_matches(&matches)) {
        Ok(cli) => run(&cli),
        Err(error) => {
            // Help goes to standard output. Nobody is left to read that it cannot be printed.
            let _ = error.print();
            error.exit_code().try_into().unwrap_or(2)
        }
    }
}

fn run(cli: &Cli) -> u8 {
    terminal::set_level(i8::from(cli.verbose) - i8::from(cli.quiet));
    if !cli.quiet {
        progress::want();
    }
    let started = threads::start(match &cli.command {
        Command::Fit(args) => args.threads.number,
        _ => None,
    });
    match started.and_then(|()| cli.command.run()) {
        Ok(()) => 0,
        // Who reads standard output, as `head` does, has seen enough.
        Err(error) if terminal::is_closed(&error) => 0,
        Err(error) => {
            terminal::fail(&error);
            error.exit_status()
        }
    }
}

/// Prints which files were written.
fn wrote(paths: impl IntoIterator<Item = PathBuf>) -> Result<(), HostError> {
    let mut files = (paths.into_iter()).filter(|path| !is_standard_output(path));
    files.try_for_each(|path| terminal::print(&format!("wrote {}\n", path.display())))
}

/// Refuses outputs that are an input, the posterior beside one, or one another, and outputs that cannot be written: before the work. Where one
/// goes to standard output, nothing else does from now on.
fn check_outputs<'p>(
    outputs: impl IntoIterator<Item = Option<&'p Path>>,
    report: Option<&report::ReportArgs>,
    inputs: impl IntoIterator<Item = &'p Path>,
) -> Result<(), HostError> {
    let inputs: Vec<&Path> = inputs.into_iter().collect();
    if inputs.iter().filter(|path| is_standard(path)).count() > 1 {
        let problem = "standard input can be read only once; name other inputs by their files";
        return Err(HostError::usage("-", problem));
    }
    let mut outputs: Vec<&Path> = outputs.into_iter().flatten().collect();
    if outputs.iter().any(|path| is_standard_output(path)) {
        terminal::keep_for_output();
    }
    // A new folder holds only new files.
    let folder = report.and_then(|report| report.folder.as_deref());
    let new = folder.filter(|folder| !folder.exists());
    let page = report
        .and_then(report::ReportArgs::page)
        .filter(|_| new.is_none());
    outputs.extend(page.as_deref());
    let beside: Vec<_> = (inputs.iter())
        .filter_map(|path| posterior_file::beside(path))
        .collect();
    let inputs = inputs
        .into_iter()
        .chain(beside.iter().map(PathBuf::as_path));
    keep_apart(outputs.iter().copied().chain(new), inputs)?;
    Ok(outputs.into_iter().try_for_each(check_writable)?)
}

/// Reads a blob and its stage. A blob that was made for other scales than `stage.toml` gives is refused.
fn blob_of_stage(
    blob: &Path,
    stage_file: &arguments::StageFile,
) -> Result<(ParameterSet, Stage), HostError> {
    let set = blob_file::read(blob)?;
    let stage = stage_file.read()?;
    if let Some(problem) = other_scales(&set, &stage) {
        let path = stage_file.path.display();
        return Err(HostError::input(format!("{path}: {problem}")));
    }
    Ok((set, stage))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_group_of_commands_begins_with_one_that_is_there() {
        let command = command();
        for (title, first) in GROUPS {
            assert!(command.find_subcommand(first).is_some(), "{title}");
        }
        let help = command.clone().render_help().to_string();
        for name in command.get_subcommands().map(clap::Command::get_name) {
            assert_eq!(help.matches(&format!("\n  {name} ")).count(), 1, "{name}");
        }
    }
}
