//! How a new record comes about.

use super::blobs::{Stored, checked, stored};
use super::journal::Place;
use super::record::{Record, UNIT_BYTES, View};
use super::{Flash, Refused, Store, Writing};

impl Store {
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
        self.close(record, bytes, None)
    }

    /// Makes a record that goes back to [`Store::previous`].
    ///
    /// # Errors
    /// [`Refused::NoPrevious`], [`Refused::Blob`], [`Refused::Sequence`].
    pub fn go_back(&self, flash: &impl Flash, record: &mut Record) -> Result<(), Refused> {
        let previous = self.previous.ok_or(Refused::NoPrevious)?;
        self.copy(flash, previous, None, record)
    }

    /// Makes a record with a copy of [`Store::newest`] that passes over [`super::Check::suspect`], the
    /// blob that made the program fault.
    ///
    /// # Errors
    /// [`Refused::NoPrevious`], [`Refused::Blob`], [`Refused::Sequence`].
    pub fn pass_over(&self, flash: &impl Flash, record: &mut Record) -> Result<(), Refused> {
        let (Some(newest), Some(suspect)) = (self.newest, self.check.suspect) else {
            return Err(Refused::NoPrevious);
        };
        self.copy(flash, newest, Some(suspect), record)
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
    /// store as it is until the next start. After a record that passes over another, all records
    /// are looked at, which takes the time of a start-up.
    pub fn finish(&mut self, flash: &impl Flash, writing: &Writing) {
        let unit = writing.first * 4 / UNIT_BYTES;
        let sector = writing.sector;
        let view = View::at(flash.bytes(sector), unit);
        let Some(view) = view.filter(|_| writing.next == writing.words()) else {
            return;
        };
        let sequence = view.sequence();
        let place = Place::new(sequence, sector, unit);
        self.passed_over = view.passed_over();
        if self.passed_over.is_some() {
            self.previous = self.before(flash, place);
        } else if let Some(old) = self.newest.filter(|old| old.blob(flash) != view.blob()) {
            self.previous = Some(old);
        }
        self.newest = stored(flash, place);
        (self.latest, self.active) = (sequence, sector);
        self.writable = true;
    }

    fn not_due(&self) -> Refused {
        let due = self.due().unwrap_or(u32::MAX);
        Refused::Sequence { due }
    }

    fn copy(
        &self,
        flash: &impl Flash,
        from: Stored,
        passed_over: Option<u32>,
        record: &mut Record,
    ) -> Result<(), Refused> {
        let blob = from.blob(flash);
        if let Some(room) = record.room().get_mut(..blob.len()) {
            room.copy_from_slice(blob);
        }
        self.close(record, from.bytes, passed_over)
    }

    /// Makes the record that is due of the bytes in its room.
    fn close(
        &self,
        record: &mut Record,
        bytes: usize,
        passed_over: Option<u32>,
    ) -> Result<(), Refused> {
        let sequence = self.due().ok_or(self.not_due())?;
        let label = checked(record.staged(bytes), &self.check).map_err(Refused::Blob)?;
        record.close(sequence, passed_over, &label.serial, bytes);
        Ok(())
    }
}
