//! Logs of any length as they pass: all rows of short ones, and of long ones runs of rows that
//! follow each other, spread over all that moves.
//!
//! The k-th run that moves the stage in any axis has its place at the fractional part of k times the
//! golden ratio, and is kept while its place is below the share that is kept of its log. Where there
//! are too many rows, the share of the log that has most of them is halved. Whatever the share, the
//! runs that are kept are spread evenly over the log, a protocol that repeats is met in all its
//! phases, and nothing is random. Of a log in which nothing moves, the runs at rest are kept likewise.

use super::chunk::Sample;
use super::excerpt::{GOLDEN, RUN, looked_at, moves};
use crate::input::dataset::{Dataset, LogSource, Movement, Row, Scales};
use crate::input::stage::Stage;
use std::hash::{DefaultHasher, Hasher};
use std::ops::Range;

/// The place of what is kept of a whole log only: the end of a movement, less than half a run.
const REST: f64 = 1.0;

/// Rows that follow each other in one movement.
#[derive(Debug)]
struct Run {
    log: usize,
    /// Number of its movement.
    index: i64,
    /// Whether the movement begins with it.
    begins: bool,
    rows: Range<usize>,
    place: f64,
    stands_still: bool,
}

/// A log as far as it passed.
#[derive(Debug)]
struct Log {
    /// Runs at places below this are kept.
    share: f64,
    /// Runs so far that move, and that stand still.
    counts: [usize; 2],
    /// Of all its rows.
    digest: DefaultHasher,
}

impl Log {
    const fn is_whole(&self) -> bool {
        self.share == f64::INFINITY
    }

    fn keeps(&self, run: &Run) -> bool {
        let [moving, _] = self.counts;
        let is_wanted = moving == 0 || !run.stands_still;
        self.is_whole() || (run.place < self.share && is_wanted)
    }
}

/// Logs as they pass.
#[derive(Debug)]
pub struct Passing {
    scales: Scales,
    rows_max: usize,
    rows: Vec<Row>,
    runs: Vec<Run>,
    /// Those that passed, and the one that passes.
    logs: Vec<Log>,
    sources: Vec<LogSource>,
    /// Rows of all logs.
    passed: usize,
    /// The number of rows at which there are too many.
    too_many: usize,
}

impl Passing {
    /// Nothing yet; of logs with more than `rows_max` rows in all, half to all of so many are kept.
    pub fn new(stage: &Stage, rows_max: usize) -> Self {
        Self {
            scales: Scales::of(stage),
            rows_max,
            rows: Vec::new(),
            runs: Vec::new(),
            logs: Vec::new(),
            sources: Vec::new(),
            passed: 0,
            too_many: rows_max + 1,
        }
    }

    /// Rows of all logs so far.
    pub const fn passed(&self) -> usize {
        self.passed
    }

    /// The memory that is held, bytes.
    pub const fn bytes(&self) -> u64 {
        (self.rows.capacity() * size_of::<Row>() + self.runs.capacity() * size_of::<Run>()) as u64
    }

    /// A log begins to pass.
    pub fn begin_log(&mut self) {
        self.logs.push(Log {
            share: f64::INFINITY,
            counts: [0; 2],
            digest: DefaultHasher::new(),
        });
    }

    /// Takes the next row of the log: the number of its movement, whether that begins with it, its
    /// sequence number and its sample.
    pub fn push(&mut self, index: i64, begins: bool, sequence: u32, sample: &Sample) {
        self.passed += 1;
        if begins || self.runs.last().is_none_or(|run| run.rows.len() == RUN) {
            self.end_run();
            self.runs.push(Run {
                log: self.logs.len().saturating_sub(1),
                index,
                begins,
                rows: self.rows.len()..self.rows.len(),
                // Kept until its end, which tells.
                place: 0.0,
                stands_still: false,
            });
        }
        let row = self.scales.row(0, sample);
        self.rows.push(Row {
            frame: row.frame.with_sequence(sequence),
            ..row
        });
        if let Some(run) = self.runs.last_mut() {
            run.rows.end += 1;
        }
        if let Some(log) = self.logs.last_mut() {
            sample.hash(&mut log.digest);
        }
        if self.rows.len() >= self.too_many {
            self.thin();
        }
    }

    /// The log has passed. Tells which one before it had the same rows.
    pub fn end_log(&mut self, source: LogSource) -> Option<&LogSource> {
        self.end_run();
        self.sources.push(source);
        let (last, earlier) = self.logs.split_last()?;
        let digest = last.digest.finish();
        let same = earlier.iter().position(|log| log.digest.finish() == digest);
        same.and_then(|log| self.sources.get(log))
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
            run.stands_still = !moves(looked_at(rows.iter()).copied());
            let count = &mut log.counts[usize::from(run.stands_still)];
            run.place = (*count as f64 * GOLDEN).fract();
            *count += 1;
        }
        if !log.keeps(run) {
            self.rows.truncate(run.rows.start);
            self.runs.pop();
        }
    }

    /// Halves the share of the log that has most rows until a quarter of the rows that may be held is
    /// free, or no log has more than a run.
    fn thin(&mut self) {
        loop {
            let mut rows = vec![0; self.logs.len()];
            for run in self.runs.iter().filter(|run| self.logs[run.log].keeps(run)) {
                rows[run.log] += run.rows.len();
            }
            let left: usize = rows.iter().sum();
            let most = rows.iter().enumerate().max_by_key(|(_, rows)| **rows);
            match most {
                Some((log, rows)) if left > self.rows_max / 4 * 3 && *rows > RUN => {
                    let share = &mut self.logs[log].share;
                    *share = f64::min(*share / 2.0, 1.0);
                }
                _ => break,
            }
        }
        self.let_go();
        self.too_many = (self.rows_max + 1).max(2 * self.rows.len());
    }

    /// Lets go of the rows that are not kept.
    fn let_go(&mut self) {
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
    pub fn into_dataset(mut self, sha256: [u8; 32]) -> Dataset {
        self.let_go();
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
            whole: None,
        }
    }
}

#[cfg(test)]
#[path = "passing_tests.rs"]
mod tests;
