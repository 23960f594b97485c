//! The parameters that the controller keeps in flash: which it runs, and new ones that come over
//! the bus.

use crate::slots::{self, Loaded, Refusal};
use crate::store::{self, Check, Flash, Record, Sector, Step, Store, Stored, Writing};
use hal_adapters::can::update::{self, Change, Kept, Running, Written, crc_of};
use runtime::blob::MAGIC;

/// Words that are programmed in one tick: 0.2 ms at most on an STM32F405 (DS8626, flash memory
/// programming), in which the core stands.
const WORDS_PER_TICK: usize = 2;

/// The store with its flash.
#[derive(Debug)]
pub struct Records<F> {
    flash: F,
    store: Store,
    running: Option<(Stored, &'static Loaded)>,
    record: &'static mut Record,
    /// Whether the record is put together.
    is_ready: bool,
    writing: Option<Writing>,
}

/// What the start-up found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Found {
    /// The blob to run, if there is one.
    pub blob: Option<Stored>,
    /// The worst that is to be told.
    pub refusal: Option<Refusal>,
}

impl<F: Flash> Records<F> {
    /// At start-up: looks at both sectors, settles what was interrupted, erases one if there is no
    /// room for an update (500 ms at most, on an STM32F405). `is_faulty` is whether the newest blob
    /// made the program fault twice, [`Check::suspect`] a blob whose check did. Then another one is
    /// used, from now on if that can be written, else until the next start. If there is no other,
    /// or the newest record itself passes over another, whose faults then had another cause,
    /// none is used, and the next start tries again. `record` is the room in which records are put
    /// together.
    pub fn start(
        mut flash: F,
        record: &'static mut Record,
        check: impl Into<Check>,
        is_faulty: bool,
    ) -> (Self, Found) {
        let mut check = check.into();
        // The start may erase a blob, and may renew what is neither a blob nor a journal.
        let damaged = plain(&flash, &check, |memory| memory.starts_with(&MAGIC));
        let newest = is_faulty
            .then(|| Store::read(&flash, check))
            .and_then(|store| Some((store.newest()?, store.passed_over().is_some())));
        let is_last = newest.is_some_and(|(_, passes_over)| passes_over);
        if let Some((newest, false)) = newest {
            check.suspect = crc_of(newest.blob(&flash));
        }
        let store = Store::start(&mut flash, check);
        let mut records = Self {
            flash,
            store,
            running: None,
            record,
            is_ready: false,
            writing: None,
        };
        let blob = match (check.suspect, is_last) {
            (Some(_), _) => records.pass_over().or(records.store.newest()),
            (None, true) => None,
            (None, false) => records.store.newest(),
        };
        let has_faulted = check.suspect.is_some() || is_last;
        let refusal = (records.refusal(has_faulted).or(damaged))
            .or_else(|| plain(&records.flash, &check, |_| true));
        (records, Found { blob, refusal })
    }

    /// The flash as it is now.
    pub const fn flash(&self) -> &F {
        &self.flash
    }

    fn refusal(&self, has_faulted: bool) -> Option<Refusal> {
        if has_faulted || self.store.passed_over().is_some() {
            return Some(Refusal::PASSED_OVER);
        }
        if self.store.fault().is_some() {
            return Some(Refusal::NOT_WRITTEN);
        }
        let rejected = self.store.rejected().filter(|blob| blob.sequence > 0)?;
        Some(Refusal::of(rejected.sector as u8, &rejected.error))
    }

    /// The record that is written for it, with what runs in its place.
    fn pass_over(&mut self) -> Option<Stored> {
        self.store.pass_over(&self.flash, self.record).ok()?;
        let mut writing = self.store.begin(&self.flash, self.record).ok()?;
        for _ in 0..writing.words() {
            writing.step(&mut self.flash, self.record).ok()?;
        }
        self.store.finish(&self.flash, &writing);
        self.store.newest()
    }

    /// Reads a blob that [`Records::start`] found, which runs from now on.
    #[inline(never)]
    pub fn load(
        &mut self,
        blob: Stored,
        place: &'static mut Option<Loaded>,
    ) -> Option<&'static Loaded> {
        let loaded: &'static Loaded = place.insert(slots::load(blob.blob(&self.flash))?);
        self.running = Some((blob, loaded));
        Some(loaded)
    }

    /// What runs has run long enough to be proven: the next start may erase what was before it. One
    /// word of flash at most, two if one is worn.
    pub fn prove(&mut self) {
        let running = self.running.as_ref().map(|(stored, _)| *stored);
        if running == self.store.newest() {
            self.store.prove(&mut self.flash);
        }
    }

    /// Puts the record together: in a tick of its own, as is [`Records::begin`].
    fn make(&mut self, sequence: u32, change: Change<'_>) -> Option<()> {
        let (store, record) = (&self.store, &mut *self.record);
        match change {
            Change::Blob(blob) => {
                record.room().get_mut(..blob.len())?.copy_from_slice(blob);
                store.update(record, blob.len(), sequence).ok()
            }
            Change::Previous if store.due() == Some(sequence) => {
                store.go_back(&self.flash, record).ok()
            }
            Change::Previous => None,
        }
    }

    fn kept(&self, stored: Option<Stored>) -> Option<Kept> {
        let stored = stored?;
        let crc = crc_of(stored.blob(&self.flash))?;
        Some(Kept {
            sequence: stored.sequence,
            crc,
        })
    }

    /// Begins to write it.
    fn begin(&mut self) -> Option<()> {
        self.writing = Some(self.store.begin(&self.flash, self.record).ok()?);
        Some(())
    }
}

/// What is wrong with the plain contents of the sectors that are looked at.
#[inline(never)]
fn plain(flash: &impl Flash, check: &Check, is_looked_at: fn(&[u8]) -> bool) -> Option<Refusal> {
    let memory =
        |sector| Some(store::readable(flash, sector)).filter(|memory| is_looked_at(memory));
    slots::refusal(
        Sector::ALL.map(|sector| memory(sector).unwrap_or_default()),
        check,
    )
}

impl<F: Flash> update::Store for Records<F> {
    fn running(&self) -> Option<Running<'_>> {
        let (stored, loaded) = self.running.as_ref()?;
        Some(Running {
            slot: stored.sector as u8,
            sequence: stored.sequence,
            blob: stored.blob(&self.flash),
            serial: &loaded.serial,
            created: &loaded.created,
            rms: loaded.fit.rms,
            peak: loaded.fit.peak,
        })
    }

    fn newest(&self) -> Option<Kept> {
        self.kept(self.store.newest())
    }

    fn previous(&self) -> Option<Kept> {
        self.kept(self.store.previous())
    }

    fn newest_sequence(&self) -> u32 {
        self.store.due().map_or(u32::MAX, |due| due - 1)
    }

    fn is_writable(&self) -> bool {
        self.store.is_writable()
    }

    fn has_room(&self) -> bool {
        self.store.has_room(&self.flash)
    }

    fn write(&mut self, sequence: u32, change: Change<'_>) -> Written {
        let Some(mut writing) = self.writing.take() else {
            let is_begun = core::mem::replace(&mut self.is_ready, false);
            let done = if is_begun {
                self.begin()
            } else {
                self.make(sequence, change)
            };
            self.is_ready = !is_begun && done.is_some();
            return match done {
                Some(()) => Written::InProgress,
                None => Written::Failed,
            };
        };
        for _ in 0..WORDS_PER_TICK {
            match writing.step(&mut self.flash, self.record) {
                Ok(Step::More) => {}
                Ok(Step::Done) => {
                    self.store.finish(&self.flash, &writing);
                    return Written::Done;
                }
                Err(_) => return Written::Failed,
            }
        }
        self.writing = Some(writing);
        Written::InProgress
    }
}

#[cfg(test)]
#[path = "records_tests.rs"]
mod tests;
