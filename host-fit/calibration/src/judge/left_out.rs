//! Rows that a fit left out of account: how many, and the longest stretch of them.

/// A stretch is made of blocks in which at least this part of the rows was left out, ...
const DENSE: f64 = 0.2;
/// ... and goes on across so many others: bad rows come out right where the motion passes zero.
const ACROSS: usize = 1;

/// Where a row stands in the logs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RowPlace {
    /// Its number among the rows of all logs.
    pub row: usize,
    /// The number of its log.
    pub log: usize,
    /// Its movement, by the number that the log gives it.
    pub movement: i64,
    /// Its time in the log, us.
    pub t_us: i64,
}

/// From one row to another, both included.
pub type Stretch = (RowPlace, RowPlace);

/// Rows that follow each other.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Block {
    rows: usize,
    left_out: usize,
    /// From the first row that was left out to the last.
    span: Option<Stretch>,
}

impl Block {
    /// Rows of a block: a second at 2 ms.
    pub const ROWS: usize = 500;

    /// Takes the next row.
    pub fn take(&mut self, place: RowPlace, is_left_out: bool) {
        self.rows += 1;
        if is_left_out {
            self.left_out += 1;
            let first = self.span.map_or(place, |(first, _)| first);
            self.span = Some((first, place));
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
    /// The longest stretch in which many were left out; else the first row that was.
    pub stretch: Option<Stretch>,
    /// The stretch that the last dense block ends, and how many blocks came after it.
    open: Option<(Stretch, usize)>,
}

impl LeftOut {
    /// Takes the next block, in the order of the rows.
    pub fn take(&mut self, block: Block) {
        self.rows += block.left_out;
        self.of += block.rows;
        let is_dense = block.left_out as f64 >= DENSE * block.rows as f64;
        let found = match block.span {
            Some((first, last)) if is_dense => {
                let start = match self.open {
                    Some(((start, _), across)) if across <= ACROSS => start,
                    _ => first,
                };
                self.open = Some(((start, last), 0));
                (start, last)
            }
            span => {
                if let Some((_, across)) = &mut self.open {
                    *across += 1;
                }
                let Some((first, _)) = span else { return };
                (first, first)
            }
        };
        if self
            .stretch
            .is_none_or(|longest| length(longest) < length(found))
        {
            self.stretch = Some(found);
        }
    }

    /// How many rows the longest stretch has.
    pub fn stretch_rows(&self) -> usize {
        self.stretch.map_or(0, length)
    }

    /// The part of the rows that was left out, or that lies in the longest stretch, whichever is
    /// larger.
    pub fn share(&self) -> f64 {
        self.rows.max(self.stretch_rows()) as f64 / self.of.max(1) as f64
    }
}

const fn length((first, last): Stretch) -> usize {
    last.row + 1 - first.row
}

#[cfg(test)]
mod tests {
    use super::*;

    fn left_out(rows: usize, is_left_out: impl Fn(usize) -> bool) -> LeftOut {
        let mut all = LeftOut::default();
        for start in (0..rows).step_by(Block::ROWS) {
            let mut block = Block::default();
            for row in start..(start + Block::ROWS).min(rows) {
                let place = RowPlace {
                    row,
                    log: 0,
                    movement: 0,
                    t_us: 0,
                };
                block.take(place, is_left_out(row));
            }
            all.take(block);
        }
        all
    }

    fn rows(found: &LeftOut) -> Option<[usize; 2]> {
        found.stretch.map(|(first, last)| [first.row, last.row])
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
        assert_eq!(rows(&found), Some([2_001, 5_997]));
        assert_eq!(found.rows, (0..20_000).filter(|row| bad(*row)).count());
        assert!((found.share() - 3_997.0 / 20_000.0).abs() < 1e-9);
    }

    #[test]
    fn scattered_rows_are_no_stretch() {
        let found = left_out(20_000, |row| row % 97 == 13);
        assert_eq!((found.rows, found.of), (207, 20_000));
        assert_eq!(rows(&found), Some([13, 13]));
        assert_eq!(left_out(1_000, |_| false).stretch, None);
    }
}
