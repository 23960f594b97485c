//! The command line.

use super::export::ExportArgs;
use crate::bus::import::ImportArgs;
use crate::bus::live::LiveArgs;
use crate::bus::replay::ReplayArgs;
use crate::problem::draw::Draw;
use crate::solve::Projection;
use crate::solve::search::kind::SearchKind;
use clap::builder::PossibleValuesParser;
use clap::{Args, Parser, Subcommand, ValueEnum};
use runtime::ModelKind;
use runtime::parameters::Text;
use std::path::PathBuf;

/// Calibrates the Hall-sensor array of a 6-DOF precision stage from logged data.
///
/// Exit status: 0 good; 2 wrong usage; 3 bad input or output; 4 the fit failed its own checks;
/// 130 interrupted, best so far kept.
#[derive(Debug, Parser)]
#[command(name = "host-fit", version, max_term_width = 100)]
pub struct Cli {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

/// The commands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Run the main job on a log that ships with the program, beside the figures of the paper.
    Demo(DemoArgs),
    /// Fit a calibration to one or more logs and write the parameter blob.
    Fit(Box<FitArgs>),
    /// Judge a parameter blob on one or more logs with reference.
    Eval(EvalArgs),
    /// Decode a log with a parameter blob, by the code that runs on the target.
    Decode(DecodeArgs),
    /// Show what a parameter blob holds.
    Inspect(InspectArgs),
    /// Decode the sensor frames of a CAN bus as they come, and publish the pose (Linux).
    Live(LiveArgs),
    /// Play a log onto a CAN bus as the sensor node would send it (Linux).
    Replay(ReplayArgs),
    /// Write a parameter blob as the file that a flash tool takes.
    Export(ExportArgs),
    /// Compare the solvers on one or more logs, over several seeds at equal evaluations.
    Compare(CompareArgs),
    /// Join a record of the CAN bus and a log of the interferometers into a calibration log.
    Import(Box<ImportArgs>),
}

/// Arguments of `demo`.
#[derive(Debug, Args)]
pub struct DemoArgs {
    /// Where to leave log, stage.toml, params.bin and pose.csv; a temporary folder if not given.
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Also print the zero deviation of each movement (Table A1).
    #[arg(long)]
    pub zero_deviations: bool,
}

/// The models on the command line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum ModelChoice {
    /// The best that this program has: today (31).
    Auto,
    /// Geometry only.
    #[value(name = "12")]
    M12,
    /// Geometry and sensitivity.
    #[value(name = "15")]
    M15,
    /// As 15, with a zero deviation for each movement.
    #[value(name = "30")]
    M30,
    /// As 30, with a sensitivity that follows Z, Rx, Ry.
    #[value(name = "31")]
    M31,
}

impl ModelChoice {
    /// The model that is fitted.
    pub const fn kind(self) -> ModelKind {
        match self {
            Self::M12 => ModelKind::M12,
            Self::M15 => ModelKind::M15,
            Self::M30 => ModelKind::M30,
            Self::M31 | Self::Auto => ModelKind::M31,
        }
    }
}

/// What to do with rows that cannot be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum BadRowsChoice {
    /// Stop at the first and say where it is.
    Refuse,
    /// Leave them out and count them.
    Skip,
}

/// `all` or a number of rows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Train {
    /// All rows.
    All,
    /// So many.
    Rows(usize),
}

fn train(text: &str) -> Result<Train, String> {
    match text {
        "all" => Ok(Train::All),
        number => match number.parse() {
            Ok(0) | Err(_) => Err("expected `all` or a number of rows, 1 or more".into()),
            Ok(rows) => Ok(Train::Rows(rows)),
        },
    }
}

fn text(value: &str) -> Result<Text, String> {
    Text::try_from(value).map_err(|_| "at most 32 bytes fit in the blob".into())
}

/// Arguments of `fit`.
#[derive(Debug, Args)]
pub struct FitArgs {
    /// Logs: CSV or CSV.gz, one or more.
    #[arg(required = true, value_name = "LOG")]
    pub logs: Vec<PathBuf>,
    /// The stage as designed.
    #[arg(long, value_name = "stage.toml")]
    pub stage: PathBuf,
    /// Where to write the parameter blob.
    #[arg(long, value_name = "params.bin")]
    pub out: PathBuf,
    /// Measurement model.
    #[arg(long, value_enum, default_value = "auto")]
    pub model: ModelChoice,
    /// Solver. The default searches by SHTLBO and finishes by least squares, `lm` is least squares
    /// alone, the others search only.
    #[arg(long, value_name = "NAME", value_parser = PossibleValuesParser::new(crate::cli::solver_names()), default_value = crate::solve::Solver::Finished.name())]
    pub solver: String,
    /// How much of the problem is solved in closed form.
    #[arg(long, value_enum, default_value = "linear")]
    pub project: Projection,
    /// Rows to fit: `all` or a number.
    #[arg(long, value_name = "N|all", default_value = "all", value_parser = train)]
    pub train: Train,
    /// How rows are drawn.
    #[arg(long, value_enum, default_value = "stratified")]
    pub draw: Draw,
    /// Individuals of a population: 100 as in the paper, or 16 with --project linear.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(4..=100_000))]
    pub population: Option<u32>,
    /// Generations of a population: 100 as in the paper; with --project linear at most 1000,
    /// fewer once the fitness hardly falls any more.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=10_000_000))]
    pub generations: Option<u32>,
    /// Seed of everything random.
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u64,
    /// Warm start: a search begins with the parameters of this blob among its population.
    #[arg(long, value_name = "params.bin")]
    pub start: Option<PathBuf>,
    /// Threads; all cores if not given. The result does not depend on it.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// Serial number of the stage, for the blob; at most 32 bytes.
    #[arg(long, value_name = "TEXT", value_parser = text)]
    pub serial: Option<Text>,
    /// Creation time, for the blob, as you want it to read; at most 32 bytes.
    #[arg(long, value_name = "TIME", value_parser = text)]
    pub created: Option<Text>,
    /// What to do with rows that cannot be used.
    #[arg(long, value_enum, default_value = "refuse")]
    pub bad_rows: BadRowsChoice,
    /// Write a report with plots into this folder.
    #[arg(long, value_name = "DIR")]
    pub report: Option<PathBuf>,
    /// Write the figures as JSON; `-` for standard output.
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
}

/// How `eval` treats zero deviations.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum DeltaChoice {
    /// Refit them for each movement.
    Fit,
    /// None: as the target reads without a re-zero.
    Zero,
}

/// Arguments of `eval`.
#[derive(Debug, Args)]
pub struct EvalArgs {
    /// The parameter blob.
    #[arg(value_name = "params.bin")]
    pub params: PathBuf,
    /// Logs: CSV or CSV.gz, one or more.
    #[arg(required = true, value_name = "LOG")]
    pub logs: Vec<PathBuf>,
    /// The stage as designed.
    #[arg(long, value_name = "stage.toml")]
    pub stage: PathBuf,
    /// Zero deviations; as the blob's model has them if not given: models (12) and (15) have none.
    #[arg(long, value_enum)]
    pub delta: Option<DeltaChoice>,
    /// Write the figures as JSON; `-` for standard output.
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
}

/// Arguments of `decode`.
#[derive(Debug, Args)]
pub struct DecodeArgs {
    /// The parameter blob.
    #[arg(value_name = "params.bin")]
    pub params: PathBuf,
    /// The log: CSV or CSV.gz; it needs no reference.
    #[arg(value_name = "LOG")]
    pub log: PathBuf,
    /// The stage as designed.
    #[arg(long, value_name = "stage.toml")]
    pub stage: PathBuf,
    /// Where to write the poses.
    #[arg(long, value_name = "pose.csv")]
    pub out: PathBuf,
    /// Repeat the last valid pose for at most so many rows where codes are bad.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub hold: u16,
}

/// Arguments of `inspect`.
#[derive(Debug, Args)]
pub struct InspectArgs {
    /// The parameter blob.
    #[arg(value_name = "params.bin")]
    pub params: PathBuf,
    /// Write everything as JSON; `-` for standard output.
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
}

/// Arguments of `compare`.
#[derive(Debug, Args)]
pub struct CompareArgs {
    /// Logs: CSV or CSV.gz, one or more.
    #[arg(required = true, value_name = "LOG")]
    pub logs: Vec<PathBuf>,
    /// The stage as designed.
    #[arg(long, value_name = "stage.toml")]
    pub stage: PathBuf,
    /// Forms of the problem, separated by commas.
    #[arg(
        long,
        value_enum,
        value_delimiter = ',',
        default_value = "none,delta,linear"
    )]
    pub project: Vec<Projection>,
    /// Searches, separated by commas; all if not given. Least squares is always there.
    #[arg(long, value_name = "NAMES", value_delimiter = ',', default_values = SearchKind::NAMES, value_parser = PossibleValuesParser::new(SearchKind::NAMES))]
    pub solvers: Vec<String>,
    /// Runs of each: seeds 1 to N.
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = clap::value_parser!(u64).range(1..=10_000))]
    pub seeds: u64,
    /// Rows that each seed draws: `all` or a number.
    #[arg(long, value_name = "N|all", default_value = "200", value_parser = train)]
    pub train: Train,
    /// How rows are drawn.
    #[arg(long, value_enum, default_value = "stratified")]
    pub draw: Draw,
    /// Evaluations of each run; the paper's are 100 + 100 generations of 200.
    #[arg(long, value_name = "N", default_value_t = 20_100, value_parser = clap::value_parser!(u32).range(4..=1_000_000_000))]
    pub evaluations: u32,
    /// Individuals of a population.
    #[arg(long, value_name = "N", default_value_t = 100, value_parser = clap::value_parser!(u32).range(4..=100_000))]
    pub population: u32,
    /// Threads; all cores if not given. The results do not depend on it.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// Write table, runs, histories (CSV) and plots (SVG) into this folder.
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
}
