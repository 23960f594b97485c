//! A record on its way into flash, word by word.

use super::flash::{self, Flash, Sector, WriteFault};
use super::record::{COMMIT, Record, SEAL, UNIT_BYTES};

/// What is left to do after a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// More words.
    More,
    /// Nothing: the record counts from the next start on, whatever happens to the power.
    Done,
}

/// A record that is being written: one word a step, so that a caller can do some between ticks.
///
/// The words of the record come first. Then all of them are compared with flash, and only if
/// none differs the commit word follows, and its seal.
#[derive(Debug)]
pub struct Writing {
    pub(super) sector: Sector,
    /// The record's first word in the sector.
    pub(super) first: usize,
    /// The word of the record that comes next.
    pub(super) next: usize,
    /// Words before the commit word.
    pub(super) body: usize,
}

impl Writing {
    pub(super) const fn new(sector: Sector, unit: usize, record: &Record) -> Self {
        Self {
            sector,
            first: unit * UNIT_BYTES / 4,
            next: 0,
            body: record.body_words(),
        }
    }

    /// Programs the next word and reads it back. `record` is the one that the writing was begun
    /// with.
    ///
    /// # Errors
    /// [`WriteFault`]; the record then does not count, and no other is begun before the next
    /// start has cleared up. A fault of the last two words leaves it to the next start whether
    /// the record counts.
    pub fn step(&mut self, flash: &mut impl Flash, record: &Record) -> Result<Step, WriteFault> {
        if self.next >= self.words() {
            return Ok(Step::Done);
        }
        let value = if self.next < self.body {
            record.word(self.next)
        } else if self.next == self.body {
            for index in 0..self.body {
                flash::expect(flash, self.sector, self.first + index, record.word(index))?;
            }
            COMMIT
        } else {
            SEAL
        };
        flash::program(flash, self.sector, self.first + self.next, value)?;
        self.next += 1;
        Ok(if self.next < self.words() {
            Step::More
        } else {
            Step::Done
        })
    }

    /// Words of the record; as many steps does it take.
    pub const fn words(&self) -> usize {
        self.body + 2
    }
}
