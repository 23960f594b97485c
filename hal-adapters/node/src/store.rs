//! Two slots of flash with one blob of [`runtime::blob`] each: one runs, the other takes the next.
//!
//! Numbers are little-endian. A slot is what one erase clears; all other bytes are erased.
//!
//! | offset | bytes | content |
//! |---|---|---|
//! | 0 | 764 | the blob, filled up with 0xFF |
//! | 764 | 4 | sequence number, 1 to 2^32 - 2 |
//! | 768 | 4 | CRC-32C (Castagnoli) of the 768 bytes before it |
//! | 772 | 4 | commit word `COMT`; 0: never to be committed |
//! | 776 | 4 | `SEAL`: the commit word was programmed to the end |
//!
//! A blob that a probe flashes has none of the four words, and the sequence number 0. The blob with the highest
//! number is the newest; a probe's blob in slot 0 comes before one in slot 1.
//!
//! # Cuts of the power
//!
//! The content after an interrupted operation is not guaranteed (RM0090 rev. 21, section 3.6). A bit may even read
//! right after one start and wrong after the next, until it is programmed or erased to the end (the unstable bits of
//! UBIFS). Therefore:
//! - The running blob is never erased. Without a running blob the newest blob is kept.
//! - A slot is dropped by a commit word of 0 and then erased before each write. A word that an interrupted operation
//!   may have touched is never used.
//! - The sequence number is programmed before the blob: half an update never looks like a probe's blob.
//! - The commit word follows once all is read back, and its seal after it. Without the seal, a start programs a
//!   commit word again if it reads right, else to 0 for good ([`Slots::settle`]).
//!
//! After a cut the newest blob is the kept blob or the new one, and certainly the new one once [`Slots::write`] has ended.
//! A blob that waits for its activation gives way to the next one.

use embedded_storage::nor_flash::MultiwriteNorFlash;
use hal_adapters::can::update::NotWritten;
use runtime::blob::{CRC, CRC_BYTES, HEADER_BYTES, MAGIC, MAX_BYTES};

/// Number of slots.
pub const SLOTS: usize = 2;

const SEQUENCE: usize = MAX_BYTES;
const CHECK: usize = SEQUENCE + 4;
const COMMIT: usize = CHECK + 4;
const SEAL: usize = COMMIT + 4;
/// Used bytes of a slot.
const USED: usize = SEAL + 4;

const COMMITTED: [u8; 4] = *b"COMT";
const SEALED: [u8; 4] = *b"SEAL";
const VOID: [u8; 4] = [0; 4];
const BLANK: [u8; 4] = [0xff; 4];

/// A blob in a slot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stored {
    /// Number of the slot.
    pub slot: u8,
    /// Its sequence number; 0 for a blob that a probe has flashed.
    pub sequence: u32,
    /// Its own CRC-32C.
    pub crc: u32,
    /// Its length.
    pub bytes: u32,
}

/// The used bytes of a slot.
#[derive(Clone, Debug)]
pub struct Image([u8; USED]);

/// Content of a slot, by its four words.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Contents {
    /// No committed blob.
    Nothing,
    /// A blob that a probe has flashed, sound or not; or an erased slot.
    Plain,
    /// A blob that was committed under this number.
    Committed(u32),
    /// A blob that was committed and is damaged now.
    Damaged,
}

impl Image {
    /// The blob and its padding.
    pub fn blob(&self) -> &[u8] {
        self.0.get(..SEQUENCE).unwrap_or_default()
    }

    fn word(&self, offset: usize) -> [u8; 4] {
        let word = self.0.get(offset..).and_then(<[u8]>::first_chunk);
        *word.unwrap_or(&BLANK)
    }

    fn is_whole(&self) -> bool {
        let body = self.0.get(..CHECK).unwrap_or_default();
        CRC.checksum(body).to_le_bytes() == self.word(CHECK)
    }

    /// Content of the slot.
    pub fn contents(&self) -> Contents {
        let words = self.0.get(SEQUENCE..).unwrap_or_default();
        if words.iter().all(|byte| *byte == 0xff) {
            return Contents::Plain;
        }
        match (self.word(COMMIT) == COMMITTED, self.is_whole()) {
            (false, _) => Contents::Nothing,
            (true, true) => Contents::Committed(u32::from_le_bytes(self.word(SEQUENCE))),
            (true, false) => Contents::Damaged,
        }
    }

    /// The blob by its own header, sound or not.
    pub fn stored(&self, slot: u8) -> Option<Stored> {
        let sequence = match self.contents() {
            Contents::Committed(sequence) => sequence,
            Contents::Plain if self.0.starts_with(&MAGIC) => 0,
            _ => return None,
        };
        let (header, rest) = self.blob().split_first_chunk::<HEADER_BYTES>()?;
        let payload = u32::from_le_bytes(*header.last_chunk()?);
        let crc = rest.get(payload as usize..)?.first_chunk()?;
        Some(Stored {
            slot,
            sequence,
            crc: u32::from_le_bytes(*crc),
            bytes: payload + (HEADER_BYTES + CRC_BYTES) as u32,
        })
    }
}

/// Both slots: two neighbouring units of an erase. A word may be programmed again as long as bits only fall.
#[derive(Debug)]
pub struct Slots<F> {
    /// The flash.
    pub flash: F,
    /// Offset of slot 0 in the flash.
    pub first: u32,
    /// Whether the supply is too low to write: such flash may read right and not last. Asked before and after each operation.
    pub supply_is_low: fn() -> bool,
}

impl<F: MultiwriteNorFlash> Slots<F> {
    const SLOT_BYTES: usize = {
        assert!(F::ERASE_SIZE >= USED && F::ERASE_SIZE.is_multiple_of(4));
        assert!(4_usize.is_multiple_of(F::WRITE_SIZE) && 4_usize.is_multiple_of(F::READ_SIZE));
        F::ERASE_SIZE
    };

    /// Reads a slot.
    pub fn image(&mut self, slot: u8) -> Image {
        let mut image = Image([0xff; USED]);
        if self.flash.read(self.at(slot, 0), &mut image.0).is_err() {
            // Never committed.
            put(&mut image, COMMIT, VOID);
        }
        image
    }

    /// At power-on and after a reset, before anything is read: decides finally whether a slot counts, where an interrupted
    /// operation may have left that open. A word that cannot be programmed costs nothing: its slot is erased before it is
    /// used again.
    pub fn settle(&mut self) {
        for slot in [0, 1] {
            let image = self.image(slot);
            let commit = image.word(COMMIT);
            if image.contents() == Contents::Plain || image.word(SEAL) == SEALED || commit == VOID {
                continue;
            }
            if commit != COMMITTED {
                let _ = self.program(slot, COMMIT, VOID);
            } else if self.program(slot, COMMIT, COMMITTED).is_ok() {
                let _ = self.program(slot, SEAL, SEALED);
            }
        }
    }

    /// Erases a slot and writes a blob there, under this sequence number; it takes half a second.
    ///
    /// # Errors
    /// [`NotWritten`]; the slot then does not count.
    pub fn write(&mut self, slot: u8, sequence: u32, blob: &[u8]) -> Result<Stored, NotWritten> {
        let mut image = Image([0xff; USED]);
        let body = image.0.get_mut(..SEQUENCE);
        let body = body.and_then(|body| body.get_mut(..blob.len()));
        body.ok_or(NotWritten::Failed)?.copy_from_slice(blob);
        put(&mut image, SEQUENCE, sequence.to_le_bytes());
        let check = CRC.checksum(image.0.get(..CHECK).unwrap_or_default());
        put(&mut image, CHECK, check.to_le_bytes());

        self.program(slot, COMMIT, VOID)?;
        let (from, to) = (self.at(slot, 0), self.at(slot + 1, 0));
        self.operate(|flash| flash.erase(from, to))?;
        (0..Self::SLOT_BYTES)
            .step_by(4)
            .try_for_each(|offset| self.expect(slot, offset, BLANK))?;
        self.program(slot, SEQUENCE, image.word(SEQUENCE))?;
        for offset in (0..SEQUENCE).step_by(4).chain([CHECK]) {
            if image.word(offset) != BLANK {
                self.program(slot, offset, image.word(offset))?;
            }
        }
        (0..USED)
            .step_by(4)
            .try_for_each(|offset| self.expect(slot, offset, image.word(offset)))?;
        if let Err(fault) = self.program(slot, COMMIT, COMMITTED) {
            // It must not count.
            let _ = self.program(slot, COMMIT, VOID);
            return Err(fault);
        }
        // The commit word was read back, and a start seals it.
        let _ = self.program(slot, SEAL, SEALED);
        put(&mut image, COMMIT, COMMITTED);
        image.stored(slot).ok_or(NotWritten::Failed)
    }

    const fn at(&self, slot: u8, offset: usize) -> u32 {
        self.first + slot as u32 * Self::SLOT_BYTES as u32 + offset as u32
    }

    /// Programs a word and reads it back.
    fn program(&mut self, slot: u8, offset: usize, word: [u8; 4]) -> Result<(), NotWritten> {
        let at = self.at(slot, offset);
        self.operate(|flash| flash.write(at, &word))?;
        self.expect(slot, offset, word)
    }

    /// An operation while the supply is sound.
    fn operate<E>(&mut self, act: impl FnOnce(&mut F) -> Result<(), E>) -> Result<(), NotWritten> {
        let is_low = self.supply_is_low;
        if is_low() {
            return Err(NotWritten::SupplyLow);
        }
        act(&mut self.flash).map_err(|_| NotWritten::Failed)?;
        match is_low() {
            true => Err(NotWritten::SupplyLow),
            false => Ok(()),
        }
    }

    fn expect(&mut self, slot: u8, offset: usize, word: [u8; 4]) -> Result<(), NotWritten> {
        let mut reads = [0; 4];
        match self.flash.read(self.at(slot, offset), &mut reads) {
            Ok(()) if reads == word => Ok(()),
            _ => Err(NotWritten::Failed),
        }
    }
}

fn put(image: &mut Image, offset: usize, word: [u8; 4]) {
    let to = image.0.get_mut(offset..).and_then(<[u8]>::first_chunk_mut);
    if let Some(to) = to {
        *to = word;
    }
}

#[cfg(test)]
#[path = "../tests/flash_model/mod.rs"]
pub(crate) mod flash_model;
#[cfg(test)]
#[path = "store_tests.rs"]
pub(crate) mod tests;
