//! `host-fit compare`.

use super::args::{Logs, Threads};
use crate::cli::error::HostError;
use crate::cli::terminal;
use crate::compare::curves::{Course, history_csv, plot, runs_csv};
use crate::compare::table::table;
use crate::compare::{Comparison, Run, compare};
use crate::output::{make_folder, write_atomically};
use clap::Args;
use hallstage_input::interrupt;
use hallstage_input::log::ReadOptions;
use hallstage_input::progress::Progress;
use hallstage_solver::solve::Projection;
use std::path::{Path, PathBuf};

const TABLE: &str = "table.md";
const RUNS: &str = "runs.csv";
const HISTORY: &str = "history.csv";

/// Arguments of `compare`.
#[derive(Debug, Args)]
pub(super) struct CompareArgs {
    #[command(flatten)]
    logs: Logs,
    #[command(flatten)]
    comparison: Comparison,
    #[command(flatten)]
    pub(super) threads: Threads,
    /// Write table, runs, histories (CSV) and plots (SVG) into this folder.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

/// Compares solvers and prints the table; with a folder, writes table, CSV and plots there.
pub(super) fn run(args: &CompareArgs) -> Result<(), HostError> {
    if let Some(folder) = &args.out {
        let names = args.comparison.forms.iter().flat_map(|form| {
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
    let comparison = &args.comparison;
    let total =
        comparison.forms.len() as u64 * comparison.seeds * (1 + comparison.searches.len() as u64);
    let progress = Progress::new("comparing", total);
    let mut made = 0;
    let done = |_: &Run| {
        made += 1;
        progress.reach(made);
    };
    let compared = compare(&log.dataset, &stage, comparison, interrupted, done);
    drop(progress);
    let runs = compared?;
    let table = table(&runs);
    terminal::print(&table)?;
    if let Some(folder) = &args.out {
        write(folder, &runs, comparison, &table)?;
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
