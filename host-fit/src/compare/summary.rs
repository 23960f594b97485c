//! Medians and spreads over the seeds, and the table of a comparison.

use super::{ARRIVED, LEAST_SQUARES, Run};
use crate::search::kind::SearchKind;
use crate::solver::Projection;
use std::fmt::Write;

/// Median, smallest and largest of some numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spread {
    /// The median; of an even count the mean of the middle two.
    pub median: f64,
    /// The smallest.
    pub low: f64,
    /// The largest.
    pub high: f64,
}

impl Spread {
    /// Of numbers in any order; `None` of none. NaN ranks last.
    pub fn of(numbers: impl IntoIterator<Item = f64>) -> Option<Self> {
        let mut sorted: Vec<f64> = numbers.into_iter().collect();
        sorted.sort_by(f64::total_cmp);
        let (low, high) = (*sorted.first()?, *sorted.last()?);
        let middle = sorted.len() / 2;
        let median = if sorted.len().is_multiple_of(2) {
            0.5 * (sorted[middle - 1] + sorted[middle])
        } else {
            sorted[middle]
        };
        Some(Self { median, low, high })
    }
}

/// All seeds of one solver on one form.
#[derive(Clone, Debug, PartialEq)]
pub struct Summary {
    /// The form.
    pub form: Projection,
    /// Name of the solver.
    pub solver: &'static str,
    /// Seeds.
    pub seeds: usize,
    /// Fitness over the rows drawn, um, um, urad.
    pub fitness: Spread,
    /// rms of X, Y, Rz over all rows, um, um, urad; `None` where no seed could be decoded.
    pub rms: [Option<Spread>; 3],
    /// Seeds that arrived within 1 % of the floor.
    pub arrived: usize,
    /// Median of evaluations to there, over the seeds that arrived.
    pub evaluations_to_floor: Option<f64>,
    /// Median of the time to there, s.
    pub seconds_to_floor: Option<f64>,
    /// Median time of an evaluation, s.
    pub seconds_per_evaluation: f64,
}

/// One summary for each form and solver, in the order of the runs.
pub fn summaries(runs: &[Run]) -> Vec<Summary> {
    let same = |a: &Run, b: &Run| a.form == b.form && a.solver == b.solver;
    runs.chunk_by(same).filter_map(summary).collect()
}

fn summary(runs: &[Run]) -> Option<Summary> {
    let first = runs.first()?;
    let arrived: Vec<&Run> = runs
        .iter()
        .filter(|r| r.arrived_after().is_some())
        .collect();
    let rms = |axis: usize| Spread::of(runs.iter().filter_map(|run| Some(run.rms?[axis])));
    let median = |numbers: Vec<f64>| Spread::of(numbers).map(|spread| spread.median);
    let each = |r: &Run| r.elapsed_s / r.evaluations.max(1) as f64;
    Some(Summary {
        form: first.form,
        solver: first.solver,
        seeds: runs.len(),
        fitness: Spread::of(runs.iter().map(|run| run.fitness))?,
        rms: [rms(0), rms(1), rms(2)],
        arrived: arrived.len(),
        evaluations_to_floor: median(
            arrived
                .iter()
                .filter_map(|run| Some(run.arrived_after()? as f64))
                .collect(),
        ),
        seconds_to_floor: median(arrived.iter().filter_map(|r| r.arrived_after_s()).collect()),
        seconds_per_evaluation: median(runs.iter().map(each).collect())?,
    })
}

/// The table in Markdown.
pub fn table(summaries: &[Summary]) -> String {
    let mut text = format!(
        "| form | solver | steps | train fitness: median (range) | X rms, um | Y rms, um | Rz rms, urad \
         | within {:.0} % of the floor | evaluations to there | ms to there | us per evaluation |\n\
         |---|---|---|---|---|---|---|---|---|---|---|\n",
        ARRIVED * 100.0
    );
    for s in summaries {
        let rms = |axis: usize| s.rms[axis].map_or("-".to_owned(), |rms| figure(rms.median));
        let source = SearchKind::by_name(s.solver).map_or("least squares", SearchKind::source);
        let to_floor = |number: Option<f64>, scale: f64, decimals: usize| {
            number.map_or("-".to_owned(), |x| format!("{:.decimals$}", x * scale))
        };
        // Least squares counts passes over the rows, which are not evaluations of the fitness.
        let per_evaluation = if s.solver == LEAST_SQUARES {
            "-".to_owned()
        } else {
            format!("{:.2}", s.seconds_per_evaluation * 1e6)
        };
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "| {} | {} | {source} | {} ({} to {}) | {} | {} | {} | {} of {} | {} | {} | {per_evaluation} |",
            s.form.name(),
            s.solver,
            figure(s.fitness.median),
            figure(s.fitness.low),
            figure(s.fitness.high),
            rms(0),
            rms(1),
            rms(2),
            s.arrived,
            s.seeds,
            to_floor(s.evaluations_to_floor, 1.0, 0),
            to_floor(s.seconds_to_floor, 1e3, 2),
        );
    }
    text
}

/// Three to four digits.
fn figure(x: f64) -> String {
    if !x.is_finite() {
        "none".to_owned()
    } else if x.abs() >= 100.0 {
        format!("{x:.0}")
    } else if x.abs() >= 10.0 {
        format!("{x:.1}")
    } else {
        format!("{x:.3}")
    }
}
