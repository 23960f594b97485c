//! The two parameter slots in flash, and which of them is used.
//!
//! Each slot holds a blob of [`runtime::blob`] or nothing. Of two sound ones the later by its
//! text `created` is used (dates as `2026-11-21` or `2026-11-21T10:00:00Z` sort by time), on
//! a tie slot 0. So a new calibration may be flashed into the slot that is not in use, and a
//! slot that is torn by a power failure leaves the other one to run on.

use runtime::blob::{BlobError, HEADER_BYTES};
use runtime::parameters::Text;
use runtime::{AnyDecoder, ParameterSet};

/// Slots there are.
pub const SLOTS: usize = 2;

/// A slot that is not used, in one byte for the status frame: the number of the slot in
/// bits 4 to 6 and the kind of its fault, 1 to 11 in the order of [`BlobError`], below.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Refusal {
    /// The byte.
    pub reason: u8,
    /// Whether the slot is merely empty.
    pub erased: bool,
}

impl Refusal {
    /// Both slots are empty.
    pub const NEITHER: Self = Self {
        reason: 2,
        erased: true,
    };

    fn of(slot: u8, error: &BlobError) -> Self {
        Self {
            reason: slot << 4 | error.number(),
            erased: matches!(error, BlobError::Erased),
        }
    }
}

/// Which slot to use.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Choice {
    /// Its number, if any is sound.
    pub slot: Option<usize>,
    /// The worst that is wrong with a slot: of damaged and empty ones a damaged one, slot 0
    /// first. `None` if both are sound.
    pub refusal: Option<Refusal>,
}

/// What a sound slot gives.
#[derive(Clone, Debug)]
pub struct Loaded {
    /// The decoder.
    pub decoder: AnyDecoder,
    /// Serial number of the stage.
    pub serial: Text,
    /// CRC of the blob.
    pub crc: u32,
}

/// Looks at both slots. With a `serial`, blobs of other stages are refused.
pub fn choose(slots: [&[u8]; SLOTS], serial: Option<&str>) -> Choice {
    let [first, second] = slots.map(|memory| created(memory, serial));
    let refusals = [
        first.as_ref().err().map(|e| Refusal::of(0, e)),
        second.as_ref().err().map(|e| Refusal::of(1, e)),
    ];
    let refusal = match refusals {
        [Some(a), Some(b)] if a.erased && !b.erased => Some(b),
        [a, b] => a.or(b),
    };
    let slot = match (first, second) {
        (Ok(a), Ok(b)) if b.as_str() > a.as_str() => Some(1),
        (Ok(_), _) => Some(0),
        (Err(_), Ok(_)) => Some(1),
        (Err(_), Err(_)) => None,
    };
    Choice { slot, refusal }
}

/// When the blob of a slot was made. A parameter set has 700 bytes and is read at start only:
/// in functions of their own, these leave the stack at once.
#[inline(never)]
fn created(memory: &[u8], serial: Option<&str>) -> Result<Text, BlobError> {
    let set = ParameterSet::from_flash(memory)?;
    if let Some(serial) = serial {
        set.expect_serial(serial)?;
    }
    Ok(set.created)
}

/// Reads a slot that [`choose`] found sound.
#[inline(never)]
pub fn load(memory: &[u8]) -> Option<Loaded> {
    let set = ParameterSet::from_flash(memory).ok()?;
    Some(Loaded {
        decoder: set.decoder(),
        serial: set.serial,
        crc: stored_crc(memory)?,
    })
}

/// The CRC at the end of a sound blob.
fn stored_crc(memory: &[u8]) -> Option<u32> {
    let (header, rest) = memory.split_first_chunk::<HEADER_BYTES>()?;
    let payload_bytes = u32::from_le_bytes(*header.last_chunk()?);
    let stored = rest.get(payload_bytes as usize..)?.first_chunk()?;
    Some(u32::from_le_bytes(*stored))
}

#[cfg(test)]
#[path = "slots_tests.rs"]
pub(crate) mod tests;
