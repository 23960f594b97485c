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
//! | 8 | 4 | sequence number that this record passes over, 0 for plain blobs; 2^32 - 1: none |
//! | 12 | 4 | length n of the blob in bytes; 0: no blob, the record only passes over another |
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
//! the one in the first sector, as [`crate::slots`] chooses. Such a sector is never written
//! into, only erased.
//!
//! # What survives
//!
//! - *The newest blob*: always. Its sector is not erased.
//! - *The blob before*, for going back: until the sector with the newest one is full. Then the
//!   next start erases the other sector, and the blob before is lost if it was there: at the
//!   first start with two plain blobs, which each count as a full sector; after some eleven
//!   interrupted updates in a row (each takes up to 23 of the 255 units); after one and the
//!   same blob was written so often that it fills the sector.
//! - [`Store::start`] alone erases, and only if neither sector has room for the largest record.
//!   There is always room for one update after it. When there is none left, updates are refused
//!   ([`Refused::NoRoom`]) until the next start.
//!
//! Going back is a new record with a copy of the blob before. Passing over a record that made
//! the program fault is a new record too, which names the other one; where there is no blob to
//! go back to, it has none, and the controller starts without parameters and can be given new
//! ones. A mark in the old record would be a single word that decides alone: if the power fails
//! while it is programmed, it may read as set after one start and as not set after the next. A
//! new record is protected as an update is, one proof serves all three, and going back can be
//! undone.
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
mod flash;
#[cfg(any(test, feature = "flash-model"))]
pub mod flash_model;
mod journal;
mod record;
mod writing;

pub use blobs::Stored;
pub use flash::{Flash, FlashFault, SECTOR_BYTES, SECTOR_WORDS, Sector, WriteFault};
pub use journal::is_journal;
pub use record::Record;
pub use writing::{Step, Writing};

use blobs::{checked, plain, plain_by_age, stored, unusable};
use journal::Place;
use record::{MAX_UNITS, UNIT_BYTES, View};
use runtime::blob::{BlobError, MAGIC};

/// Records before the newest one that are looked at for a good blob that differs.
const PREVIOUS_TRIED: usize = 8;

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
    /// A write was begun and not finished, or the flash failed at start-up: nothing is written
    /// until the next start.
    Unsettled,
    /// There is no blob before the newest one that differs from it.
    NoPrevious,
    /// There is no blob that could be passed over.
    NothingToPassOver,
}

/// What the two sectors hold, and what the next start will use.
#[derive(Debug)]
pub struct Store {
    serial: Option<&'static str>,
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
    /// has room for a record of the largest size. With a `serial`, blobs of other stages are
    /// refused. A plain blob is erased only where there is another to run: one of another stage or
    /// of a newer layout may be right for another program.
    ///
    /// After a fault of the flash ([`Store::fault`]) the store is read as it is, and nothing is
    /// written until the next start.
    pub fn start(flash: &mut impl Flash, serial: Option<&'static str>) -> Self {
        let mut fault = journal::settle(flash).err();
        let mut store = Self::read(flash, serial);
        if fault.is_none()
            && store.place_for(flash, MAX_UNITS).is_none()
            && let Some(spare) = store.spare(flash)
        {
            fault = journal::renew(flash, spare).err();
            store = Self::read(flash, serial);
        }
        store.writable = fault.is_none();
        store.fault = fault;
        store
    }

    /// Looks at the sectors as they are and writes nothing: [`Store::begin`] then refuses.
    pub fn read(flash: &impl Flash, serial: Option<&'static str>) -> Self {
        let mut store = Self {
            serial,
            newest: None,
            previous: None,
            passed_over: None,
            rejected: None,
            latest: 0,
            active: Sector::Second,
            writable: false,
            fault: None,
        };
        let highest = journal::highest_committed(flash, None);
        if let Some(place) = highest {
            (store.latest, store.active) = (place.sequence, place.sector());
        }
        let mut place = highest;
        for _ in 0..journal::UNITS {
            let Some((found, view)) = place.and_then(|at| Some((at, journal::view(flash, at)?)))
            else {
                break;
            };
            let Some(error) = unusable(&view, serial) else {
                store.active = found.sector();
                store.passed_over = view.passed_over();
                store.newest = stored(flash, found);
                store.previous = store.before(flash, found);
                return store;
            };
            store.reject(found.sequence, found.sector(), error);
            place = journal::highest_committed(flash, place);
        }
        for sector in Sector::ALL {
            if let Some(Err(error)) = plain(flash, sector, serial) {
                store.reject(0, sector, error);
            }
        }
        let [newest, other] = plain_by_age(flash, serial);
        if let Some(newest) = newest {
            store.active = newest.sector;
            store.previous = other.filter(|other| other.blob(flash) != newest.blob(flash));
        }
        store.newest = newest;
        store
    }

    /// Whether a record of any size can be written.
    pub fn has_room(&self, flash: &impl Flash) -> bool {
        self.writable && self.place_for(flash, MAX_UNITS).is_some()
    }

    /// The sector that a start may erase.
    fn spare(&self, flash: &impl Flash) -> Option<Sector> {
        if self.newest.is_some() || self.latest > 0 {
            return Some(self.active.other());
        }
        let is = |wanted: fn(&[u8]) -> bool| {
            Sector::ALL
                .into_iter()
                .find(|sector| wanted(flash.bytes(*sector)))
        };
        is(|bytes| bytes.iter().all(|byte| *byte == 0xff))
            .or_else(|| is(|bytes| !bytes.starts_with(&MAGIC)))
    }

    /// The blob that the next start will use.
    pub const fn newest(&self) -> Option<Stored> {
        self.newest
    }

    /// The blob before, if it is still there: the latest one that differs and was not passed
    /// over. After [`Store::pass_over`] it is known from the next start on.
    pub const fn previous(&self) -> Option<Stored> {
        self.previous
    }

    /// The sequence number of the record that the newest one passes over, if it does.
    pub const fn passed_over(&self) -> Option<u32> {
        self.passed_over
    }

    /// The newest blob that fails its check and would otherwise be used.
    pub const fn rejected(&self) -> Option<Rejected> {
        self.rejected
    }

    /// What start-up could not write or erase.
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

    /// Makes a record of the blob of `bytes` bytes in the record's room, after its full check. The
    /// sequence number must be the one that is due: of two that were made for the same store
    /// only one is written.
    ///
    /// # Errors
    /// [`Refused::Blob`], [`Refused::Sequence`].
    pub fn update(&self, record: &mut Record, bytes: usize, sequence: u32) -> Result<(), Refused> {
        if self.due() != Some(sequence) {
            return Err(self.not_due());
        }
        let serial = checked(record.staged(bytes), self.serial)
            .map_err(Refused::Blob)?
            .serial;
        record.close(sequence, None, &serial, bytes);
        Ok(())
    }

    /// Makes a record that goes back to [`Store::previous`].
    ///
    /// # Errors
    /// [`Refused::NoPrevious`], [`Refused::Blob`], [`Refused::Sequence`].
    pub fn go_back(&self, flash: &impl Flash, record: &mut Record) -> Result<(), Refused> {
        let previous = self.previous.ok_or(Refused::NoPrevious)?;
        self.copy(flash, previous, None, record)
    }

    /// Makes a record that passes over [`Store::newest`], because it made the program fault: with
    /// a copy of [`Store::previous`], or without a blob if there is none.
    ///
    /// # Errors
    /// [`Refused::NothingToPassOver`], [`Refused::Blob`], [`Refused::Sequence`].
    pub fn pass_over(&self, flash: &impl Flash, record: &mut Record) -> Result<(), Refused> {
        let newest = self.newest.ok_or(Refused::NothingToPassOver)?;
        if let Some(previous) = self.previous {
            return self.copy(flash, previous, Some(newest.sequence), record);
        }
        let sequence = self.due().ok_or(self.not_due())?;
        let serial = self.serial.unwrap_or_default();
        record.close(sequence, Some(newest.sequence), serial, 0);
        Ok(())
    }

    /// Begins to write a record. Nothing else may be written until [`Store::finish`].
    ///
    /// # Errors
    /// [`Refused::Unsettled`], [`Refused::NoRoom`], [`Refused::Sequence`].
    pub fn begin(&mut self, flash: &impl Flash, record: &Record) -> Result<Writing, Refused> {
        if self.due() != Some(record.sequence()) {
            return Err(self.not_due());
        }
        if !self.writable {
            return Err(Refused::Unsettled);
        }
        let (sector, unit) = (self.place_for(flash, record.units())).ok_or(Refused::NoRoom)?;
        self.writable = false;
        Ok(Writing::new(sector, unit, record))
    }

    /// Takes note of a record that was written. One that was not written to its end leaves the
    /// store as it is until the next start.
    pub fn finish(&mut self, flash: &impl Flash, writing: &Writing) {
        let unit = writing.first * 4 / UNIT_BYTES;
        let sector = writing.sector;
        let view = View::at(flash.bytes(sector), unit);
        let Some(view) = view.filter(|_| writing.next == writing.words()) else {
            return;
        };
        let sequence = view.sequence();
        let place = Place::new(sequence, sector, unit);
        let newest = stored(flash, place);
        let blob = newest.map_or(&[][..], |newest| newest.blob(flash));
        self.passed_over = view.passed_over();
        if self.passed_over.is_some() {
            self.previous = None;
        } else if let Some(old) = self.newest.filter(|old| old.blob(flash) != blob) {
            self.previous = Some(old);
        }
        self.newest = newest;
        (self.latest, self.active) = (sequence, sector);
        self.writable = true;
    }

    fn not_due(&self) -> Refused {
        let due = self.due().unwrap_or(u32::MAX);
        Refused::Sequence { due }
    }

    fn reject(&mut self, sequence: u32, sector: Sector, error: BlobError) {
        self.rejected.get_or_insert(Rejected {
            sequence,
            sector,
            error,
        });
    }

    /// Where so many units go: the active sector first.
    fn place_for(&self, flash: &impl Flash, units: usize) -> Option<(Sector, usize)> {
        [self.active, self.active.other()]
            .into_iter()
            .find_map(|sector| Some((sector, journal::free_unit(flash, sector, units)?)))
    }

    fn copy(
        &self,
        flash: &impl Flash,
        from: Stored,
        passed_over: Option<u32>,
        record: &mut Record,
    ) -> Result<(), Refused> {
        let sequence = self.due().ok_or(self.not_due())?;
        let blob = from.blob(flash);
        if let Some(room) = record.room().get_mut(..blob.len()) {
            room.copy_from_slice(blob);
        }
        let serial = checked(record.staged(from.bytes), self.serial)
            .map_err(Refused::Blob)?
            .serial;
        record.close(sequence, passed_over, &serial, from.bytes);
        Ok(())
    }

    /// The latest good blob before the record `newest` that differs from its blob and was not
    /// passed over; none behind a record without a blob.
    #[inline(never)]
    fn before(&self, flash: &impl Flash, newest: Place) -> Option<Stored> {
        let blob = stored(flash, newest)?.blob(flash);
        let mut bound = newest;
        for _ in 0..PREVIOUS_TRIED {
            let Some(place) = journal::highest_committed(flash, Some(bound)) else {
                break;
            };
            bound = place;
            let good = stored(flash, place).filter(|other| {
                other.blob(flash) != blob
                    && journal::view(flash, place)
                        .is_some_and(|view| unusable(&view, self.serial).is_none())
                    && !journal::is_passed_over(flash, place.sequence)
            });
            if good.is_some() {
                return good;
            }
        }
        plain_by_age(flash, self.serial)
            .into_iter()
            .flatten()
            .find(|plain| plain.blob(flash) != blob && !journal::is_passed_over(flash, 0))
    }
}

#[cfg(test)]
mod cut_tests;
#[cfg(test)]
mod fuzz_tests;
#[cfg(test)]
mod tests;
