//! Medians and spreads over the seeds, and the table of a comparison.

use super::{ARRIVED, Case, EXACT, LEAST_SQUARES, Run};
use crate::solve::search::kind::SearchKind;
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
        // `total_cmp` alone would put a NaN with its sign bit set, as x86 makes them, first.
        sorted.sort_by(|a, b| a.is_nan().cmp(&b.is_nan()).then(a.total_cmp(b)));
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

/// The seeds that came within a share of the floor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Arrival {
    /// How many.
    pub seeds: usize,
    /// Median of the evaluations to there, over these seeds.
    pub evaluations: Option<f64>,
    /// Median of the time to there, s.
    pub seconds: Option<f64>,
}

impl Arrival {
    fn of(runs: &[Run], share: f64) -> Self {
        let evaluations = || runs.iter().filter_map(|run| run.evaluations_to(share));
        let seconds = runs.iter().filter_map(|run| run.seconds_to(share));
        let median = |spread: Spread| spread.median;
        Self {
            seeds: evaluations().count(),
            evaluations: Spread::of(evaluations().map(|n| n as f64)).map(median),
            seconds: Spread::of(seconds).map(median),
        }
    }
}

/// All seeds of one solver on one form.
#[derive(Clone, Debug, PartialEq)]
pub struct Summary {
    /// The form.
    pub form: Case,
    /// Name of the solver.
    pub solver: &'static str,
    /// Seeds.
    pub seeds: usize,
    /// Fitness over the rows drawn, um, um, urad.
    pub fitness: Spread,
    /// rms of X, Y, Rz over all rows, um, um, urad, of the seeds that could be decoded; `None`
    /// where none could.
    pub rms: [Option<Spread>; 3],
    /// How many seeds found parameters that can serve a decoder.
    pub decoded: usize,
    /// How many seeds came within 1 % of the floor, and how soon.
    pub arrived: Arrival,
    /// How many came to the floor itself, and how soon.
    pub exact: Arrival,
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
    let rms = |axis: usize| Spread::of(runs.iter().filter_map(|run| Some(run.rms?[axis])));
    let each = |r: &Run| r.elapsed_s / r.evaluations.max(1) as f64;
    Some(Summary {
        form: first.form,
        solver: first.solver,
        seeds: runs.len(),
        fitness: Spread::of(runs.iter().map(|run| run.fitness))?,
        rms: [rms(0), rms(1), rms(2)],
        decoded: runs.iter().filter(|run| run.rms.is_some()).count(),
        arrived: Arrival::of(runs, ARRIVED),
        exact: Arrival::of(runs, EXACT),
        seconds_per_evaluation: Spread::of(runs.iter().map(each))?.median,
    })
}

/// The table in Markdown.
pub fn table(summaries: &[Summary]) -> String {
    let mut text = String::from(
        "| form | solver | steps | train fitness: median (range) | X rms, um | Y rms, um \
         | Rz rms, urad | decodable \
         | within 1 % of the floor: seeds, evaluations, ms | at the floor (1e-6): seeds, evaluations, ms \
         | us per evaluation |\n\
         |---|---|---|---|---|---|---|---|---|---|---|\n",
    );
    for s in summaries {
        let rms = |axis: usize| s.rms[axis].map_or("-".to_owned(), figures);
        let source = SearchKind::by_name(s.solver).map_or("least squares", SearchKind::source);
        let arrival = |arrival: &Arrival| match (arrival.evaluations, arrival.seconds) {
            (Some(evaluations), Some(seconds)) => format!(
                "{} of {}, {evaluations:.0}, {:.2}",
                arrival.seeds,
                s.seeds,
                seconds * 1e3
            ),
            _ => format!("0 of {}", s.seeds),
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
            "| {} | {} | {source} | {} | {} | {} | {} | {} of {} | {} | {} | {per_evaluation} |",
            s.form.name(),
            s.solver,
            figures(s.fitness),
            rms(0),
            rms(1),
            rms(2),
            s.decoded,
            s.seeds,
            arrival(&s.arrived),
            arrival(&s.exact),
        );
    }
    text
}

/// Median and range.
fn figures(spread: Spread) -> String {
    let [median, low, high] = [spread.median, spread.low, spread.high].map(figure);
    format!("{median} ({low} to {high})")
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
