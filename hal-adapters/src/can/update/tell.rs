//! The facts of a node that a host asks for one by one, with [`super::UpdateRequest::Tell`].

use super::authentication::Key;
use super::staging::word_at;
use super::store::Store;
use crate::can::NodeNumber;
use crate::can::command::Outcome;

/// What a node knows of itself.
#[derive(Clone, Copy, Debug, Default)]
pub struct Identity<'s> {
    /// The stage's serial number: a blob of another stage is refused. `None` accepts any.
    pub serial: Option<&'s str>,
    /// The stage's key, where it lies in flash: no copy of it stays in RAM. `None`: whoever can send on the bus may
    /// update.
    pub key: Option<&'s Key>,
    /// Its number on the bus.
    pub node: NodeNumber,
    /// Version of the program: major, minor, patch in bits 16 to 23, 8 to 15, 0 to 7.
    pub program_version: u32,
}

/// Numbers of the facts.
pub mod page {
    /// Version of the program in bits 0 to 23, as in [`super::Identity`]; bit 24: a key is needed.
    pub const PROGRAM: u8 = 0;
    /// The highest sequence number in the store, refused blobs included; 0 for none.
    pub const NEWEST_SEQUENCE: u8 = 1;
    /// Sequence number of the blob that runs.
    pub const RUNNING_SEQUENCE: u8 = 2;
    /// Its CRC-32C.
    pub const RUNNING_CRC: u8 = 3;
    /// Its length in bytes.
    pub const RUNNING_BYTES: u8 = 4;
    /// Sequence number of the blob that runs after an activation or power-on.
    pub const NEXT_SEQUENCE: u8 = 5;
    /// Its CRC-32C.
    pub const NEXT_CRC: u8 = 6;
    /// Serial number of the stage: eight pages of four bytes of UTF-8, 0 after the end.
    pub const SERIAL: u8 = 7;
    /// Number of pages.
    pub const COUNT: u8 = 15;
}

/// The answer to [`super::UpdateRequest::Tell`].
pub(super) fn tell(number: u8, identity: &Identity<'_>, store: &dyn Store) -> (Outcome, u32) {
    let (running, next) = (store.running(), store.newest());
    let value = match number {
        page::PROGRAM => {
            let needs_key = u32::from(identity.key.is_some()) << 24;
            Some(needs_key | identity.program_version & 0xff_ffff)
        }
        page::NEWEST_SEQUENCE => Some(store.newest_sequence()),
        page::RUNNING_SEQUENCE => running.map(|running| running.id.sequence),
        page::RUNNING_CRC => running.map(|running| running.id.crc),
        page::RUNNING_BYTES => running.map(|running| running.bytes),
        page::NEXT_SEQUENCE => next.map(|next| next.sequence),
        page::NEXT_CRC => next.map(|next| next.crc),
        page::SERIAL..page::COUNT => {
            let running = running.map(|running| running.serial);
            let serial = identity.serial.or(running).unwrap_or_default();
            let index = usize::from(number - page::SERIAL);
            Some(word_at(serial.as_bytes(), index).unwrap_or(0))
        }
        _ => return (Outcome::UnknownCommand, 0),
    };
    value.map_or((Outcome::NoParameters, 0), |value| (Outcome::Done, value))
}
