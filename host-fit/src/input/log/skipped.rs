//! Rows that were left out, as the user asked: how many, why, and the first of each reason.

use super::cell::CellFault;
use super::error::{CellPlace, LogError};
use super::warning::{LogWarning, SkipReason};
use crate::input::dataset::Movement;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// The rows of one log that were left out.
#[derive(Debug, Default)]
pub(super) struct Skipped {
    reasons: Vec<(SkipReason, usize, Box<CellPlace>)>,
    by_movement: BTreeMap<i64, usize>,
    first: Option<(CellFault, Box<CellPlace>)>,
}

impl Skipped {
    /// Counts a row; `place` is asked for only where it is kept.
    pub(super) fn add(
        &mut self,
        fault: CellFault,
        movement: Option<i64>,
        place: impl FnOnce() -> Box<CellPlace>,
    ) {
        if let Some(movement) = movement {
            *self.by_movement.entry(movement).or_default() += 1;
        }
        let reason = SkipReason::from(&fault);
        if let Some((_, rows, _)) = self.reasons.iter_mut().find(|(r, ..)| *r == reason) {
            *rows += 1;
            return;
        }
        let place = place();
        self.reasons.push((reason, 1, place.clone()));
        self.first.get_or_insert((fault, place));
    }

    /// How many rows were left out.
    pub(super) fn rows(&self) -> usize {
        self.reasons.iter().map(|(_, rows, _)| rows).sum()
    }

    /// A log of which nothing is left: why, or that it had no rows at all.
    pub(super) fn nothing_left(self, path: &Path, header_line: usize) -> LogError {
        let rows = self.rows();
        let path = path.to_path_buf();
        match self.first {
            Some((fault, place)) => LogError::NoGoodRows {
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

    /// Warnings, given the movements of the log that have rows.
    pub(super) fn warnings(self, path: &Path, kept: &[Movement]) -> Vec<LogWarning> {
        let skipped =
            self.reasons
                .into_iter()
                .map(|(reason, rows, first)| LogWarning::RowsSkipped {
                    reason,
                    rows,
                    first,
                });
        let kept: BTreeSet<i64> = kept.iter().map(|kept| kept.index).collect();
        let lost = self
            .by_movement
            .into_iter()
            .filter(|(movement, _)| !kept.contains(movement))
            .map(|(movement, rows)| LogWarning::MovementSkipped {
                path: path.to_path_buf(),
                movement,
                rows,
            });
        skipped.chain(lost).collect()
    }
}
