//! The motion that a log commands in X, Y, Rz and measures in Z, Rx, Ry.

use hallstage_input::dataset::{Dataset, Movement};
use hallstage_input::log::LogRow;
use hallstage_solver::estimator::derivatives::SIDE_US;
use hallstage_solver::estimator::rows::measured_motion;
use runtime::CommandedMotion;
use runtime::frame::CodeWindow;

/// Rows that wait at most.
const PIECE_ROWS: usize = 8192;

/// Rows of a movement, with the commanded pose as reference. The last ones wait for the next rows, which give speed and
/// acceleration.
pub(super) struct Commanded {
    /// Codes of the gaps that show motion.
    gaps: CodeWindow,
    rows: Vec<LogRow>,
    waiting: usize,
}

impl Commanded {
    pub(super) const fn new(gaps: CodeWindow) -> Self {
        Self {
            gaps,
            rows: Vec::new(),
            waiting: 0,
        }
    }

    /// Takes a row, and gives the rows of known motion.
    pub(super) fn take(&mut self, row: LogRow) -> Vec<(LogRow, CommandedMotion)> {
        let is_due = row.begins || self.waiting >= PIECE_ROWS;
        let known = is_due.then(|| self.known(row.begins));
        self.rows.push(row);
        self.waiting += 1;
        known.unwrap_or_default()
    }

    /// The waiting rows of known motion: all at the end of a movement.
    pub(super) fn known(&mut self, is_end: bool) -> Vec<(LogRow, CommandedMotion)> {
        let known_us = match self.rows.last() {
            Some(last) if !is_end => last.row.t_us - SIDE_US,
            _ => i64::MAX,
        };
        let first = self.rows.len() - self.waiting;
        let next = first.max(self.rows.partition_point(|row| row.row.t_us < known_us));
        let (log, index, rows) = (0, 0, 0..self.rows.len());
        let dataset = Dataset {
            rows: self.rows.iter().map(|row| row.row).collect(),
            movements: vec![Movement { log, index, rows }],
            ..Dataset::default()
        };
        let is_sound = |row: &LogRow| {
            let gaps = row.row.frame.capacitive();
            gaps.is_none_or(|codes| codes.iter().all(|code| self.gaps.contains(*code)))
        };
        let sound: Vec<bool> = self.rows.iter().map(is_sound).collect();
        let motion = measured_motion(&dataset, &sound);
        let known = self.rows[first..next].iter().copied();
        let known = known.zip(motion.into_iter().skip(first)).collect();
        self.waiting = self.rows.len() - next;
        // The windows of the waiting rows reach back.
        let from_us = (self.rows.get(next)).map_or(i64::MAX, |row| row.row.t_us - 2 * SIDE_US);
        let over = self.rows.partition_point(|row| row.row.t_us < from_us);
        self.rows.drain(..over);
        known
    }
}
