//! The parameters in flash: the running blob, the reason why another is refused, and new blobs from the bus.

use crate::store::{Contents, SLOTS, Slots, Stored};
use embedded_storage::nor_flash::MultiwriteNorFlash;
use hal_adapters::can::update::{BlobId, NotWritten, Running, Store, word_at};
use runtime::blob::{BlobError, MAX_BYTES};
use runtime::parameters::Text;
use runtime::{AnyDecoder, ParameterSet};

/// Which blob a start runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Choice {
    /// The newest blob: after power-on and after an activation.
    Newest,
    /// The blob with this CRC, which ran before the reset.
    Blob(u32),
    /// No blob. The blobs are not checked.
    Nothing,
}

/// Both slots with their flash.
#[derive(Debug)]
pub struct Records<F> {
    /// The flash.
    pub slots: Slots<F>,
    /// The blobs that may run.
    stored: [Option<Stored>; SLOTS],
    /// The highest sequence number of any blob.
    highest: u32,
    /// The blob that runs, and the serial number of its stage.
    running: Option<(Stored, Text)>,
}

impl<F: MultiwriteNorFlash> Records<F> {
    /// At start-up: settles interrupted operations and checks both slots. A blob of another stage than `serial` is
    /// refused. Also returns the reason of the first refused slot: its number in bits 4 to 6 and
    /// [`BlobError::number`] below.
    pub fn start(mut slots: Slots<F>, choice: Choice, serial: Option<&str>) -> (Self, Option<u8>) {
        slots.settle();
        let mut records = Self {
            slots,
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
                refusal.get_or_insert(slot << 4 | error.number());
            }
        }
        (records, refusal)
    }

    /// The blob of a slot, if it is sound.
    fn look(
        &mut self,
        slot: u8,
        choice: Choice,
        serial: Option<&str>,
    ) -> Result<Option<Stored>, BlobError> {
        let image = self.slots.image(slot);
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

    /// Loads the chosen blob, which runs from now on, and gives its decoder. `None` if it is not there.
    pub fn load(&mut self, choice: Choice) -> Option<AnyDecoder> {
        let stored = match choice {
            Choice::Newest => self.latest(|_| true),
            Choice::Blob(crc) => self.latest(|stored| stored.crc == crc),
            Choice::Nothing => None,
        }?;
        let image = self.slots.image(stored.slot);
        let read = ParameterSet::from_flash(image.blob());
        let set = read.as_ref().ok()?;
        self.running = Some((stored, set.serial.clone()));
        Some(set.decoder())
    }

    /// The selected blob with the highest sequence number; slot 0 comes first among equal numbers.
    fn latest(&self, select: impl Fn(&Stored) -> bool) -> Option<Stored> {
        let stored = self.stored.iter().rev().flatten().copied();
        stored.filter(select).max_by_key(|stored| stored.sequence)
    }

    /// The slot that may be erased: the running blob stays, or the newest blob if none runs.
    fn spare(&self) -> u8 {
        let running = self.running.as_ref().map(|(stored, _)| *stored);
        let kept = running.or_else(|| self.latest(|_| true));
        kept.map_or(0, |kept| 1 - kept.slot)
    }
}

/// Checks that a blob, with or without padding, is sound and belongs to the stage.
fn check(memory: &[u8], serial: Option<&str>) -> Result<(), BlobError> {
    let read = ParameterSet::from_flash(memory);
    let set = read.as_ref().map_err(|error| *error)?;
    serial.map_or(Ok(()), |serial| set.expect_serial(serial))
}

const fn id(stored: Stored) -> BlobId {
    let Stored { sequence, crc, .. } = stored;
    BlobId { sequence, crc }
}

impl<F: MultiwriteNorFlash> Store for Records<F> {
    fn running(&self) -> Option<Running<'_>> {
        let (stored, serial) = self.running.as_ref()?;
        Some(Running {
            id: id(*stored),
            bytes: stored.bytes,
            serial,
        })
    }

    fn word(&mut self, index: usize) -> Option<u32> {
        let (stored, _) = self.running.as_ref()?;
        let image = self.slots.image(stored.slot);
        // An update may have written another blob into its slot.
        let is_there = image.stored(stored.slot)?.crc == stored.crc;
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
        let written = self.slots.write(slot, sequence, blob);
        // After a failure the slot has the blob before it, or none.
        let left = self.slots.image(slot).stored(slot);
        if let Some(to) = self.stored.get_mut(usize::from(slot)) {
            *to = written.ok().or(to.filter(|before| left == Some(*before)));
        }
        self.highest = written?.sequence;
        Ok(())
    }
}

#[cfg(test)]
#[path = "records_tests.rs"]
mod tests;
