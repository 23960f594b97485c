//! A record on its way into flash, word by word.

use super::flash::{self, Flash, Sector, WriteFault};
use super::record::{COMMIT, Record, SEAL, UNIT_BYTES, VOIDED};

/// In place of a sequence number, where the word before it is worn. If this is cut off and the
/// place is used all the same, a sequence number below 2^31 programs the one bit to its end.
const UNUSED: u32 = 0x7fff_ffff;

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
    /// start has cleared up. Only if the commit word holds neither its value nor zero is it left
    /// to the next start whether the record counts.
    pub fn step(&mut self, flash: &mut impl Flash, record: &Record) -> Result<Step, WriteFault> {
        let value = match self.next.checked_sub(self.body) {
            None => record.word(self.next),
            Some(0) => {
                for index in 0..self.body {
                    flash::expect(flash, self.sector, self.first + index, record.word(index))?;
                }
                COMMIT
            }
            Some(1) => SEAL,
            Some(_) => return Ok(Step::Done),
        };
        let word = self.first + self.next;
        match flash::program(flash, self.sector, word, value) {
            // The commit word was read back, and a start seals it.
            Err(_) if self.next > self.body => {}
            Err(fault) => {
                self.give_up(flash);
                return Err(fault);
            }
            Ok(()) => {}
        }
        self.next += 1;
        Ok(if self.next < self.words() {
            Step::More
        } else {
            Step::Done
        })
    }

    /// After a word that did not program: the record must never count, and its place must not be
    /// tried again at the next start, as it would if it read as blank.
    fn give_up(&self, flash: &mut impl Flash) {
        let (word, value) = match self.next {
            0 => (self.first + 1, UNUSED),
            next if next == self.body => (self.first + next, VOIDED),
            _ => return,
        };
        // What else could be done?
        let _ = flash.program(self.sector, word, value);
    }

    /// Words of the record; as many steps does it take.
    pub const fn words(&self) -> usize {
        self.body + 2
    }
}
