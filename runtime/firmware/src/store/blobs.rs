//! The blobs that the sectors hold: in records, and plain as a probe flashes them.

use super::check::Check;
use super::flash::{Flash, Sector, word_of};
use super::journal::{self, Place};
use super::record::{UNIT_BYTES, View};
use runtime::ParameterSet;
use runtime::blob::{BlobError, CRC_BYTES, HEADER_BYTES, MAGIC, MAX_BYTES};
use runtime::parameters::Text;

/// A blob in flash.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stored {
    /// Its sequence number; 0 for a plain blob.
    pub sequence: u32,
    /// Its sector.
    pub sector: Sector,
    offset: usize,
    pub(super) bytes: usize,
}

impl Stored {
    /// The blob.
    pub fn blob<'f>(&self, flash: &'f impl Flash) -> &'f [u8] {
        let end = self.offset + self.bytes;
        (flash.bytes(self.sector).get(self.offset..end)).unwrap_or_default()
    }
}

/// The blob of a record.
#[inline(never)]
pub(super) fn stored(flash: &impl Flash, place: Place) -> Option<Stored> {
    let view = journal::view(flash, place)?;
    let (offset, bytes) = view.blob_range();
    Some(Stored {
        sequence: place.sequence,
        sector: place.sector(),
        offset: place.unit() * UNIT_BYTES + offset,
        bytes,
    })
}

/// Whose parameters a blob holds, and when they were made.
pub(super) struct Label {
    pub(super) serial: Text,
    created: Text,
}

/// The full check of a blob. A parameter set has 700 bytes: in a function of its own, it leaves
/// the stack at once.
#[inline(never)]
pub(super) fn checked(blob: &[u8], check: &Check) -> Result<Label, BlobError> {
    let read = ParameterSet::from_bytes(blob);
    let set = read.as_ref().map_err(|error| *error)?;
    check.is_of_stage(set)?;
    let (serial, created) = (set.serial.clone(), set.created.clone());
    Ok(Label { serial, created })
}

/// Why a committed record cannot be used.
#[inline(never)]
pub(super) fn unusable(view: &View<'_>, check: &Check) -> Option<BlobError> {
    match check.guard(view.blob(), || checked(view.blob(), check)) {
        Ok(label) => (!view.is_of(&label.serial)).then_some(BlobError::OtherStage),
        Err(error) => Some(error),
    }
}

/// What is to be read of a sector: all, or nothing if it begins with a plain blob that a record passes
/// over.
pub fn readable(flash: &impl Flash, sector: Sector) -> &[u8] {
    let memory = flash.bytes(sector);
    if memory.starts_with(&MAGIC) && journal::is_passed_over(flash, 0, memory) {
        return &[];
    }
    memory
}

/// The plain blob of a sector that begins with one, and when it was made.
pub(super) fn plain(
    flash: &impl Flash,
    sector: Sector,
    check: &Check,
) -> Option<Result<(Stored, Text), BlobError>> {
    let memory = readable(flash, sector);
    if !memory.starts_with(&MAGIC) {
        return None;
    }
    // By the blob's own header.
    let payload = usize::try_from(word_of(memory, 2)).unwrap_or(MAX_BYTES);
    let bytes = (payload.saturating_add(HEADER_BYTES + CRC_BYTES)).min(MAX_BYTES);
    let stored = Stored {
        sequence: 0,
        sector,
        offset: 0,
        bytes,
    };
    let blob = stored.blob(flash);
    let label = check.guard(blob, || checked(blob, check));
    Some(label.map(|label| (stored, label.created)))
}

/// The sound plain blobs, the later first.
#[inline(never)]
pub(super) fn plain_by_age(flash: &impl Flash, check: &Check) -> [Option<Stored>; 2] {
    let blobs = Sector::ALL.map(|sector| plain(flash, sector, check).and_then(Result::ok));
    match blobs {
        [Some((first, a)), Some((second, b))] if b.as_str() > a.as_str() => {
            [Some(second), Some(first)]
        }
        [None, second] => [second.map(|(stored, _)| stored), None],
        [first, second] => [first, second].map(|blob| blob.map(|(stored, _)| stored)),
    }
}

/// The CRC at the end of a blob, by the length in its header.
pub(crate) fn stored_crc(memory: &[u8]) -> Option<u32> {
    let (header, rest) = memory.split_first_chunk::<HEADER_BYTES>()?;
    let payload_bytes = u32::from_le_bytes(*header.last_chunk()?);
    let stored = rest.get(payload_bytes as usize..)?.first_chunk()?;
    Some(u32::from_le_bytes(*stored))
}
