//! `host-fit compare`.

use super::args::{Logs, Threads, Train};
use crate::calibrate::arguments::choice;
use crate::cli::error::HostError;
use crate::cli::terminal;
use crate::compare::curves::{Course, history_csv, plot, runs_csv};
use crate::compare::table::table;
use crate::compare::{Comparison, Run, compare};
use crate::input::log::ReadOptions;
use crate::interrupt;
use crate::output::{make_folder, write_atomically};
use crate::problem::draw::Draw;
use crate::progress::Progress;
use crate::solve::Projection;
use crate::solve::search::kind::SearchKind;
use clap::Args;
use std::path::{Path, PathBuf};

const TABLE: &str = "table.md";
const RUNS: &str = "runs.csv";
const HISTORY: &str = "history.csv";

/// Arguments of `compare`.
#[derive(Debug, Args)]
pub(super) struct CompareArgs {
    #[command(flatten)]
    logs: Logs,
    /// Forms of the problem, separated by commas.
    #[arg(
        long,
        value_parser = choice::<Projection>(),
        value_delimiter = ',',
        default_value = "none,delta,linear"
    )]
    project: Vec<Projection>,
    /// Searches, separated by commas; all if not given. Least squares is always there.
    #[arg(long, value_name = "NAMES", value_delimiter = ',', default_values = SearchKind::ALL.map(SearchKind::name), value_parser = choice::<SearchKind>())]
    solvers: Vec<SearchKind>,
    /// Runs of each: seeds 1 to N.
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = clap::value_parser!(u64).range(1..=10_000))]
    seeds: u64,
    /// Rows that each seed draws: `all` or a number.
    #[arg(long, value_name = "N|all", default_value = "200")]
    train: Train,
    /// How rows are drawn.
    #[arg(long, value_parser = choice::<Draw>(), default_value = "stratified")]
    draw: Draw,
    /// Evaluations of each run; the paper's are 100 + 100 generations of 200.
    #[arg(long, value_name = "N", default_value_t = 20_100, value_parser = clap::value_parser!(u32).range(4..=1_000_000_000))]
    evaluations: u32,
    /// Individuals of a population.
    #[arg(long, value_name = "N", default_value_t = 100, value_parser = clap::value_parser!(u32).range(4..=100_000))]
    population: u32,
    #[command(flatten)]
    pub(super) threads: Threads,
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
        // In a folder that is not there yet they take no place.
        let files = files.iter().filter(|_| folder.exists());
        super::keep_apart(files.map(|file| Some(file.as_path())), args.logs.inputs())?;
        make_folder(folder)?;
    }
    let stage = args.logs.stage.read()?;
    let log = args.logs.read(&stage, ReadOptions::default())?;
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
    let table = table(&runs);
    terminal::print(&table)?;
    if let Some(folder) = &args.out {
        write(folder, &runs, &comparison, &table)?;
    }
    if interrupt::requested() {
        let kept = format!("the {} runs that were made are in the table", runs.len());
        return Err(HostError::interrupted(kept));
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
            file(&plot_name(course, form), &plot(runs, form, course))?;
        }
    }
    Ok(())
}

fn plot_name(course: Course, form: Projection) -> String {
    let course = match course {
        Course::Convergence => "convergence",
        Course::P => "p",
    };
    format!("{course}-{}.svg", form.name())
}
