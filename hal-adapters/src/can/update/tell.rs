//! Who the node is: the pages of [`super::UpdateRequest::Tell`].

use super::authentication::Key;
use super::staging::word_of;
use super::store::{Kept, Store};
use crate::can::command::Outcome;

/// In the page [`page::LAST_UPDATE`]: there was none.
const NONE_YET: u32 = 0xff;

/// What a node knows of itself.
#[derive(Clone, Copy, Debug)]
pub struct Identity<'s> {
    /// The stage's serial number: a blob of another one is refused. `None`: any is taken.
    pub serial: Option<&'s str>,
    /// The stage's key; `None`: whoever can send on the bus may update.
    pub key: Option<Key>,
    /// Version of the program; see [`page::PROGRAM_VERSION`].
    pub program_version: u32,
    /// Hash of the program.
    pub program_hash: u32,
}

/// Numbers of the pages. Those up to [`page::PEAK`] are of the blob that runs.
pub mod page {
    /// Bits 0 to 7: number of the slot; bit 8: the fit was refused and written all the same.
    pub const PLACE: u8 = 0;
    /// Sequence number.
    pub const SEQUENCE: u8 = 1;
    /// The blob's check, CRC-32C.
    pub const CRC: u8 = 2;
    /// The blob's length, bytes.
    pub const LENGTH: u8 = 3;
    /// The text `created`: eight pages of four bytes of UTF-8, 0 after the end.
    pub const CREATED: u8 = 4;
    /// rms error of the fit in X, Y, Rz: three pages, bits of an f32; m, m, rad.
    pub const RMS: u8 = 12;
    /// Peak error of the fit in X, Y, Rz: three pages, bits of an f32; m, m, rad.
    pub const PEAK: u8 = 15;
    /// Version of the program: major, minor, patch in bits 16 to 23, 8 to 15, 0 to 7.
    pub const PROGRAM_VERSION: u8 = 18;
    /// Hash of the program.
    pub const PROGRAM_HASH: u8 = 19;
    /// Bits 0 to 7: how the last transfer since the reset ended, a number of
    /// [`Outcome`](crate::can::command::Outcome), 255 for none; bit 8: a key is needed.
    pub const LAST_UPDATE: u8 = 20;
    /// The highest sequence number in the store: above that of [`NEXT`] if the newest blob is
    /// refused.
    pub const NEWEST: u8 = 21;
    /// Serial number of the stage: eight pages of four bytes of UTF-8, 0 after the end.
    pub const SERIAL: u8 = 22;
    /// Sequence number of the blob that runs once it is activated or after power-on, and its check,
    /// CRC-32C: two pages.
    pub const NEXT: u8 = 30;
    /// The same of the blob to which a transfer of length 0 goes back: two pages.
    pub const PREVIOUS: u8 = 32;
    /// How many there are.
    pub const COUNT: u8 = 34;
}

/// The answer to [`super::UpdateRequest::Tell`]; `ended` is how the last transfer ended.
pub(super) fn tell(
    number: u8,
    identity: &Identity<'_>,
    ended: Option<Outcome>,
    store: &dyn Store,
) -> (Outcome, u32) {
    let needs_key = u32::from(identity.key.is_some()) << 8;
    let value = match number {
        0..page::PROGRAM_VERSION => of_running(number, store),
        page::PROGRAM_VERSION => Some(identity.program_version),
        page::PROGRAM_HASH => Some(identity.program_hash),
        page::LAST_UPDATE => Some(needs_key | ended.map_or(NONE_YET, |ended| ended as u32)),
        page::NEWEST => Some(store.newest_sequence()),
        page::SERIAL..page::NEXT => {
            let running = store.running().map(|running| running.serial);
            let serial = identity.serial.or(running).unwrap_or_default();
            Some(word_of_text(serial, number - page::SERIAL))
        }
        page::NEXT..page::PREVIOUS => of_kept(store.newest(), number - page::NEXT),
        page::PREVIOUS..page::COUNT => of_kept(store.previous(), number - page::PREVIOUS),
        _ => return (Outcome::UnknownCommand, 0),
    };
    value.map_or((Outcome::NoParameters, 0), |value| (Outcome::Done, value))
}

/// Four bytes of a text, 0 after its end.
fn word_of_text(text: &str, index: u8) -> u32 {
    word_of(text.as_bytes(), index.into()).unwrap_or(0)
}

/// A page that follows from the store; `None` where no blob runs.
fn of_running(number: u8, store: &dyn Store) -> Option<u32> {
    let running = store.running()?;
    let value_of = |values: [f32; 3], first: u8| {
        let k = usize::from(number.checked_sub(first)?);
        values.get(k).map(|value| value.to_bits())
    };
    match number {
        page::PLACE => Some(u32::from(running.is_forced) << 8 | u32::from(running.slot)),
        page::SEQUENCE => Some(running.sequence),
        page::CRC => Some(running.crc),
        page::LENGTH => Some(running.bytes),
        page::CREATED..page::RMS => Some(word_of_text(running.created, number - page::CREATED)),
        page::RMS..page::PEAK => value_of(running.rms, page::RMS),
        _ => value_of(running.peak, page::PEAK),
    }
}

/// A page of a blob in the store: its sequence number, or from 1 on its check.
fn of_kept(kept: Option<Kept>, page: u8) -> Option<u32> {
    let kept = kept?;
    Some(if page == 0 { kept.sequence } else { kept.crc })
}
