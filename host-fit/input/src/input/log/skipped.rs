//! Rows that were left out, as the user asked: how many, why, and the first of each reason.

use super::cell::CellFault;
use super::error::{CellPlace, LogError};
use crate::finding::{Code, Finding};
use std::path::Path;

/// So many movements of which nothing is left are named.
const MOVEMENTS_NAMED: usize = 10;

/// The rows of one log that were left out.
#[derive(Debug, Default)]
pub(super) struct Skipped {
    /// By reason: the first fault, and how many rows.
    reasons: Vec<(CellFault, Box<CellPlace>, usize)>,
    /// The movement in hand, and its rows that were left out, until one is kept.
    lost: Option<(i64, usize)>,
    /// The movement of the last row that was kept.
    kept: Option<i64>,
    /// The first movements of which nothing is left.
    named: Vec<String>,
    /// How many movements of which nothing is left there are, and their rows.
    all_lost: (usize, usize),
}

impl Skipped {
    /// Counts a row; `place` is asked for only where it is kept.
    pub(super) fn add(
        &mut self,
        fault: CellFault,
        movement: Option<i64>,
        place: impl FnOnce() -> Box<CellPlace>,
    ) {
        match (&mut self.lost, movement.filter(|_| movement != self.kept)) {
            (_, None) => {}
            (Some((lost, rows)), Some(movement)) if *lost == movement => *rows += 1,
            (_, Some(movement)) => {
                self.end_movement();
                self.lost = Some((movement, 1));
            }
        }
        let reason = fault.reason();
        let same = |(first, ..): &&mut (CellFault, _, _)| first.reason() == reason;
        match self.reasons.iter_mut().find(same) {
            Some((.., rows)) => *rows += 1,
            None => self.reasons.push((fault, place(), 1)),
        }
    }

    /// How many rows were left out.
    pub(super) fn rows(&self) -> usize {
        self.reasons.iter().map(|(.., rows)| rows).sum()
    }

    /// A log of which nothing is left: why, or that it had no rows at all.
    pub(super) fn nothing_left(self, path: &Path, header_line: usize) -> LogError {
        let rows = self.rows();
        let path = path.to_path_buf();
        match self.reasons.into_iter().next() {
            Some((fault, place, _)) => LogError::NoGoodRows {
                path,
                rows,
                first: Box::new(LogError::Cell { place, fault }),
            },
            None => LogError::HeaderOnly {
                path,
                line: header_line,
            },
        }
    }

    /// A row of this movement is kept.
    pub(super) fn keep(&mut self, movement: i64) {
        self.kept = Some(movement);
        self.lost = self.lost.filter(|(lost, _)| *lost != movement);
        self.end_movement();
    }

    /// Of the movement in hand no row was kept.
    fn end_movement(&mut self) {
        if let Some((movement, rows)) = self.lost.take() {
            let (movements, all) = self.all_lost;
            self.all_lost = (movements + 1, all + rows);
            if movements < MOVEMENTS_NAMED {
                self.named.push(movement.to_string());
            }
        }
    }

    /// What the user should know.
    pub(super) fn warnings(mut self, path: &Path) -> Vec<Finding> {
        self.end_movement();
        let mut warnings: Vec<Finding> = Vec::new();
        for (fault, first, rows) in &self.reasons {
            let message = format!(
                "{}: rows left out for {}: {rows} (the first: line {}, column {}, {})",
                path.display(),
                fault.reason(),
                first.line,
                first.column,
                first.name
            );
            warnings.push(Finding::new(Code::RowsSkipped, message).of(*rows as f64, "rows"));
        }
        let (movements, rows) = self.all_lost;
        if movements > 0 {
            let others = match movements.saturating_sub(MOVEMENTS_NAMED) {
                0 => String::new(),
                more => format!(" and {more} more"),
            };
            let message = format!(
                "{}: all rows of movement {}{others} are bad ({rows}), so nothing of it is left; record it again if its \
                 setting matters",
                path.display(),
                self.named.join(", "),
            );
            warnings.push(Finding::new(Code::RowsSkipped, message).of(rows as f64, "rows"));
        }
        warnings
    }
}
