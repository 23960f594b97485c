//! Rows that were left out, as the user asked: how many, why, and the first of each reason.

use super::cell::CellFault;
use super::error::{LogError, LogProblem, Place};
use crate::finding::{Code, Finding};
use std::collections::BTreeMap;
use std::path::Path;

/// So many movements of which nothing is left are named.
const MOVEMENTS_NAMED: usize = 10;

/// The rows of one log that were left out.
#[derive(Debug, Default)]
pub(super) struct Skipped {
    /// By reason: the first fault, and how many rows.
    reasons: Vec<(CellFault, Box<Place>, usize)>,
    /// Movements of which no row was kept yet, and how many were left out.
    lost: BTreeMap<i64, usize>,
    /// The movement of the last row that was kept.
    kept: Option<i64>,
}

impl Skipped {
    /// Counts a row; `place` is asked for only where it is kept.
    pub(super) fn add(
        &mut self,
        fault: CellFault,
        movement: Option<i64>,
        place: impl FnOnce() -> Box<Place>,
    ) {
        if let Some(movement) = movement.filter(|_| movement != self.kept) {
            *self.lost.entry(movement).or_default() += 1;
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
        match self.reasons.into_iter().next() {
            Some((fault, place, _)) => {
                let first = Box::new(place.refuse(fault.into()));
                Place::of(path, None).refuse(LogProblem::NoGoodRows { rows, first })
            }
            None => Place::of(path, header_line).refuse(LogProblem::HeaderOnly),
        }
    }

    /// A row of this movement is kept.
    pub(super) fn keep(&mut self, movement: i64) {
        self.kept = Some(movement);
        self.lost.remove(&movement);
    }

    /// What the user should know.
    pub(super) fn warnings(self, path: &Path) -> Vec<Finding> {
        let mut warnings: Vec<Finding> = Vec::new();
        for (fault, first, rows) in &self.reasons {
            let line = first.line.unwrap_or_default();
            let (column, name) = first.column.clone().unwrap_or_default();
            let message = format!(
                "{}: rows left out for {}: {rows} (the first: line {}, column {}, {})",
                path.display(),
                fault.reason(),
                line,
                column,
                name
            );
            warnings.push(Finding::new(Code::RowsSkipped, message).of(*rows as f64, "rows"));
        }
        if !self.lost.is_empty() {
            let rows: usize = self.lost.values().sum();
            let named = self.lost.keys().take(MOVEMENTS_NAMED).map(i64::to_string);
            let others = match self.lost.len().saturating_sub(MOVEMENTS_NAMED) {
                0 => String::new(),
                more => format!(" and {more} more"),
            };
            let message = format!(
                "{}: all rows of movement {}{others} are bad ({rows}), so nothing of it is left; record it again if its \
                 setting matters",
                path.display(),
                named.collect::<Vec<_>>().join(", "),
            );
            warnings.push(Finding::new(Code::RowsSkipped, message).of(rows as f64, "rows"));
        }
        warnings
    }
}
