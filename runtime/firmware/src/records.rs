//! The parameters that the controller keeps in flash: which it runs, what it reports of the others, and
//! new ones that come over the bus.

use crate::store::{self, Contents, Flash, Image, SLOTS, Stored};
use core::mem::MaybeUninit;
use hal_adapters::can::update::{BlobId, NotWritten, Running, Store, word_at};
use runtime::blob::{BlobError, MAX_BYTES};
use runtime::parameters::Text;
use runtime::{AnyDecoder, ParameterSet};

/// Which blob a start runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Choice {
    /// The newest: after power-on, and once it was activated.
    Newest,
    /// The one with this CRC, which ran before the reset.
    Blob(u32),
    /// None, and none is looked into.
    Nothing,
}

/// Why a slot is not used, in one byte for the status frame: the number of the slot in bits 4 to 6
/// and [`BlobError::number`] below.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Refusal {
    /// The byte.
    pub reason: u8,
}

impl Refusal {
    /// Both slots are empty.
    pub const NEITHER: Self = Self { reason: 2 };

    fn of(slot: u8, error: &BlobError) -> Self {
        let reason = slot << 4 | error.number();
        Self { reason }
    }
}

/// What a sound blob gives.
#[derive(Clone, Debug)]
pub struct Loaded {
    /// The decoder.
    pub decoder: AnyDecoder,
    /// Serial number of the stage.
    pub serial: Text,
    /// CRC of the blob.
    pub crc: u32,
}

/// Both slots with their flash.
#[derive(Debug)]
pub struct Records<F> {
    flash: F,
    /// The blobs that may run.
    stored: [Option<Stored>; SLOTS],
    /// The highest sequence number of any blob.
    highest: u32,
    running: Option<(Stored, &'static Loaded)>,
}

impl<F: Flash> Records<F> {
    /// At start-up: settles what was interrupted and looks at both slots. Blobs of another stage than
    /// `serial` are refused. Gives what is wrong with a slot, slot 0 first.
    pub fn start(mut flash: F, choice: Choice, serial: Option<&str>) -> (Self, Option<Refusal>) {
        store::settle(&mut flash);
        let mut records = Self {
            flash,
            stored: [None; SLOTS],
            highest: 0,
            running: None,
        };
        let mut refusal = None;
        for slot in [0, 1] {
            let looked = records.look(slot, choice, serial);
            if let Some(to) = records.stored.get_mut(usize::from(slot)) {
                *to = looked.unwrap_or_default();
            }
            if let Err(error) = looked {
                refusal.get_or_insert(Refusal::of(slot, &error));
            }
        }
        (records, refusal)
    }

    /// The blob of a slot, if it is sound. A parameter set has 700 bytes: in a function of its own, it
    /// leaves the stack at once.
    #[inline(never)]
    fn look(
        &mut self,
        slot: u8,
        choice: Choice,
        serial: Option<&str>,
    ) -> Result<Option<Stored>, BlobError> {
        let read = Image::read(&mut self.flash, slot);
        let Ok(image) = read.as_ref() else {
            return Ok(None);
        };
        match image.contents() {
            Contents::Nothing => return Ok(None),
            Contents::Damaged => {
                return Err(BlobError::BadCrc {
                    stored: 0,
                    computed: 0,
                });
            }
            Contents::Plain | Contents::Committed(_) => {}
        }
        let stored = image.stored(slot);
        self.highest = self.highest.max(stored.map_or(0, |stored| stored.sequence));
        if choice == Choice::Nothing {
            return Ok(stored);
        }
        match check(image.blob(), serial) {
            Ok(()) => Ok(stored),
            Err(BlobError::Erased) => Ok(None),
            Err(error) => Err(error),
        }
    }

    /// Reads the blob that is to run, which runs from now on. `None` if it is not there.
    #[inline(never)]
    pub fn load(
        &mut self,
        choice: Choice,
        place: &'static mut MaybeUninit<Loaded>,
    ) -> Option<&'static Loaded> {
        let stored = match choice {
            Choice::Newest => self.latest(|_| true),
            Choice::Blob(crc) => self.latest(|stored| stored.crc == crc),
            Choice::Nothing => None,
        }?;
        let image = Image::read(&mut self.flash, stored.slot).ok()?;
        let read = ParameterSet::from_flash(image.blob());
        let set = read.as_ref().ok()?;
        let loaded: &'static Loaded = place.write(Loaded {
            decoder: set.decoder(),
            serial: set.serial.clone(),
            crc: stored.crc,
        });
        self.running = Some((stored, loaded));
        Some(loaded)
    }

    /// Of the blobs that are meant the one with the highest sequence number; of two equal ones that in slot 0.
    fn latest(&self, is_meant: impl Fn(&Stored) -> bool) -> Option<Stored> {
        let stored = self.stored.iter().rev().flatten().copied();
        stored.filter(is_meant).max_by_key(|stored| stored.sequence)
    }

    /// The flash as it is now.
    pub const fn flash(&self) -> &F {
        &self.flash
    }

    /// The slot that may be erased: not that of the blob that runs, nor, where none runs, of the newest.
    fn spare(&self) -> u8 {
        let running = self.running.map(|(stored, _)| stored);
        let kept = running.or_else(|| self.latest(|_| true));
        kept.map_or(0, |kept| 1 - kept.slot)
    }
}

/// Whether a blob, with what follows it or without, is sound and that of the stage.
fn check(memory: &[u8], serial: Option<&str>) -> Result<(), BlobError> {
    let read = ParameterSet::from_flash(memory);
    let set = read.as_ref().map_err(|error| *error)?;
    serial.map_or(Ok(()), |serial| set.expect_serial(serial))
}

const fn id(stored: Stored) -> BlobId {
    let Stored { sequence, crc, .. } = stored;
    BlobId { sequence, crc }
}

impl<F: Flash> Store for Records<F> {
    fn running(&self) -> Option<Running<'_>> {
        let (stored, loaded) = self.running.as_ref()?;
        Some(Running {
            id: id(*stored),
            bytes: stored.bytes,
            serial: &loaded.serial,
        })
    }

    fn word(&mut self, index: usize) -> Option<u32> {
        let (stored, loaded) = self.running?;
        let image = Image::read(&mut self.flash, stored.slot).ok()?;
        // An update may have written another one into its slot.
        let is_there = image.stored(stored.slot)?.crc == loaded.crc;
        let blob = image.blob().get(..(stored.bytes as usize).min(MAX_BYTES))?;
        word_at(blob, index).filter(|_| is_there)
    }

    fn newest(&self) -> Option<BlobId> {
        self.latest(|_| true).map(id)
    }

    fn newest_sequence(&self) -> u32 {
        self.highest
    }

    fn write(&mut self, sequence: u32, blob: &[u8]) -> Result<(), NotWritten> {
        let slot = self.spare();
        let written = store::write(&mut self.flash, slot, sequence, blob);
        // What a failure has left there is what was there before, or nothing.
        let left = Image::read(&mut self.flash, slot).ok();
        if let Some(to) = self.stored.get_mut(usize::from(slot)) {
            *to =
                to.filter(|before| left.and_then(|left| left.stored(before.slot)) == Some(*before));
            *to = written.ok().or(*to);
        }
        if let Ok(stored) = written {
            self.highest = stored.sequence;
        }
        written.map(|_| ()).map_err(NotWritten::from)
    }
}

#[cfg(test)]
#[path = "records_tests.rs"]
mod tests;
