//! Whether the newest blob has run, without which the blob before it is not erased.
//!
//! The word that says so decides about an erase only, and never which blob is used: whatever a cut
//! of the power makes of it, the blob before is erased as if the newest one had run, which it has, or
//! it is written again after another start.

use super::flash::{self, BLANK, Flash, SECTOR_WORDS, Sector, word_of};
use super::record::{MAX_UNITS, UNIT_BYTES};
use super::{Store, Stored, journal, stored_crc};
use core::ops::Range;

/// Words of a sector that may say so: those of the first unit behind the journal's two.
const WORDS: usize = UNIT_BYTES / 4 - 2;

/// Where they are: of a sector with a plain blob, at its end.
fn words(flash: &impl Flash, sector: Sector) -> Range<usize> {
    if journal::is_journal(flash.bytes(sector)) {
        2..2 + WORDS
    } else {
        SECTOR_WORDS - WORDS..SECTOR_WORDS
    }
}

/// Whether a blob is known to have run, by its CRC in one of these words. If all of them hold
/// something else, none can say so any more: it counts as proven.
fn is_proven(flash: &impl Flash, blob: Stored) -> bool {
    let crc = stored_crc(blob.blob(flash));
    let bytes = flash.bytes(blob.sector);
    let mut words = words(flash, blob.sector).map(|word| word_of(bytes, word));
    words.clone().any(|word| Some(word) == crc) || words.all(|word| word != BLANK)
}

impl Store {
    /// Whether a sector holds the blob before the newest, and the newest is not known to have run; or
    /// the blob that is suspected, in place of which the newest runs.
    #[inline(never)]
    pub(super) fn is_kept(&self, flash: &impl Flash, sector: Sector) -> bool {
        if self.check.suspect.is_some() {
            // After a cut of the power, when nobody suspects it any more, the first word of that
            // sector might read as it was at one start and not at the next.
            let of_suspect = |blob: super::Rejected| blob.sector == sector;
            return self.newest.is_some() && self.rejected.is_some_and(of_suspect);
        }
        (self.previous).is_some_and(|previous| previous.sector == sector)
            && (self.newest).is_some_and(|newest| !is_proven(flash, newest))
    }

    /// Takes note that [`Store::newest`] has run long enough to be proven. Programs one word, two if
    /// the first is worn, and only if the next start could otherwise make no room.
    pub fn prove(&self, flash: &mut impl Flash) {
        let Some(newest) = self.newest.filter(|_| self.check.suspect.is_none()) else {
            return;
        };
        let sector = newest.sector;
        if self.place_for(flash, MAX_UNITS).is_some() || !self.is_kept(flash, sector.other()) {
            return;
        }
        let crc = stored_crc(newest.blob(flash)).unwrap_or(BLANK);
        // One that was cut off is left as it is, and one that is worn stays blank.
        let is_blank = |word: &usize| word_of(flash.bytes(sector), *word) == BLANK;
        let mut blank = words(flash, sector).filter(is_blank);
        for word in [blank.next(), blank.next()].into_iter().flatten() {
            if flash::program(flash, sector, word, crc).is_ok() {
                break;
            }
        }
    }
}
