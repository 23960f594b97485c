//! Rows that were left out, as the user asked: how many, why, and the first of each reason.

use super::cell::CellFault;
use super::error::{CellPlace, LogError};
use super::order::MOVEMENTS_MAX;
use super::warning::{LogWarning, SkipReason};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// So many movements of which nothing is left are told one by one.
const MOVEMENTS_TOLD: usize = 10;

/// The rows of one log that were left out.
#[derive(Debug, Default)]
pub(super) struct Skipped {
    reasons: Vec<(SkipReason, usize, Box<CellPlace>)>,
    by_movement: BTreeMap<i64, usize>,
    /// Movements that have rows which are kept.
    kept: BTreeSet<i64>,
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
        // A hostile log has a new number in each row.
        if let Some(movement) = movement
            && (self.by_movement.len() < MOVEMENTS_MAX || self.by_movement.contains_key(&movement))
        {
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

    /// A movement has a row that is kept.
    pub(super) fn keep(&mut self, movement: i64) {
        self.kept.insert(movement);
    }

    /// What the user should know.
    pub(super) fn warnings(self, path: &Path) -> Vec<LogWarning> {
        let skipped =
            self.reasons
                .into_iter()
                .map(|(reason, rows, first)| LogWarning::RowsSkipped {
                    reason,
                    rows,
                    first,
                });
        let mut warnings: Vec<LogWarning> = skipped.collect();
        let is_lost = |(movement, _): &(i64, usize)| !self.kept.contains(movement);
        let mut lost = self.by_movement.into_iter().filter(is_lost);
        let told = lost.by_ref().take(MOVEMENTS_TOLD);
        warnings.extend(told.map(|(movement, rows)| LogWarning::MovementSkipped {
            path: path.to_path_buf(),
            movement,
            rows,
        }));
        let (movements, rows) = lost.fold((0, 0), |(n, sum), (_, rows)| (n + 1, sum + rows));
        if movements > 0 {
            warnings.push(LogWarning::MovementsSkipped {
                path: path.to_path_buf(),
                movements,
                rows,
            });
        }
        warnings
    }
}
