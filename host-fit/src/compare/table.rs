//! The table of a comparison: medians and ranges over the seeds.

use super::{ARRIVED, EXACT, LEAST_SQUARES, Run};
use hallstage_solver::solve::search::kind::SearchKind;
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
        let median = 0.5 * (sorted[(sorted.len() - 1) / 2] + sorted[middle]);
        Some(Self { median, low, high })
    }
}

/// The runs of each form and solver, which follow each other.
pub fn by_solver(runs: &[Run]) -> impl Iterator<Item = &[Run]> {
    runs.chunk_by(|a, b| a.form == b.form && a.solver == b.solver)
}

/// The table in Markdown: a line for each form and solver, in the order of the runs.
pub fn table(runs: &[Run]) -> String {
    let mut text = String::from(
        "| form | solver | steps | train fitness: median (range) | X rms, um | Y rms, um \
         | Rz rms, urad | decodable \
         | within 1 % of the floor: seeds, evaluations, ms | at the floor (1e-6): seeds, evaluations, ms \
         | us per evaluation |\n\
         |---|---|---|---|---|---|---|---|---|---|---|\n",
    );
    for runs in by_solver(runs) {
        let (form, solver) = (runs[0].form.name(), runs[0].solver);
        let mut searches = SearchKind::ALL.into_iter();
        let source = searches.find(|kind| kind.name() == solver);
        let source = source.map_or("least squares", SearchKind::source);
        let fitness = figures(runs.iter().map(|run| run.fitness));
        let rms = |axis: usize| figures(runs.iter().filter_map(|run| Some(run.rms?[axis])));
        let [x, y, rz] = [0, 1, 2].map(rms);
        let decoded = runs.iter().filter(|run| run.rms.is_some()).count();
        let [arrived, exact] = [ARRIVED, EXACT].map(|share| arrival(runs, share));
        // Least squares counts passes over the rows, which are not evaluations of the fitness.
        let each_us = runs.iter().map(|run| 1e6 * run.seconds_per_evaluation());
        let each_us = match Spread::of(each_us) {
            Some(spread) if solver != LEAST_SQUARES => format!("{:.2}", spread.median),
            _ => "-".to_owned(),
        };
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "| {form} | {solver} | {source} | {fitness} | {x} | {y} | {rz} | {decoded} of {} | {arrived} \
             | {exact} | {each_us} |",
            runs.len(),
        );
    }
    text
}

/// The seeds that came within a share of the floor, and how soon: medians of their evaluations and of
/// their times in ms.
fn arrival(runs: &[Run], share: f64) -> String {
    let arrived = || {
        let each = runs.iter();
        each.filter_map(|run| Some((run.evaluations_to(share)? as f64, run)))
    };
    let times = arrived().map(|(evaluations, run)| evaluations * run.seconds_per_evaluation());
    let evaluations = Spread::of(arrived().map(|(evaluations, _)| evaluations));
    let soon = evaluations
        .zip(Spread::of(times))
        .map(|(evaluations, s)| format!(", {:.0}, {:.2}", evaluations.median, s.median * 1e3));
    let (seeds, soon) = (arrived().count(), soon.unwrap_or_default());
    format!("{seeds} of {}{soon}", runs.len())
}

/// Median and range.
fn figures(numbers: impl IntoIterator<Item = f64>) -> String {
    Spread::of(numbers).map_or("-".to_owned(), |spread| {
        let [median, low, high] = [spread.median, spread.low, spread.high].map(figure);
        format!("{median} ({low} to {high})")
    })
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
