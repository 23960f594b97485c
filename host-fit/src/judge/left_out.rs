//! Rows that a fit left out of account: how many, and the longest stretch of them.

use std::ops::Range;

/// A stretch is made of blocks in which at least this part of the rows was left out, ...
const DENSE: f64 = 0.2;
/// ... and goes on across so many others: bad rows come out right where the motion passes zero.
const ACROSS: usize = 1;

/// Rows that follow each other.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Block {
    /// How many there are.
    pub rows: usize,
    /// How many of them were left out.
    pub left_out: usize,
    /// From the first to the last of these, by number.
    pub span: Range<usize>,
}

impl Block {
    /// Rows of a block, where their number is free: a second at 2 ms.
    pub const ROWS: usize = 500;

    /// Takes the next row; `number` is its number.
    pub const fn take(&mut self, number: usize, is_left_out: bool) {
        self.rows += 1;
        if is_left_out {
            if self.left_out == 0 {
                self.span.start = number;
            }
            self.span.end = number + 1;
            self.left_out += 1;
        }
    }
}

/// The rows that were left out of account.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct LeftOut {
    /// How many.
    pub rows: usize,
    /// Of so many.
    pub of: usize,
    /// The longest stretch in which many were left out, by number; else the first that was; empty
    /// if none was.
    pub stretch: Range<usize>,
    /// How many rows it has of those that were there to be left out.
    pub stretch_rows: usize,
}

impl LeftOut {
    /// Of blocks in the order of their rows.
    pub fn of_blocks(blocks: impl IntoIterator<Item = Block>) -> Self {
        let mut all = Self::default();
        let mut stretch = 0..0;
        let mut across = 0;
        for block in blocks {
            all.rows += block.left_out;
            all.of += block.rows;
            let is_dense = block.left_out > 0 && block.left_out as f64 >= DENSE * block.rows as f64;
            if is_dense {
                let start = match across <= ACROSS && !stretch.is_empty() {
                    true => stretch.start,
                    false => block.span.start,
                };
                stretch = start..block.span.end;
                across = 0;
            } else {
                across += 1;
            }
            let found = match is_dense {
                true => stretch.clone(),
                false => block.span.start..block.span.end.min(block.span.start + 1),
            };
            if found.len() > all.stretch.len() {
                all.stretch = found;
            }
        }
        all.stretch_rows = all.stretch.len();
        all
    }

    /// The part of the rows that was left out, or that lies in the longest stretch, whichever is
    /// larger.
    pub fn share(&self) -> f64 {
        self.rows.max(self.stretch_rows) as f64 / self.of.max(1) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn left_out(rows: usize, is_left_out: impl Fn(usize) -> bool) -> LeftOut {
        let block = |start: usize| {
            let mut block = Block::default();
            for row in start..(start + Block::ROWS).min(rows) {
                block.take(row, is_left_out(row));
            }
            block
        };
        LeftOut::of_blocks((0..rows).step_by(Block::ROWS).map(block))
    }

    #[test]
    fn the_longest_stretch_is_found_from_its_first_row_to_its_last() {
        let bad = |row: usize| match row {
            // A block in the middle comes out right.
            2_000..6_000 => row.is_multiple_of(3) && !(3_000..3_500).contains(&row),
            9_100..9_900 => true,
            _ => row == 20,
        };
        let found = left_out(20_000, bad);
        assert_eq!(found.stretch, 2_001..5_998);
        assert_eq!(found.rows, (0..20_000).filter(|row| bad(*row)).count());
        assert!((found.share() - 3_997.0 / 20_000.0).abs() < 1e-9);
    }

    #[test]
    fn scattered_rows_are_no_stretch() {
        let found = left_out(20_000, |row| row % 97 == 13);
        assert_eq!((found.rows, found.of), (207, 20_000));
        assert_eq!(found.stretch, 13..14);
        assert_eq!(left_out(1_000, |_| false).stretch, 0..0);
    }
}
