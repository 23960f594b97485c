//! Who the node is: the pages of [`super::UpdateRequest::Tell`].

use super::staging::word_of;
use super::store::Store;
use runtime::blob::CRC_BYTES;

/// Numbers of the pages. Those up to [`page::PEAK`] are of the record that runs.
pub mod page {
    /// Bits 0 to 7: slot or sector; bit 8: the fit was refused and written all the same.
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
    /// The highest sequence number in the store: above that of the running record if one waits
    /// for a reset.
    pub const NEWEST: u8 = 21;
    /// Serial number of the stage: eight pages of four bytes of UTF-8, 0 after the end.
    pub const SERIAL: u8 = 22;
    /// How many there are.
    pub const COUNT: u8 = 30;
}

/// Four bytes of a text, 0 after its end.
pub(super) fn word_of_text(text: &str, index: u8) -> u32 {
    word_of(text.as_bytes(), index.into()).unwrap_or(0)
}

/// A page that follows from the store; `None` without a running record.
pub(super) fn of_running(number: u8, store: &dyn Store) -> Option<u32> {
    let running = store.running()?;
    let number_of = |values: [f32; 3], first: u8| {
        let k = usize::from(number.checked_sub(first)?);
        values.get(k).map(|value| value.to_bits())
    };
    match number {
        page::PLACE => {
            let forced = running.blob.get(6) == Some(&1);
            Some(u32::from(forced) << 8 | u32::from(running.slot))
        }
        page::SEQUENCE => Some(running.sequence),
        page::CRC => {
            let crc = running.blob.last_chunk::<CRC_BYTES>()?;
            Some(u32::from_le_bytes(*crc))
        }
        page::LENGTH => u32::try_from(running.blob.len()).ok(),
        page::CREATED..page::RMS => Some(word_of_text(running.created, number - page::CREATED)),
        page::RMS..page::PEAK => number_of(running.rms, page::RMS),
        _ => number_of(running.peak, page::PEAK),
    }
}
