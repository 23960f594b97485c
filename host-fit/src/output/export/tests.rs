//! What a flash tool would write, read back from the padded sector.

use super::*;
use runtime::ParameterSet;

/// Bytes of a slot's sector.
const SLOT_BYTES: usize = 16 * 1024;

const BLOB: &[u8] = include_bytes!("../../../../runtime/examples/stage.bin");

fn set() -> ParameterSet {
    ParameterSet::from_bytes(BLOB).expect("sound")
}

/// Two sectors of erased flash from `start`, with these bytes written to it.
fn flashed(start: u32, writes: &[(u32, Vec<u8>)]) -> Vec<u8> {
    let mut sector = vec![0xff; 2 * SLOT_BYTES];
    for (address, bytes) in writes {
        let at = (address - start) as usize;
        sector[at..at + bytes.len()].copy_from_slice(bytes);
    }
    sector
}

/// The writes that an Intel HEX file asks for.
fn hex_writes(file: &[u8]) -> Vec<(u32, Vec<u8>)> {
    let text = std::str::from_utf8(file).expect("text");
    let (mut upper, mut writes, mut ended) = (0, Vec::new(), false);
    for record in ihex::Reader::new(text) {
        match record.expect("a record") {
            ihex::Record::ExtendedLinearAddress(half) => upper = u32::from(half) << 16,
            ihex::Record::Data { offset, value } => {
                writes.push((upper | u32::from(offset), value));
            }
            ihex::Record::EndOfFile => ended = true,
            other => panic!("{other:?}"),
        }
    }
    assert!(ended);
    writes
}

#[test]
fn the_slots_are_those_of_the_memory_map() {
    let map = MAP.to_lowercase();
    assert!(map.contains(&format!("_parameter_slot_0 = {:#010x};", SLOTS[0])));
    assert_eq!(SLOTS[1] - SLOTS[0], SLOT_BYTES as u32);
    assert!(matches!(address_of(1), Ok(address) if address == SLOTS[1]));
    assert!(matches!(
        address_of(2),
        Err(ExportError::NoSlot { slot: 2 })
    ));
}

/// In a file for one slot, and in a file for both, with the blob at the start of each.
#[test]
fn each_format_read_back_from_padded_flash_is_the_same_set() {
    for slots in [&SLOTS[..1], &SLOTS[1..], &SLOTS] {
        let made = |format| export(BLOB, format, slots).expect("a file");
        let bin = vec![(slots[0], made(ExportFormat::Bin))];
        for writes in [bin, hex_writes(&made(ExportFormat::Hex))] {
            let flash = flashed(slots[0], &writes);
            for start in slots {
                let at = (start - slots[0]) as usize;
                assert_eq!(ParameterSet::from_flash(&flash[at..]), Ok(set()));
            }
        }
    }
}

#[test]
fn intel_hex_crosses_a_boundary_of_64_kib() {
    let start = 0x0800_ff00;
    for address in [0x0800_ff04, 0x0800_fff8, 0x0800_fffc, 0x0801_0000] {
        let file = export(BLOB, ExportFormat::Hex, &[address]).expect("a file");
        let writes = hex_writes(&file);
        let sector = flashed(start, &writes);
        let at = (address - start) as usize;
        assert_eq!(ParameterSet::from_flash(&sector[at..]), Ok(set()));
        for (from, bytes) in writes {
            assert_eq!(from >> 16, (from + bytes.len() as u32 - 1) >> 16);
        }
    }
}

#[test]
fn what_cannot_be_flashed_is_refused() {
    let refused =
        |bytes: &[u8], address| export(bytes, ExportFormat::Hex, &[address]).expect_err("refused");
    assert!(matches!(
        refused(BLOB, 0x0800_4002),
        ExportError::Unaligned { .. }
    ));
    assert!(matches!(
        refused(BLOB, 0xffff_fff0),
        ExportError::BeyondMemory { .. }
    ));
    let mut damaged = BLOB.to_vec();
    damaged[40] ^= 1;
    assert!(matches!(
        refused(&damaged, 0x0800_4000),
        ExportError::Blob(BlobError::BadCrc { .. })
    ));
}
