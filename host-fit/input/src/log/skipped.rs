//! Rows that are skipped because the user asked for it: how many, why, and the first of each reason.

use super::cell::CellFault;
use super::error::{LogError, LogProblem, Place};
use crate::finding::{Finding, Kind};
use std::collections::BTreeMap;
use std::path::Path;

/// The skipped rows of one log.
#[derive(Debug, Default)]
pub(super) struct Skipped {
    /// By reason: the first fault, its place, and how many rows.
    reasons: Vec<(CellFault, Box<Place>, usize)>,
    /// Movements without a row that is kept, and how many rows of each are skipped.
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

    /// How many rows are skipped.
    pub(super) fn rows(&self) -> usize {
        self.reasons.iter().map(|(.., rows)| rows).sum()
    }

    /// A log without a row that is kept: why, or that it has no rows at all.
    pub(super) fn nothing_left(self, path: &Path, header_line: usize) -> LogError {
        let rows = self.rows();
        match self.reasons.into_iter().next() {
            Some((fault, place, _)) => {
                let first = Box::new(place.refuse(fault.into()));
                Place::new(path, None).refuse(LogProblem::NoGoodRows { rows, first })
            }
            None => Place::new(path, header_line).refuse(LogProblem::HeaderOnly),
        }
    }

    /// A row of this movement is kept.
    pub(super) fn keep(&mut self, movement: i64) {
        self.kept = Some(movement);
        self.lost.remove(&movement);
    }

    /// Why rows are skipped, and which movements are lost.
    pub(super) fn findings(self, file: &str) -> Vec<Finding> {
        let reason = |(fault, first, rows): &(CellFault, Box<Place>, usize)| {
            let (column, name) = first.column.clone().unwrap_or_default();
            Finding::new(Kind::RowsSkipped {
                file: file.to_owned(),
                reason: fault.reason(),
                rows: *rows,
                line: first.line.unwrap_or_default(),
                column,
                name,
            })
        };
        let reasons = self.reasons.iter().map(reason);
        let lost = (!self.lost.is_empty()).then(|| {
            Finding::new(Kind::MovementsSkipped {
                file: file.to_owned(),
                movements: self.lost.keys().copied().collect(),
                rows: self.lost.values().sum(),
            })
        });
        reasons.chain(lost).collect()
    }
}
