//! `host-fit compare`.

use super::args::Train;
use crate::cli::error::HostError;
use crate::cli::terminal;
use crate::compare::curves::{Course, history_csv, plot, runs_csv};
use crate::compare::summary::{summaries, table};
use crate::compare::{Case, Comparison, Run, compare};
use crate::input::log::{self, ReadOptions};
use crate::input::stage::Stage;
use crate::interrupt;
use crate::output::{check_writable, make_folder, write_atomically};
use crate::problem::draw::Draw;
use crate::progress::Progress;
use crate::solve::search::kind::SearchKind;
use clap::Args;
use std::path::{Path, PathBuf};

const TABLE: &str = "table.md";
const RUNS: &str = "runs.csv";
const HISTORY: &str = "history.csv";

/// Arguments of `compare`.
#[derive(Debug, Args)]
pub(super) struct CompareArgs {
    /// Logs: CSV or CSV.gz, one or more; `-` for standard input.
    #[arg(required = true, value_name = "LOG")]
    logs: Vec<PathBuf>,
    /// The stage as designed.
    #[arg(long, value_name = "stage.toml")]
    stage: PathBuf,
    /// Logs without a column for the movement: begin one every so many seconds, not only after gaps
    /// in time.
    #[arg(long, value_name = "SECONDS", value_parser = super::args::movement_seconds)]
    split: Option<f64>,
    #[command(flatten)]
    memory: super::args::Memory,
    /// Forms of the problem, separated by commas.
    #[arg(
        long,
        value_enum,
        value_delimiter = ',',
        default_value = "none,delta,linear"
    )]
    project: Vec<Case>,
    /// Searches, separated by commas; all if not given. Least squares is always there.
    #[arg(long, value_name = "NAMES", value_delimiter = ',', default_values = SearchKind::NAMES, value_enum)]
    solvers: Vec<SearchKind>,
    /// Runs of each: seeds 1 to N.
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = clap::value_parser!(u64).range(1..=10_000))]
    seeds: u64,
    /// Rows that each seed draws: `all` or a number.
    #[arg(long, value_name = "N|all", default_value = "200")]
    train: Train,
    /// How rows are drawn.
    #[arg(long, value_enum, default_value = "stratified")]
    draw: Draw,
    /// Evaluations of each run; the paper's are 100 + 100 generations of 200.
    #[arg(long, value_name = "N", default_value_t = 20_100, value_parser = clap::value_parser!(u32).range(4..=1_000_000_000))]
    evaluations: u32,
    /// Individuals of a population.
    #[arg(long, value_name = "N", default_value_t = 100, value_parser = clap::value_parser!(u32).range(4..=100_000))]
    population: u32,
    /// Threads; all cores if not given. The results do not depend on it.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub(super) threads: Option<u16>,
    /// Write table, runs, histories (CSV) and plots (SVG) into this folder.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

/// Compares solvers and prints the table; with a folder, writes table, CSV and plots there.
pub(super) fn run(args: &CompareArgs) -> Result<(), HostError> {
    if let Some(folder) = &args.out {
        let names = args.project.iter().flat_map(|form| {
            [Course::Convergence, Course::P].map(|course| plot_name(course, *form))
        });
        let tables = [TABLE, RUNS, HISTORY].map(str::to_owned);
        let files: Vec<_> = names.chain(tables).map(|name| folder.join(name)).collect();
        let outputs: Vec<_> = files.iter().map(|file| Some(file.as_path())).collect();
        let inputs = args.logs.iter().chain([&args.stage]);
        super::keep_apart(&outputs, &inputs.map(PathBuf::as_path).collect::<Vec<_>>())?;
        make_folder(folder)?;
        check_writable(&folder.join(TABLE))?;
    }
    let stage = Stage::from_file(&args.stage)?;
    let options = ReadOptions {
        split_s: args.split,
        memory_bytes: args.memory.limit_bytes(),
        ..ReadOptions::default()
    };
    let log = terminal::timed("reading", || log::read(&args.logs, &stage, &options))?;
    let interrupted = interrupt::watch();
    let comparison = Comparison {
        forms: args.project.clone(),
        searches: args.solvers.clone(),
        seeds: args.seeds,
        train: args.train.0,
        draw: args.draw,
        evaluations: args.evaluations as usize,
        population: args.population as usize,
    };
    let total =
        comparison.forms.len() as u64 * comparison.seeds * (1 + comparison.searches.len() as u64);
    let progress = Progress::new("comparing", total);
    let mut made = 0;
    let done = |_: &Run| {
        made += 1;
        progress.reach(made);
    };
    let compared = compare(&log.dataset, &stage, &comparison, interrupted, done);
    drop(progress);
    let runs = compared?;
    let table = table(&summaries(&runs));
    terminal::print(&table)?;
    if let Some(folder) = &args.out {
        write(folder, &runs, &comparison, &table)?;
    }
    if interrupt::requested() {
        return Err(HostError::Interrupted {
            kept: format!("the {} runs that were made are in the table", runs.len()),
        });
    }
    Ok(())
}

fn write(
    folder: &Path,
    runs: &[Run],
    comparison: &Comparison,
    table: &str,
) -> Result<(), HostError> {
    make_folder(folder)?;
    let file = |name: &str, text: &str| write_atomically(&folder.join(name), text.as_bytes());
    file(TABLE, table)?;
    file(RUNS, &runs_csv(runs))?;
    file(HISTORY, &history_csv(runs))?;
    for &form in &comparison.forms {
        for course in [Course::Convergence, Course::P] {
            file(&plot_name(course, form), &plot(runs, form, course)?)?;
        }
    }
    Ok(())
}

fn plot_name(course: Course, form: Case) -> String {
    let course = match course {
        Course::Convergence => "convergence",
        Course::P => "p",
    };
    format!("{course}-{}.svg", form.name())
}
