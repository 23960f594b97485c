//! Rows of logs as they are read: as they are, or as samples once there are too many.

use super::parse::LogRow;
use super::sequence;
use super::warning::LogWarning;
use crate::input::dataset::{Dataset, LogSource, Movement, Row, Scales};
use crate::input::stage::Stage;
use crate::input::whole::chunk::Sample;
use crate::input::whole::{Samples, Whole};
use std::ops::Range;
use std::sync::Arc;

/// An excerpt takes one of so many rows, ...
const EXCERPT_OF: usize = 32;
/// ... but at least this part of the rows that may be held, and at most all of those.
const EXCERPT_PART: usize = 4;

/// The logs read so far.
pub(super) struct Gathered {
    scales: Scales,
    servo_period_s: f64,
    rows_max: Option<usize>,
    rows: Vec<Row>,
    /// All rows, once there are more than `rows_max`; then `rows` is empty.
    samples: Samples,
    pub(super) movements: Vec<Movement>,
    pub(super) logs: Vec<LogSource>,
}

impl Gathered {
    /// Nothing yet; of more than `rows_max` rows there will be an excerpt.
    pub(super) fn new(stage: &Stage, rows_max: Option<usize>) -> Self {
        Self {
            scales: Scales::of(stage),
            servo_period_s: stage.servo_period_s,
            rows_max,
            rows: Vec::new(),
            samples: Samples::default(),
            movements: Vec::new(),
            logs: Vec::new(),
        }
    }

    /// How many rows there are.
    pub(super) fn len(&self) -> usize {
        self.rows.len() + self.samples.len()
    }

    /// The memory that they take, bytes.
    pub(super) fn bytes(&self) -> u64 {
        let rows = self.rows.capacity() * size_of::<Row>();
        let movements = self.movements.capacity() * size_of::<Movement>();
        (rows + movements) as u64 + self.samples.bytes()
    }

    /// Adds the next row of a log that comes after those in `logs`.
    pub(super) fn push(&mut self, row: &LogRow<Sample>) {
        let at = self.len();
        match self.movements.last_mut() {
            Some(last) if !row.begins => last.rows.end = at + 1,
            _ => self.movements.push(Movement {
                log: self.logs.len(),
                index: row.movement,
                rows: at..at + 1,
            }),
        }
        if !self.samples.is_empty() {
            self.samples.push(&row.item);
            return;
        }
        let whole = self.scales.row(self.movements.len() - 1, &row.item);
        self.rows.push(Row {
            frame: whole.frame.with_sequence(row.sequence),
            ..whole
        });
        if self.rows_max.is_some_and(|most| self.rows.len() > most) {
            for row in std::mem::take(&mut self.rows) {
                self.samples.push(&Sample::of(&row));
            }
        }
    }

    /// The samples of some rows.
    pub(super) fn samples_of(&self, rows: Range<usize>) -> impl Iterator<Item = Sample> {
        let held = self.rows.get(rows.clone()).unwrap_or_default();
        held.iter().map(Sample::of).chain(self.samples.of(rows))
    }

    /// What a fit takes: all rows, or an excerpt, which is told.
    pub(super) fn into_dataset(self, sha256: [u8; 32], warnings: &mut Vec<LogWarning>) -> Dataset {
        let Self {
            scales,
            servo_period_s,
            rows,
            samples,
            movements,
            logs,
            ..
        } = self;
        let Some(rows_max) = self.rows_max.filter(|_| !samples.is_empty()) else {
            return Dataset {
                rows,
                movements,
                logs,
                sha256,
                whole: None,
            };
        };
        let whole = Arc::new(Whole::new(scales, samples, movements, logs));
        let most = (whole.rows() / EXCERPT_OF).clamp(rows_max / EXCERPT_PART, rows_max);
        let mut dataset = whole.excerpt(most, sha256);
        sequence::number_logs(&mut dataset, servo_period_s);
        warnings.push(LogWarning::Excerpt {
            rows: whole.rows(),
            taken: dataset.rows.len(),
            runs: dataset.movements.len(),
        });
        dataset
    }
}
