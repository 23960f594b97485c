//! A parameter blob as the file that a flash tool takes.
//!
//! | format | for | address |
//! |---|---|---|
//! | `bin` | st-flash, OpenOCD, probe-rs with `--binary-format bin` | given to the tool |
//! | `hex` | Intel HEX: probe-rs, OpenOCD, vendors' tools | in the file |
//!
//! For both slots the blob stands at the start of each, so that it runs whatever a controller had
//! stored in one of them. What follows it in its sector is erased, and the target takes the length from
//! the blob's header.

use runtime::{BlobError, ParameterSet};

/// What the file is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ExportFormat {
    /// The bytes themselves.
    Bin,
    /// Intel HEX.
    Hex,
}

impl ExportFormat {
    /// Its name, which ends the name of a file.
    pub const fn extension(self) -> &'static str {
        match self {
            Self::Bin => "bin",
            Self::Hex => "hex",
        }
    }
}

/// The project's memory map. A map with a slot in a wrong place does not link.
const MAP: &str = include_str!("../../../memory.x");

/// Addresses of the parameter slots 0 and 1 of the memory map.
pub const SLOTS: [u32; 2] = {
    let first = number_behind("_parameter_slot_0 = 0x");
    [first, first + number_behind("_parameter_slot_bytes = 0x")]
};

/// The hexadecimal number behind a text of the memory map.
const fn number_behind(text: &str) -> u32 {
    let (map, text) = (MAP.as_bytes(), text.as_bytes());
    let (mut at, mut matched, mut number) = (0, 0, 0);
    while matched < text.len() {
        matched = if map[at] == text[matched] {
            matched + 1
        } else {
            0
        };
        at += 1;
    }
    while map[at] != b';' {
        number = match (map[at] as char).to_digit(16) {
            Some(digit) => number << 4 | digit,
            None => panic!("memory.x: a hexadecimal number is expected"),
        };
        at += 1;
    }
    number
}

/// Why nothing is exported.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// The bytes are no blob: nothing else is worth flashing.
    #[error("not a usable parameter blob: {0}")]
    Blob(BlobError),
    /// A slot that the memory map does not have.
    #[error("slot {slot}: memory.x has slots 0 and 1; or give an address")]
    NoSlot {
        /// The slot asked for.
        slot: u8,
    },
    /// An address that flash cannot be written at.
    #[error("address {address:#010x} is not a multiple of 4; flash is written by words")]
    Unaligned {
        /// The address.
        address: u32,
    },
    /// The blob would reach beyond the address space.
    #[error("{bytes} bytes at {address:#010x} reach beyond 32 bits of address")]
    BeyondMemory {
        /// The address.
        address: u32,
        /// Bytes of the blob.
        bytes: usize,
    },
    /// The Intel HEX file cannot be made.
    #[error("Intel HEX: {0}")]
    Hex(ihex::WriterError),
}

/// The address of a slot.
///
/// # Errors
/// [`ExportError::NoSlot`].
pub fn address_of(slot: u8) -> Result<u32, ExportError> {
    let address = SLOTS.get(usize::from(slot)).copied();
    address.ok_or(ExportError::NoSlot { slot })
}

/// The file for a blob at these addresses in flash, in rising order. The blob is checked first, as the
/// target will check it.
///
/// # Errors
/// Every variant of [`ExportError`].
pub fn export(
    blob: &[u8],
    format: ExportFormat,
    addresses: &[u32],
) -> Result<Vec<u8>, ExportError> {
    ParameterSet::from_bytes(blob).map_err(ExportError::Blob)?;
    let bytes = blob.len();
    let first = addresses.first().copied().unwrap_or_default();
    let (mut bin, mut records) = (Vec::new(), Vec::new());
    for &address in addresses {
        if !address.is_multiple_of(4) {
            return Err(ExportError::Unaligned { address });
        }
        let end = u32::try_from(bytes)
            .ok()
            .and_then(|n| address.checked_add(n));
        if end.is_none() {
            return Err(ExportError::BeyondMemory { address, bytes });
        }
        bin.resize((address - first) as usize, 0xff);
        bin.extend(blob);
        records.extend(hex(blob, address));
    }
    records.push(ihex::Record::EndOfFile);
    match format {
        ExportFormat::Bin => Ok(bin),
        ExportFormat::Hex => ihex::create_object_file_representation(&records)
            .map(String::into_bytes)
            .map_err(ExportError::Hex),
    }
}

/// Intel HEX with 16 bytes to a record; the upper half of the address in a record of its own
/// wherever it changes.
fn hex(blob: &[u8], address: u32) -> Vec<ihex::Record> {
    let mut records = Vec::new();
    let mut upper = None;
    let starts = (address..).step_by(16);
    for (at, chunk) in starts.zip(blob.chunks(16)) {
        // Addresses are multiples of 4 and blobs short: a record may still cross 64 KiB.
        let room = 0x1_0000 - (at & 0xffff) as usize;
        let (first, second) = chunk.split_at(room.min(chunk.len()));
        for (at, part) in [(at, first), (at.wrapping_add(first.len() as u32), second)] {
            if part.is_empty() {
                continue;
            }
            let half = (at >> 16) as u16;
            if upper != Some(half) {
                upper = Some(half);
                records.push(ihex::Record::ExtendedLinearAddress(half));
            }
            records.push(ihex::Record::Data {
                offset: (at & 0xffff) as u16,
                value: part.to_vec(),
            });
        }
    }
    records
}

#[cfg(test)]
mod tests;
