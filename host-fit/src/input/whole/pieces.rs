//! A long log in pieces that can be held as rows.

use super::Whole;
use crate::input::dataset::{Dataset, LogSource, Movement};
use crate::input::log::sequence;
use std::ops::Range;

/// Rows of a piece, about: 12 s, few enough for the cache of a core.
pub const ROWS: usize = 6_000;

/// Movements of a log that follow each other, or a part of one.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Piece {
    /// Numbers of its movements.
    pub movements: Range<usize>,
    /// Its rows. The part of a movement begins with the last row of the part before.
    pub rows: Range<usize>,
    /// Whether it is a part of one movement.
    pub is_part: bool,
}

impl Whole {
    /// A log in pieces, in the order of their rows.
    pub fn pieces(&self, log: usize) -> Vec<Piece> {
        let mut pieces: Vec<Piece> = Vec::new();
        for (number, movement) in self.movements.iter().enumerate() {
            if movement.log != log {
                continue;
            }
            let (Range { start, end }, movements) = (movement.rows.clone(), number..number + 1);
            if movement.rows.len() > ROWS {
                // Counted from the end, where rests are looked for.
                let parts = movement.rows.len().div_ceil(ROWS);
                pieces.extend((0..parts).rev().map(|part| {
                    let first = end.saturating_sub((part + 1) * ROWS).max(start);
                    Piece {
                        movements: movements.clone(),
                        rows: first.saturating_sub(1).max(start)..end - part * ROWS,
                        is_part: true,
                    }
                }));
                continue;
            }
            match pieces.last_mut() {
                Some(last) if !last.is_part && end - last.rows.start <= ROWS => {
                    last.rows.end = end;
                    last.movements.end = number + 1;
                }
                _ => pieces.push(Piece {
                    movements,
                    rows: start..end,
                    is_part: false,
                }),
            }
        }
        pieces
    }

    /// The rows of a piece as those of one log; sequence numbers begin with 0, and count periods of
    /// `period_us`.
    pub fn piece(&self, piece: &Piece, period_us: f64) -> Dataset {
        let mut dataset = Dataset::default();
        for (number, movement) in self.movements[piece.movements.clone()].iter().enumerate() {
            let start = dataset.rows.len();
            let rows =
                movement.rows.start.max(piece.rows.start)..movement.rows.end.min(piece.rows.end);
            dataset.rows.reserve(rows.len());
            let held = &mut dataset.rows;
            self.rows_of(number, rows).for_each(|row| held.push(row));
            dataset.movements.push(Movement {
                log: 0,
                index: movement.index,
                rows: start..dataset.rows.len(),
            });
        }
        sequence::number_by(&mut dataset.rows, dataset.movements.iter(), period_us);
        if let Some(first) = self.movements.get(piece.movements.start) {
            dataset.logs.push(LogSource {
                rows: 0..dataset.rows.len(),
                ..self.logs[first.log].clone()
            });
        }
        dataset
    }
}
