//! Samples the rows of logs while they are read: all rows of short logs, and runs of neighbouring rows of long
//! logs, spread over all motion.
//!
//! The k-th run that moves the stage in any axis has its place at the fractional part of k times the golden ratio.
//! It is kept while its place is below the share of its log. If there are too many rows, the share of the log with
//! most rows is halved. The kept runs are spread evenly over the log for every share, a protocol that repeats is
//! sampled in all its phases, and nothing is random. A log without motion is sampled in the same way.

use crate::dataset::{Dataset, LogSource, Movement, Row};
use crate::stage;
use runtime::Temperature;
use std::ops::Range;

/// Rows of a run: a second, as long as the period of the paper's motions.
const RUN: usize = 500;
/// About the number of rows of a run that are tested for motion.
const LOOKED_AT: usize = 50;
/// A run stands still if X, Y and Z move less than this, m, and Rz, Rx and Ry less than the next, rad.
const IDLE_M: f64 = 2e-6;
const IDLE_RAD: f64 = 20e-6;
/// Step of the place from run to run. The golden ratio spreads the places of any number of runs evenly.
const GOLDEN: f64 = 0.618_033_988_749_894_8;
/// The place of less than half a run at the end of a movement, which only a whole log keeps.
const REST: f64 = 1.0;

/// Rows that follow each other in one movement.
#[derive(Debug)]
struct SampledRun {
    log: usize,
    /// Number of its movement.
    index: i64,
    /// Whether the movement begins with it.
    begins: bool,
    rows: Range<usize>,
    place: f64,
    stands_still: bool,
}

/// A log while it is read.
#[derive(Debug)]
struct SampledLog {
    /// Runs at places below this are kept.
    share: f64,
    /// Number of runs that move, and that stand still.
    counts: [usize; 2],
    /// Number of rows and movements.
    rows: usize,
    movements: usize,
}

impl SampledLog {
    const fn is_whole(&self) -> bool {
        self.share == f64::INFINITY
    }

    fn keeps(&self, run: &SampledRun) -> bool {
        let [moving, _] = self.counts;
        let is_wanted = moving == 0 || !run.stands_still;
        self.is_whole() || (run.place < self.share && is_wanted)
    }
}

/// Keeps a sample of the rows of logs.
#[derive(Debug)]
pub(super) struct Sampler {
    rows_max: usize,
    rows: Vec<Row>,
    runs: Vec<SampledRun>,
    /// The logs that were read, and the log in hand.
    logs: Vec<SampledLog>,
    sources: Vec<LogSource>,
    /// Number of rows that is too large.
    too_many: usize,
}

impl Sampler {
    /// Keeps all rows of logs with up to `rows_max` rows in all, and a quarter to half of `rows_max` rows of longer
    /// logs.
    pub(super) const fn new(rows_max: usize) -> Self {
        Self {
            rows_max,
            rows: Vec::new(),
            runs: Vec::new(),
            logs: Vec::new(),
            sources: Vec::new(),
            too_many: rows_max.saturating_add(1),
        }
    }

    /// A log begins.
    pub(super) fn begin_log(&mut self) {
        self.logs.push(SampledLog {
            share: f64::INFINITY,
            counts: [0; 2],
            rows: 0,
            movements: 0,
        });
    }

    /// Takes the next row of the log, with the number of its movement and whether the movement begins with it.
    pub(super) fn push(&mut self, index: i64, begins: bool, row: &Row) {
        if begins || self.runs.last().is_none_or(|run| run.rows.len() == RUN) {
            self.end_run();
            self.runs.push(SampledRun {
                log: self.logs.len().saturating_sub(1),
                index,
                begins,
                rows: self.rows.len()..self.rows.len(),
                // Decided at its end.
                place: 0.0,
                stands_still: false,
            });
        }
        self.rows.push(*row);
        if let Some(run) = self.runs.last_mut() {
            run.rows.end += 1;
        }
        if let Some(log) = self.logs.last_mut() {
            log.rows += 1;
            log.movements += usize::from(begins);
        }
        if self.rows.len() >= self.too_many {
            self.thin();
        }
    }

    /// Ends the log.
    pub(super) fn end_log(&mut self, mut source: LogSource) {
        self.end_run();
        if let Some(last) = self.logs.last() {
            (source.rows_read, source.movements_read) = (last.rows, last.movements);
        }
        self.sources.push(source);
    }

    /// Gives the last run its place.
    fn end_run(&mut self) {
        let here = self.logs.len();
        let (Some(run), Some(log)) = (self.runs.last_mut(), self.logs.last_mut()) else {
            return;
        };
        if run.log + 1 < here {
            // The log before saw to it.
            return;
        }
        let rows = self.rows.get(run.rows.clone()).unwrap_or_default();
        if !run.begins && rows.len() < RUN / 2 {
            run.place = REST;
        } else {
            run.stands_still = !moves(rows);
            let count = &mut log.counts[usize::from(run.stands_still)];
            run.place = (*count as f64 * GOLDEN).fract();
            *count += 1;
        }
        if !log.keeps(run) {
            self.rows.truncate(run.rows.start);
            self.runs.pop();
        }
    }

    /// Halves the share of the log that has most rows until half of the rows that may be held are
    /// left, or no log has more than a run.
    fn thin(&mut self) {
        loop {
            let mut rows = vec![0; self.logs.len()];
            for run in self.runs.iter().filter(|run| self.logs[run.log].keeps(run)) {
                rows[run.log] += run.rows.len();
            }
            let left: usize = rows.iter().sum();
            let longest = rows.iter().enumerate().max_by_key(|(_, rows)| **rows);
            match longest {
                Some((log, rows)) if left > self.rows_max / 2 && *rows > RUN => {
                    let share = &mut self.logs[log].share;
                    *share = f64::min(*share / 2.0, 1.0);
                }
                _ => break,
            }
        }
        self.drop_rows();
        self.too_many = (self.rows_max + 1).max(2 * self.rows.len());
    }

    /// Drops the rows that are not kept.
    fn drop_rows(&mut self) {
        let mut end = 0;
        self.runs.retain_mut(|run| {
            let keeps = self.logs[run.log].keeps(run);
            if keeps {
                let length = run.rows.len();
                self.rows.copy_within(run.rows.clone(), end);
                run.rows = end..end + length;
                end += length;
            }
            keeps
        });
        self.rows.truncate(end);
    }

    /// What was kept: the movements of whole logs, and the runs of others, each a movement by itself.
    pub(super) fn into_dataset(mut self, sha256: [u8; 32]) -> Dataset {
        if self.logs.iter().any(|log| !log.is_whole()) {
            self.thin();
        }
        let mut movements: Vec<Movement> = Vec::new();
        for run in &self.runs {
            match movements.last_mut() {
                Some(last) if !run.begins && self.logs[run.log].is_whole() => {
                    last.rows.end = run.rows.end;
                }
                _ => movements.push(Movement {
                    log: run.log,
                    index: run.index,
                    rows: run.rows.clone(),
                }),
            }
        }
        for (number, movement) in movements.iter().enumerate() {
            let rows = self.rows.get_mut(movement.rows.clone()).unwrap_or_default();
            let first = rows.first().map_or(0, |row| row.frame.sequence());
            for row in rows {
                row.movement = number;
                let sequence = row.frame.sequence().wrapping_sub(first);
                row.frame = row.frame.with_sequence(sequence);
            }
        }
        for (log, source) in self.sources.iter_mut().enumerate() {
            let end = |log| {
                let runs = self.runs.partition_point(|run| run.log < log);
                runs.checked_sub(1).map_or(0, |run| self.runs[run].rows.end)
            };
            source.rows = end(log)..end(log + 1);
        }
        Dataset {
            rows: self.rows,
            movements,
            logs: self.sources,
            sha256,
            temperature: Temperature::NONE,
        }
    }
}

/// Whether the stage moves in any of the six axes between any two of the rows.
fn moves(rows: &[Row]) -> bool {
    const IDLE: [f64; 6] = [IDLE_M, IDLE_M, IDLE_RAD, IDLE_M, IDLE_RAD, IDLE_RAD];
    let looked_at = || rows.iter().step_by(rows.len().div_ceil(LOOKED_AT).max(1));
    let pose = |row: &Row, k: usize| [row.reference, row.vertical].as_flattened()[k];
    let span = |k: usize| stage::Range::around(looked_at().map(|row| pose(row, k))).width();
    (0..6).any(|k| span(k) >= IDLE[k])
}

#[cfg(test)]
mod tests;
