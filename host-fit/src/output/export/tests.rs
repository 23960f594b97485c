//! What a flash tool would write, read back from the padded sector.

use super::*;
use runtime::blob::MAX_BYTES;
use runtime::calibration::Origin;
use runtime::frame::CodeWindow;
use runtime::geometry::ProbeGeometry;
use runtime::model::{ModelKind, Probes, Sensitivity};
use runtime::{Calibration, ParameterSet};

/// Bytes of a slot's sector.
const SLOT_BYTES: usize = 16 * 1024;

fn set() -> ParameterSet {
    let window = CodeWindow {
        low: -32767,
        high: 32766,
    };
    let calibration = Calibration {
        model: ModelKind::M30,
        geometry: ProbeGeometry {
            lever_arm_m: [0.2, -0.19, -0.36],
            misalignment_rad: [0.01, -0.02, 0.03],
        },
        probes: Probes::Linear([0.88, 0.75, 0.82].map(Sensitivity::constant)),
        hall_m_per_code: 6.25e-8,
        hall_window: window,
        capacitive_probes_m: [[0.12, 0.0], [-0.12, 0.0], [0.0, -0.12]],
        capacitive_m_per_code: 1.5625e-8,
        capacitive_window: window,
        calibrated_planar: [0.01; 3],
        calibrated_vertical: [3e-4; 3],
        sensitivity_min: Calibration::SENSITIVITY_MIN,
    };
    calibration.prepare(&Origin::default()).expect("sound")
}

fn blob() -> Vec<u8> {
    let mut buffer = [0; MAX_BYTES];
    set().to_bytes(&mut buffer).expect("room").to_vec()
}

/// A sector of erased flash from `start`, with these bytes written to it.
fn flashed(start: u32, writes: &[(u32, Vec<u8>)]) -> Vec<u8> {
    let mut sector = vec![0xff; SLOT_BYTES];
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
    let map = include_str!("../../../../memory.x");
    for (slot, address) in (0..).zip(SLOTS) {
        assert!(map.contains(&format!("_parameter_slot_{slot} = {address:#010x};")));
        assert!(matches!(address_of(slot), Ok(of_slot) if of_slot == address));
    }
    assert!(matches!(
        address_of(2),
        Err(ExportError::NoSlot { slot: 2 })
    ));
}

#[test]
fn each_format_read_back_from_padded_flash_is_the_same_set() {
    for found in SLOTS {
        let made = |format| export(&blob(), format, &[found]).expect("a file");
        let bin = vec![(found, made(ExportFormat::Bin))];
        let hex = hex_writes(&made(ExportFormat::Hex));
        for writes in [bin, hex] {
            let sector = flashed(found, &writes);
            assert_eq!(ParameterSet::from_flash(&sector), Ok(set()));
        }
    }
}

#[test]
fn in_the_file_for_both_slots_the_blob_is_at_the_start_of_each() {
    let made = |format| export(&blob(), format, &SLOTS).expect("a file");
    let bin = made(ExportFormat::Bin);
    for (slot, start) in (0..).zip(SLOTS) {
        let at = slot * SLOT_BYTES;
        assert_eq!(ParameterSet::from_flash(&bin[at..]), Ok(set()));
        let writes = hex_writes(&made(ExportFormat::Hex));
        let end = start + SLOT_BYTES as u32;
        let own = writes
            .into_iter()
            .filter(|(at, _)| (start..end).contains(at));
        let sector = flashed(start, &own.collect::<Vec<_>>());
        assert_eq!(ParameterSet::from_flash(&sector), Ok(set()));
    }
}

#[test]
fn intel_hex_crosses_a_boundary_of_64_kib() {
    let start = 0x0800_ff00;
    for address in [0x0800_ff04, 0x0800_fff8, 0x0800_fffc, 0x0801_0000] {
        let file = export(&blob(), ExportFormat::Hex, &[address]).expect("a file");
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
        refused(&blob(), 0x0800_4002),
        ExportError::Unaligned { .. }
    ));
    assert!(matches!(
        refused(&blob(), 0xffff_fff0),
        ExportError::BeyondMemory { .. }
    ));
    let mut damaged = blob();
    damaged[40] ^= 1;
    assert!(matches!(
        refused(&damaged, 0x0800_4000),
        ExportError::Blob(BlobError::BadCrc { .. })
    ));
}
