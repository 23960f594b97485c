//! The journal in a sector: where records are, where the next one goes, and what an interrupted
//! operation left.

use super::blobs::stored_crc;
use super::flash::{self, Flash, SECTOR_BYTES, Sector, WriteFault, word_of};
use super::record::{COMMIT, MAX_UNITS, SEAL, UNIT_BYTES, VOIDED, View};

/// First word of a sector that was erased and holds a journal.
const JOURNAL: u32 = u32::from_le_bytes(*b"HJNL");
/// First word of a sector that is about to be erased.
const DROPPED: u32 = 0;
/// Units of a sector. The first one holds the sector's two words.
pub(super) const SECTOR_UNITS: usize = SECTOR_BYTES / UNIT_BYTES;
/// Units of both sectors.
pub(super) const UNITS: usize = 2 * SECTOR_UNITS;

/// Where a record is: of two with the same sequence number the later place counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Place {
    pub(super) sequence: u32,
    /// Of all units of both sectors.
    index: usize,
}

impl Place {
    pub(super) const fn new(sequence: u32, sector: Sector, unit: usize) -> Self {
        let index = sector as usize * SECTOR_UNITS + unit;
        Self { sequence, index }
    }

    pub(super) const fn sector(self) -> Sector {
        if self.index < SECTOR_UNITS {
            Sector::First
        } else {
            Sector::Second
        }
    }

    pub(super) const fn unit(self) -> usize {
        self.index % SECTOR_UNITS
    }

    /// Higher for the one that counts.
    const fn rank(self) -> u64 {
        (self.sequence as u64) << 32 | self.index as u64
    }
}

/// Whether the sector holds a journal.
pub fn is_journal(bytes: &[u8]) -> bool {
    word_of(bytes, 0) == JOURNAL
}

/// The record at a place.
pub(super) fn view<F: Flash>(flash: &F, place: Place) -> Option<View<'_>> {
    View::at(flash.bytes(place.sector()), place.unit())
}

/// What looks like a record, of all units of both sectors the one with this index.
#[inline(never)]
fn record_at<F: Flash>(flash: &F, index: usize) -> Option<(Place, View<'_>)> {
    let place = Place { sequence: 0, index };
    let bytes = flash.bytes(place.sector());
    let view = view(flash, place).filter(|_| place.unit() > 0 && is_journal(bytes))?;
    let sequence = view.sequence();
    Some((Place { sequence, index }, view))
}

/// What looks like a committed record.
#[inline(never)]
fn marked_at<F: Flash>(flash: &F, index: usize) -> Option<(Place, View<'_>)> {
    record_at(flash, index).filter(|(_, view)| view.commit() == COMMIT)
}

/// The committed record below `bound` with the highest sequence number whose CRC holds.
#[inline(never)]
pub(super) fn highest_committed(flash: &impl Flash, bound: Option<Place>) -> Option<Place> {
    let mut bound = bound.map_or(u64::MAX, Place::rank);
    for _ in 0..UNITS {
        let mut highest = None;
        let mut rank = 0;
        for index in 0..UNITS {
            if let Some((place, _)) = marked_at(flash, index)
                && place.rank() < bound
                && place.rank() > rank
            {
                (highest, rank) = (Some(place), place.rank());
            }
        }
        if view(flash, highest?)?.is_sound() {
            return highest;
        }
        bound = rank;
    }
    None
}

/// Whether a committed record passes over a blob that is in an older one, of this sequence number; 0
/// for a plain blob.
#[inline(never)]
pub(super) fn is_passed_over(flash: &impl Flash, sequence: u32, blob: &[u8]) -> bool {
    let crc = stored_crc(blob);
    crc.is_some()
        && (0..UNITS).any(|index| {
            marked_at(flash, index).is_some_and(|(place, view)| {
                view.passed_over() == crc && place.sequence > sequence && view.is_sound()
            })
        })
}

/// Whether a unit reads as erased. By words: all of a sector is looked at in one tick.
fn is_blank(unit: &[u8]) -> bool {
    let words = unit.as_chunks::<16>().0;
    words
        .iter()
        .all(|word| u128::from_le_bytes(*word) == u128::MAX)
}

/// Where a record of so many units can be written.
///
/// Behind a record that is whole, the next unit. Behind anything else the interrupted operation
/// may have touched a word that reads as blank and is not: it lies within the largest record
/// after the last word that is not blank, and that much is left out. Where only the first word
/// was touched, that same word is programmed again.
#[inline(never)]
pub(super) fn free_unit(flash: &impl Flash, sector: Sector, units: usize) -> Option<usize> {
    let bytes = flash.bytes(sector);
    if !is_journal(bytes) || word_of(bytes, 1) != SEAL {
        return None;
    }
    let used = bytes
        .chunks_exact(UNIT_BYTES)
        .rposition(|unit| !is_blank(unit))?;
    let first = Place::new(0, sector, 0).index;
    let last = (first..first + SECTOR_UNITS)
        .rev()
        .find_map(|index| marked_at(flash, index))
        .filter(|(_, view)| view.is_sealed());
    let free = match last.map(|(place, view)| place.unit() + view.units()) {
        Some(end) if end > used => end,
        _ if used == 0 => 1,
        _ => used + MAX_UNITS,
    };
    (free + units <= SECTOR_UNITS).then_some(free)
}

/// Makes final, after power-on, what an interrupted operation may have left undecided. Gives the
/// highest sequence number of a whole record whose commit word could not be made final; 0: none.
///
/// A bit that was being programmed when the power failed may read as 0 now and as 1 the next
/// time. So a word that decides (the sector's first, a record's commit word) is followed by a
/// seal that is written once that word was programmed to the end. Where the seal is
/// missing, the word is programmed again and then sealed, if it reads right; else it is
/// programmed to all zeros, which nothing can undo.
///
/// A worn word ends nothing. A sector whose seal does not hold is not written into. A commit word
/// without a seal is programmed again at every start, and what is written later lies behind its
/// record and has a higher number.
#[inline(never)]
pub(super) fn settle(flash: &mut impl Flash) -> u32 {
    for sector in Sector::ALL {
        let bytes = flash.bytes(sector);
        if is_journal(bytes) && word_of(bytes, 1) != SEAL {
            let _ = sealed(flash, sector, 0, JOURNAL);
        }
    }
    let mut undecided = 0;
    for index in 0..UNITS {
        let Some((place, view)) = record_at(flash, index) else {
            continue;
        };
        if view.commit() == VOIDED || view.is_sealed() || !view.is_sound() {
            continue;
        }
        let (sector, sequence) = (place.sector(), place.sequence);
        let word = place.unit() * UNIT_BYTES / 4 + view.body_words();
        let is_final = if view.commit() == COMMIT {
            sealed(flash, sector, word, COMMIT)
        } else {
            flash::program(flash, sector, word, VOIDED)
        };
        if is_final.is_err() {
            undecided = undecided.max(sequence);
        }
    }
    undecided
}

/// Programs a word and, after it, its seal.
#[inline(never)]
fn sealed(
    flash: &mut impl Flash,
    sector: Sector,
    word: usize,
    value: u32,
) -> Result<(), WriteFault> {
    flash::program(flash, sector, word, value)?;
    flash::program(flash, sector, word + 1, SEAL)
}

/// Makes a sector an empty journal. Its first word is dropped before, so that an interrupted
/// erase leaves no journal and no blob, whatever bits have risen.
#[inline(never)]
pub(super) fn renew(flash: &mut impl Flash, sector: Sector) -> Result<(), WriteFault> {
    flash::program(flash, sector, 0, DROPPED)?;
    flash::erase(flash, sector)?;
    sealed(flash, sector, 0, JOURNAL)
}

const _: () = assert!(SECTOR_BYTES.is_multiple_of(UNIT_BYTES) && UNIT_BYTES.is_multiple_of(16));
