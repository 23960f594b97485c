//! The values of one channel, in runs of consecutive rows.

use crate::channel::Channel;
use crate::dataset::{Dataset, GAP_PERIODS, LogSource, Row};
use crate::stage::Stage;
use std::ops::Range;

/// One channel of one log.
#[derive(Clone, Debug)]
pub struct Signal<'a> {
    /// The channel.
    pub channel: Channel,
    /// The values by row: codes, and picometres for beams.
    pub values: Vec<f64>,
    /// The unit of the values, m.
    pub unit_m: f64,
    /// Runs of consecutive rows of one movement.
    pub runs: &'a [Range<usize>],
}

impl Signal<'_> {
    /// The values of each run.
    pub fn runs(&self) -> impl Iterator<Item = &[f64]> {
        self.runs.iter().map(|run| &self.values[run.clone()])
    }
}

/// The runs of consecutive rows of one movement. Rows are numbered from the first of the log.
pub fn runs(dataset: &Dataset, log: &LogSource) -> Vec<Range<usize>> {
    let rows = &dataset.rows[log.rows.clone()];
    let gap_us = GAP_PERIODS * 1e6 * dataset.period_s(log.rows.clone()).unwrap_or(f64::INFINITY);
    let follows =
        |a: &Row, b: &Row| a.movement == b.movement && ((b.t_us - a.t_us) as f64) < gap_us;
    let mut start = 0;
    let runs = rows.chunk_by(follows).map(|run| {
        start += run.len();
        start - run.len()..start
    });
    runs.collect()
}

/// The channels of a log: beams only if it has a reference, gaps only if it has codes.
pub fn signals<'a>(
    dataset: &Dataset,
    stage: &Stage,
    log: &LogSource,
    runs: &'a [Range<usize>],
) -> Vec<Signal<'a>> {
    let rows = &dataset.rows[log.rows.clone()];
    let has_gaps = rows.iter().all(|row| row.frame.capacitive().is_some());
    let value = |row: &Row, k: usize| match k {
        0..3 => f64::from(row.frame.hall()[k]),
        // Whole picometres: rounding on the way to a pose and back is far less.
        3..6 => (1e12 * row.beams_m(&stage.interferometer)[k - 3]).round(),
        _ => row
            .frame
            .capacitive()
            .map_or(0.0, |codes| f64::from(codes[k - 6])),
    };
    let units_m = [stage.hall.m_per_count, 1e-12, stage.capacitive.m_per_count];
    let signal = |k: usize| Signal {
        channel: Channel::SINGLE[k],
        values: rows.iter().map(|row| value(row, k)).collect(),
        unit_m: units_m[k / 3],
        runs,
    };
    let is_there = |k: &usize| match k {
        0..3 => true,
        3..6 => log.has_reference,
        _ => has_gaps,
    };
    (0..9).filter(is_there).map(signal).collect()
}
