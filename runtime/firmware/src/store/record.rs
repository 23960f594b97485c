//! One record: as it is put together in RAM, and as it is found in flash.

use super::flash::{BLANK, word_of};
use crc::{CRC_32_ISCSI, Crc};
use runtime::blob::MAX_BYTES;

/// First word of a record.
pub(super) const RECORD: u32 = u32::from_le_bytes(*b"HREC");
/// The word that makes a record count.
pub(super) const COMMIT: u32 = u32::from_le_bytes(*b"COMT");
/// The word that says: the one before it was programmed to the end.
pub(super) const SEAL: u32 = u32::from_le_bytes(*b"SEAL");
/// A commit word that can no longer become [`COMMIT`].
pub(super) const VOIDED: u32 = 0;
/// No blob is passed over.
const NONE: u32 = BLANK;

/// Bytes before the blob.
const HEADER_BYTES: usize = 48;
const HEADER_WORDS: usize = HEADER_BYTES / 4;
/// Bytes of the serial number, filled up with zeros.
const SERIAL_BYTES: usize = 32;
/// CRC, commit word, seal.
const TRAILER_WORDS: usize = 3;
/// Records begin at multiples of this.
pub(super) const UNIT_BYTES: usize = 64;
/// Units of the largest record.
pub(super) const MAX_UNITS: usize = units(MAX_BYTES);

/// CRC-32C, without a table where flash is short.
static CRC: Crc<u32, Lookup> = Crc::<u32, Lookup>::new(&CRC_32_ISCSI);
#[cfg(target_os = "none")]
type Lookup = crc::NoTable;
#[cfg(not(target_os = "none"))]
type Lookup = crc::Table<1>;

/// The check of one slice after the other.
#[inline(never)]
fn crc32c(first: &[u8], second: &[u8]) -> u32 {
    let mut digest = CRC.digest();
    digest.update(first);
    digest.update(second);
    digest.finalize()
}

/// Words of a record up to and with its CRC.
const fn body_words(blob_bytes: usize) -> usize {
    HEADER_WORDS + blob_bytes.div_ceil(4) + 1
}

/// Units that a record with a blob of this length takes.
pub(super) const fn units(blob_bytes: usize) -> usize {
    (4 * (HEADER_WORDS + blob_bytes.div_ceil(4) + TRAILER_WORDS)).div_ceil(UNIT_BYTES)
}

/// A record in RAM that is about to be written. What is filled into [`Record::room`] becomes a
/// record once it has passed the checks of [`super::Store`].
#[derive(Clone, Debug)]
pub struct Record {
    header: [u8; HEADER_BYTES],
    blob: [u8; MAX_BYTES],
    blob_bytes: usize,
    crc: u32,
}

impl Record {
    /// Nothing yet.
    pub const EMPTY: Self = Self {
        header: [0xff; HEADER_BYTES],
        blob: [0xff; MAX_BYTES],
        blob_bytes: 0,
        crc: NONE,
    };

    /// Where a blob is put before it is checked. What the record was before is lost.
    pub const fn room(&mut self) -> &mut [u8; MAX_BYTES] {
        self.header = [0xff; HEADER_BYTES];
        &mut self.blob
    }

    /// The first bytes of [`Record::room`]; all of it if `bytes` is more.
    pub fn staged(&self, bytes: usize) -> &[u8] {
        self.blob.get(..bytes).unwrap_or(&self.blob)
    }

    /// Its sequence number; `u32::MAX` as long as it is no record.
    pub fn sequence(&self) -> u32 {
        word_of(&self.header, 1)
    }

    /// Makes a record of the first `blob_bytes` of the room.
    #[inline(never)]
    pub(super) fn close(
        &mut self,
        sequence: u32,
        passed_over: Option<u32>,
        serial: &str,
        blob_bytes: usize,
    ) {
        self.blob_bytes = blob_bytes.min(MAX_BYTES);
        if let Some(padding) = self.blob.get_mut(self.blob_bytes..) {
            padding.fill(0xff);
        }
        let length = u32::try_from(self.blob_bytes).unwrap_or(0);
        let numbers = [RECORD, sequence, passed_over.unwrap_or(NONE), length];
        let (words, serial_bytes) = self.header.split_at_mut(HEADER_BYTES - SERIAL_BYTES);
        for (word, number) in words.as_chunks_mut().0.iter_mut().zip(numbers) {
            *word = number.to_le_bytes();
        }
        serial_bytes.copy_from_slice(&padded(serial));
        let blob = self.staged(4 * self.blob_bytes.div_ceil(4));
        self.crc = crc32c(&self.header, blob);
    }

    /// Words up to and with the CRC.
    pub(super) const fn body_words(&self) -> usize {
        body_words(self.blob_bytes)
    }

    /// Units that it takes in flash.
    pub(super) const fn units(&self) -> usize {
        units(self.blob_bytes)
    }

    /// A word of the body.
    pub(super) fn word(&self, index: usize) -> u32 {
        if index + 1 == self.body_words() {
            self.crc
        } else if index < HEADER_WORDS {
            word_of(&self.header, index)
        } else {
            word_of(&self.blob, index - HEADER_WORDS)
        }
    }
}

/// A place in flash that begins as a record does, with a length that a record may have.
#[derive(Clone, Copy, Debug)]
pub(super) struct View<'f> {
    bytes: &'f [u8],
    blob_bytes: usize,
}

impl<'f> View<'f> {
    /// What begins at `unit` of a sector.
    #[inline(never)]
    pub(super) fn at(sector: &'f [u8], unit: usize) -> Option<Self> {
        let bytes = sector.get(unit * UNIT_BYTES..)?;
        let blob_bytes = usize::try_from(word_of(bytes, 3)).ok()?;
        let sequence = word_of(bytes, 1);
        if word_of(bytes, 0) != RECORD || blob_bytes > MAX_BYTES || matches!(sequence, 0 | NONE) {
            return None;
        }
        let bytes = bytes.get(..4 * (body_words(blob_bytes) + 2))?;
        Some(Self { bytes, blob_bytes })
    }

    pub(super) fn sequence(&self) -> u32 {
        word_of(self.bytes, 1)
    }

    /// The CRC of the blob that this record passes over.
    pub(super) fn passed_over(&self) -> Option<u32> {
        Some(word_of(self.bytes, 2)).filter(|&crc| crc != NONE)
    }

    /// Offset of the blob from the start of the record, and its length in bytes.
    pub(super) const fn blob_range(&self) -> (usize, usize) {
        (HEADER_BYTES, self.blob_bytes)
    }

    pub(super) fn blob(&self) -> &'f [u8] {
        let end = HEADER_BYTES + self.blob_bytes;
        self.bytes.get(HEADER_BYTES..end).unwrap_or_default()
    }

    pub(super) const fn units(&self) -> usize {
        units(self.blob_bytes)
    }

    /// Words before the commit word.
    pub(super) const fn body_words(&self) -> usize {
        body_words(self.blob_bytes)
    }

    pub(super) fn commit(&self) -> u32 {
        word_of(self.bytes, self.body_words())
    }

    pub(super) fn is_sealed(&self) -> bool {
        word_of(self.bytes, self.body_words() + 1) == SEAL
    }

    /// Whether the CRC holds.
    pub(super) fn is_sound(&self) -> bool {
        let crc = self.body_words() - 1;
        let body = self.bytes.get(..4 * crc).unwrap_or_default();
        crc32c(body, &[]) == word_of(self.bytes, crc)
    }

    /// Whether it names this serial number.
    pub(super) fn is_of(&self, serial: &str) -> bool {
        self.bytes.get(16..HEADER_BYTES) == Some(&padded(serial))
    }
}

/// A serial number as it is in a record: filled up with zeros.
#[inline(never)]
fn padded(serial: &str) -> [u8; SERIAL_BYTES] {
    let mut text = [0; SERIAL_BYTES];
    if let Some(start) = text.get_mut(..serial.len()) {
        start.copy_from_slice(serial.as_bytes());
    }
    text
}

const _: () = assert!(HEADER_BYTES == 16 + SERIAL_BYTES);
