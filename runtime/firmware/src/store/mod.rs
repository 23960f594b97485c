//! Parameters in flash that are replaced without ever being absent.
//!
//! Two sectors of 16 KiB hold a journal of records, each with one blob of [`runtime::blob`]. A
//! new blob is appended as a new record; the committed record with the highest sequence number
//! whose CRC and full parameter check hold is the one that the controller runs. The creation
//! time in a blob decides nothing here. Whenever the power fails, the next start finds the old
//! blob or the new one, and the new one for certain once [`Step::Done`] was returned.
//!
//! ```text
//! start-up:  Store::start       settle what was interrupted, choose, erase if there is no room
//! update:    Record::room <- blob;  Store::update checks it;  Store::begin
//!            Writing::step, a few words between ticks;  Store::finish
//! ```
//!
//! # Format
//!
//! Numbers are little-endian. A sector begins with two words, and a record at a multiple of 64
//! bytes behind them; what is not mentioned is erased.
//!
//! | offset in the sector | bytes | what |
//! |---|---|---|
//! | 0 | 4 | `HJNL`: the sector was erased and is a journal; 0: it is about to be erased |
//! | 4 | 4 | `SEAL`: the word before was programmed to the end |
//! | 64 k | | record, k = 1 to 255 |
//!
//! | offset in the record | bytes | what |
//! |---|---|---|
//! | 0 | 4 | magic, `HREC` |
//! | 4 | 4 | sequence number, 1 to 2^32 - 2 |
//! | 8 | 4 | CRC of a blob that this record passes over wherever it is in an older one; 2^32 - 1: none |
//! | 12 | 4 | length n of the blob in bytes |
//! | 16 | 32 | serial number of the stage, filled up with zeros |
//! | 48 | n | blob |
//! | 48 + n | 0 to 3 | 0xFF, up to a whole word: N = n rounded up |
//! | 48 + N | 4 | CRC-32C (Castagnoli) of everything before it |
//! | 52 + N | 4 | commit word `COMT`; 0: never to be committed |
//! | 56 + N | 4 | `SEAL`: the word before was programmed to the end |
//!
//! A sector holds 36 records with the shortest blob (379 bytes), 31 with the 407 bytes of the
//! golden example, 23 with the 587 of its field model and 21 with the largest blob (656). So
//! many updates are made for one erase.
//!
//! A sector that begins with a plain blob (`HALL`), as a probe flashes it, is read as well. It
//! is older than any record, so whoever flashes a blob with a probe must erase a journal in the
//! other sector. Of two plain blobs the one with the later text `created` is newer, on a tie
//! the one in the first sector, as [`crate::slots`] chooses. No record is ever written into such a
//! sector: it is only erased.
//!
//! One of 14 words may hold the CRC of a blob in the same sector that has run for a second: words 2 to
//! 15, or the last ones of a sector with a plain blob. It is written if the sector is full and the
//! blob before is in the other one.
//!
//! # What survives
//!
//! - *The newest blob*: always. Its sector is not erased.
//! - *The blob before*, for going back: until the sector with the newest one is full. Then a
//!   start erases the other sector, and the blob before is lost if it was there: of two plain
//!   blobs, which each count as a full sector; after some eleven interrupted updates in a row
//!   (each takes up to 23 of the 255 units); after one and the same blob was written so often
//!   that it fills the sector. It is not lost before the newest has run ([`Store::prove`]). If the newest makes the
//!   program fault instead, the blob before runs in its place after every start, and no record
//!   says so, for there is no room: only a probe makes some.
//! - [`Store::start`] alone erases, and only if neither sector has room for the largest record.
//!   There is always room for one update after it, unless no sector may be erased or none can
//!   ([`Store::is_writable`]), or the newest blob has yet to run. When there is none left,
//!   updates are refused ([`Refused::NoRoom`]) until the next start.
//!
//! Going back is a new record with a copy of the blob before. Passing over a blob that made the
//! program fault is a new record too, with a copy of the one that runs in its place; where there
//! is no other, nothing is written, because the fault may have had another cause. A mark in the old
//! record would be a single word that decides alone: if the power fails while it is programmed,
//! it may read as set after one start and as not set after the next. A new record is protected
//! as an update is, one proof serves all three, and going back can be undone.
//!
//! # Worn words
//!
//! A word that does not program costs the update that meets it, and no more: the next start leaves
//! its place out, or its sector if it is one of the first two words and the newest blob is in the
//! other. A commit word that takes neither its value nor zero may count at one start and not at the
//! next, until the next record, which has a higher number. A seal that does not hold does no harm.
//!
//! # Bits that change after an interrupted operation
//!
//! What an interrupted operation leaves is not guaranteed (RM0090 rev. 21, section 3.6). A bit
//! may even read right after one start and wrong after the next, until it is programmed or
//! erased to the end; file systems on flash know such unstable bits (UBIFS). Therefore
//! - each word that decides has a seal behind it, and a start settles it before it chooses a
//!   record (`journal::settle`);
//! - no word that an interrupted operation may have touched is used for other contents;
//! - a sector is written into only if its first two words say that its erase has ended, and
//!   the first of them is overwritten before the next erase.
//!
//! # Taken from others
//!
//! The mark that an erase has ended is an idea of JFFS2, to overwrite a sector's magic before
//! its erase one of UBI, two blocks and a check over a whole commit of littlefs, and to erase
//! only when there is no room left of `sequential-storage`. That crate is not used: it appends
//! a new item right behind a torn one, whose header can swallow it (its issue 136), so a write
//! that it acknowledged may be gone after a restart. Here only a record that is whole says
//! where the next one begins.

mod blobs;
mod change;
mod check;
mod choice;
mod flash;
#[cfg(any(test, feature = "flash-model"))]
pub mod flash_model;
mod journal;
mod proof;
mod record;
mod writing;

pub use blobs::{Stored, readable};
pub use check::Check;
pub use flash::{Flash, FlashFault, SECTOR_BYTES, SECTOR_WORDS, Sector, WriteFault};
pub use journal::is_journal;
pub use record::Record;
pub use writing::{Step, Writing};

pub(crate) use blobs::stored_crc;

use record::MAX_UNITS;
use runtime::blob::BlobError;

/// A blob that would be used if it passed its check.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rejected {
    /// Sequence number; 0 for a plain blob.
    pub sequence: u32,
    /// Its sector.
    pub sector: Sector,
    /// Why.
    pub error: BlobError,
}

/// Why no record is written.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Refused {
    /// The blob is unsound, or of another stage.
    Blob(BlobError),
    /// Another sequence number is due: someone else was faster, or this was written already.
    Sequence {
        /// The one that is due.
        due: u32,
    },
    /// No room: the next start makes some.
    NoRoom,
    /// A write was begun and not finished, or the start found no place to write: nothing is written
    /// until the next start.
    Unsettled,
    /// There is no blob before the newest one that differs from it.
    NoPrevious,
}

/// What the two sectors hold, and what the next start will use.
#[derive(Debug)]
pub struct Store {
    check: Check,
    newest: Option<Stored>,
    previous: Option<Stored>,
    passed_over: Option<u32>,
    rejected: Option<Rejected>,
    /// Sequence number of the latest record that is whole, whether it can be used or not.
    latest: u32,
    /// The sector that is not erased and is written into first.
    active: Sector,
    writable: bool,
    fault: Option<WriteFault>,
}

impl Store {
    /// At start-up: settles what was interrupted, chooses a record, and erases a sector if neither
    /// has room for a record of the largest size. `check` may be the serial number of the stage
    /// alone. A plain blob is erased only where there is another to run: one of another stage or
    /// of a newer layout may be right for another program. The blob before the newest is erased
    /// only if the newest has run.
    ///
    /// Where no room can be made ([`Store::fault`]) the store is read as it is, and nothing is
    /// written until the next start.
    pub fn start(flash: &mut impl Flash, check: impl Into<Check>) -> Self {
        let check = check.into();
        let undecided = journal::settle(flash);
        let mut store = Self::read(flash, check);
        let spares = store.spares(flash);
        for spare in spares.into_iter().flatten() {
            if store.place_for(flash, MAX_UNITS).is_some() {
                break;
            }
            if store.is_kept(flash, spare) {
                store.writable = true;
                break;
            }
            match journal::renew(flash, spare) {
                Ok(()) => store = Self::read(flash, check),
                Err(fault) => store.fault = Some(fault),
            }
        }
        store.latest = store.latest.max(undecided);
        store.writable |= store.place_for(flash, MAX_UNITS).is_some();
        store.fault = store.fault.filter(|_| !store.writable);
        store
    }

    /// Whether records are written at all before the next start.
    pub const fn is_writable(&self) -> bool {
        self.writable
    }

    /// Whether there is room for a record of any size.
    pub fn has_room(&self, flash: &impl Flash) -> bool {
        self.place_for(flash, MAX_UNITS).is_some()
    }

    /// The blob that the next start will use.
    pub const fn newest(&self) -> Option<Stored> {
        self.newest
    }

    /// The blob before, if it is still there: the latest one that differs and was not passed
    /// over.
    pub const fn previous(&self) -> Option<Stored> {
        self.previous
    }

    /// The CRC of the blob that the newest record passes over, if it does.
    pub const fn passed_over(&self) -> Option<u32> {
        self.passed_over
    }

    /// The newest blob that fails its check and would otherwise be used.
    pub const fn rejected(&self) -> Option<Rejected> {
        self.rejected
    }

    /// Why nothing can be written, if start-up tried to make room.
    pub const fn fault(&self) -> Option<WriteFault> {
        self.fault
    }

    /// The sequence number that the next record must have; `None` after 2^32 - 2 of them.
    pub const fn due(&self) -> Option<u32> {
        match self.latest {
            0..0xffff_fffe => Some(self.latest + 1),
            _ => None,
        }
    }

    /// Where so many units go: the active sector first.
    #[inline(never)]
    fn place_for(&self, flash: &impl Flash, units: usize) -> Option<(Sector, usize)> {
        [self.active, self.active.other()]
            .into_iter()
            .find_map(|sector| Some((sector, journal::free_unit(flash, sector, units)?)))
    }
}

#[cfg(test)]
mod cut_tests;
#[cfg(test)]
mod fault_tests;
#[cfg(test)]
mod fuzz_tests;
#[cfg(test)]
pub(crate) mod tests;
