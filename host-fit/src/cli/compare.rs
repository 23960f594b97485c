//! `host-fit compare`.

use super::args::{CompareArgs, Train};
use crate::cli::error::HostError;
use crate::compare::curves::{Course, history_csv, plot, runs_csv};
use crate::compare::summary::{summaries, table};
use crate::compare::{Comparison, Run, compare};
use crate::input::log::{self, ReadOptions};
use crate::input::stage::Stage;
use crate::interrupt;
use crate::output::{check_writable, make_folder, write_atomically};
use crate::solve::search::kind::SearchKind;
use std::io::{IsTerminal, Write};
use std::path::Path;

/// Compares solvers and prints the table; with a folder, writes table, CSV and plots there.
pub fn run(args: &CompareArgs) -> Result<(), HostError> {
    super::use_threads(args.threads);
    if let Some(folder) = &args.out {
        make_folder(folder)?;
        check_writable(&folder.join("table.md"))?;
    }
    let stage = Stage::from_file(&args.stage)?;
    let log = log::read(&args.logs, &stage, &ReadOptions::default())?;
    let interrupted = interrupt::watch();
    let by_name = |name: &String| SearchKind::by_name(name);
    let comparison = Comparison {
        forms: args.project.clone(),
        searches: args.solvers.iter().filter_map(by_name).collect(),
        seeds: args.seeds,
        train: match args.train {
            Train::All => None,
            Train::Rows(rows) => Some(rows),
        },
        draw: args.draw,
        evaluations: args.evaluations as usize,
        population: args.population as usize,
    };
    let terminal = std::io::stderr().is_terminal();
    let progress = |run: &Run| {
        if terminal {
            // Nobody is left to tell when standard error is gone.
            let _ = write!(
                std::io::stderr(),
                "\r{:<7} {:<14} seed {:<4}",
                run.form.name(),
                run.solver,
                run.seed
            );
        }
    };
    let compared = compare(&log.dataset, &stage, &comparison, interrupted, progress);
    if terminal {
        let _ = write!(std::io::stderr(), "\r{:40}\r", "");
    }
    let runs = compared?;
    let table = table(&summaries(&runs));
    super::print(&table)?;
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
    file("table.md", table)?;
    file("runs.csv", &runs_csv(runs))?;
    file("history.csv", &history_csv(runs))?;
    for &form in &comparison.forms {
        for (course, name) in [(Course::Convergence, "convergence"), (Course::P, "p")] {
            let svg = plot(runs, form, course)?;
            file(&format!("{name}-{}.svg", form.name()), &svg)?;
        }
    }
    Ok(())
}
