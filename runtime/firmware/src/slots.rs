//! What is told of the two parameter slots, and what a sound blob gives. Which blob is used is
//! decided by [`crate::store`].

use crate::store::{Check, is_journal, stored_crc};
use runtime::blob::BlobError;
use runtime::parameters::{FitRecord, Text};
use runtime::{AnyDecoder, ParameterSet};

/// Slots there are.
pub const SLOTS: usize = 2;

/// A slot that is not used, in one byte for the status frame: the number of the slot in
/// bits 4 to 6 and the kind of its fault, 1 to 11 in the order of [`BlobError`], below; or one of
/// the kinds of [`Refusal::PASSED_OVER`] and [`Refusal::NOT_WRITTEN`].
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

    /// The newest blob made the program fault twice in a row: the one before it runs, or none.
    pub const PASSED_OVER: Self = Self {
        reason: 12,
        erased: false,
    };

    /// The flash could not be written or erased: until the next start no parameters are stored.
    pub const NOT_WRITTEN: Self = Self {
        reason: 13,
        erased: false,
    };

    pub(crate) fn of(slot: u8, error: &BlobError) -> Self {
        Self {
            reason: slot << 4 | error.number(),
            erased: matches!(error, BlobError::Erased),
        }
    }
}

/// What a sound slot gives.
#[derive(Clone, Debug)]
pub struct Loaded {
    /// The decoder.
    pub decoder: AnyDecoder,
    /// Serial number of the stage.
    pub serial: Text,
    /// When it was made.
    pub created: Text,
    /// The errors of its fit.
    pub fit: FitRecord,
    /// CRC of the blob.
    pub crc: u32,
}

/// The worst that is wrong with the plain contents of the slots, slot 0 first: `None` for an erased
/// slot, a sound blob, a journal, and a slot of no bytes.
pub fn refusal(slots: [&[u8]; SLOTS], check: &Check) -> Option<Refusal> {
    let [first, second] = slots.map(|memory| error(memory, check));
    let first = first.map(|error| Refusal::of(0, &error));
    first.or_else(|| second.map(|error| Refusal::of(1, &error)))
}

/// A parameter set has 700 bytes and is read at start only: in functions of their own, these leave
/// the stack at once.
#[inline(never)]
fn error(memory: &[u8], check: &Check) -> Option<BlobError> {
    if memory.is_empty() || is_journal(memory) {
        return None;
    }
    let read = check.guard(memory, || {
        check.is_of_stage(ParameterSet::from_flash(memory).as_ref().map_err(|e| *e)?)
    });
    read.err().filter(|error| *error != BlobError::Erased)
}

/// Reads a sound blob, with what follows it or without.
#[inline(never)]
pub fn load(memory: &[u8]) -> Option<Loaded> {
    let read = ParameterSet::from_flash(memory);
    let set = read.as_ref().ok()?;
    Some(Loaded {
        decoder: set.decoder(),
        serial: set.serial.clone(),
        created: set.created.clone(),
        fit: set.fit,
        crc: stored_crc(memory)?,
    })
}

#[cfg(test)]
#[path = "slots_tests.rs"]
pub(crate) mod tests;
