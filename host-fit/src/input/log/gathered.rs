//! Rows of logs as they are read: as they are, or as samples once there are too many.

use super::sequence;
use super::warning::LogWarning;
use crate::input::dataset::{Dataset, LogSource, Movement, Row, Scales};
use crate::input::stage::Stage;
use crate::input::whole::chunk::Sample;
use crate::input::whole::{Samples, Whole};
use std::ops::Range;
use std::sync::Arc;

/// Of so many rows that may be held, an excerpt takes one.
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

    /// Adds a row.
    pub(super) fn push(&mut self, row: Row) {
        if !self.samples.is_empty() {
            self.samples.push(&Sample::of(&row));
            return;
        }
        self.rows.push(row);
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

    /// Tells the rows of these movements which one they belong to.
    pub(super) fn name_movements(&mut self, movements: Range<usize>) {
        for movement in movements {
            let rows = self.movements[movement].rows.clone();
            for row in self.rows.get_mut(rows).unwrap_or_default() {
                row.movement = movement;
            }
        }
    }

    /// Ends a log: its movements are those from `first_movement` on.
    pub(super) fn end(
        &mut self,
        source: LogSource,
        first_movement: usize,
        warnings: &mut Vec<LogWarning>,
    ) {
        let movements = self.movements.get(first_movement..).unwrap_or_default();
        if self.samples.is_empty() {
            let period_s = self.servo_period_s;
            sequence::number(&mut self.rows, movements, &source, period_s, warnings);
        }
        self.logs.push(source);
    }

    /// What a fit takes: all rows, or an excerpt, which is told.
    pub(super) fn into_dataset(
        self,
        sha256: [u8; 32],
        warnings: &mut Vec<LogWarning>,
    ) -> Dataset {
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
        let mut dataset = whole.excerpt(rows_max / EXCERPT_PART, sha256);
        let mut odd = Vec::new();
        for (log, source) in dataset.logs.iter().enumerate() {
            let of_log = |movement: &&Movement| movement.log == log;
            let movements: Vec<Movement> =
                dataset.movements.iter().filter(of_log).cloned().collect();
            sequence::number(
                &mut dataset.rows,
                &movements,
                source,
                servo_period_s,
                &mut odd,
            );
        }
        odd.retain(|warning| !warnings.contains(warning));
        warnings.extend(odd);
        warnings.push(LogWarning::Excerpt {
            rows: whole.rows(),
            taken: dataset.rows.len(),
            runs: dataset.movements.len(),
        });
        dataset
    }
}
