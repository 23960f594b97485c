//! Whatever the sectors hold: no panic, and only a record that is whole is ever used. The bytes
//! of a record are put together here from the description of the format.

extern crate std;

use super::flash_model::{FlashModel, Words};
use super::record::UNIT_BYTES;
use super::tests::{SERIAL, blob, found, update};
use super::*;
use proptest::collection::vec;
use proptest::prelude::*;
use std::vec::Vec;

/// CRC-32C bit by bit: polynomial 1EDC6F41, reflected.
fn crc32c(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(u32::MAX, |crc, &byte| {
        (0..8).fold(crc ^ u32::from(byte), |crc, _| {
            (crc >> 1) ^ (0x82f6_3b78 * (crc & 1))
        })
    })
}

/// A committed record as it is described, without its seal.
fn record_bytes(sequence: u32, passed_over: u32, serial: &str, blob: &[u8]) -> Vec<u8> {
    let mut bytes = b"HREC".to_vec();
    for number in [sequence, passed_over, blob.len() as u32] {
        bytes.extend(number.to_le_bytes());
    }
    bytes.extend(serial.as_bytes());
    bytes.resize(48, 0);
    bytes.extend(blob);
    bytes.resize(bytes.len().next_multiple_of(4), 0xff);
    bytes.extend(crc32c(&bytes).to_le_bytes());
    bytes.extend(b"COMT");
    bytes
}

/// Something that lies in a sector.
#[derive(Clone, Debug)]
enum Piece {
    Record {
        sequence: u32,
        passed_over: u32,
        serial: &'static str,
        number: usize,
    },
    Random(Vec<u8>),
    Blob(usize),
}

fn piece() -> impl Strategy<Value = Piece> {
    let sequence = prop_oneof![1..40u32, Just(u32::MAX), Just(u32::MAX - 1), Just(0)];
    let passed_over = prop_oneof![4 => Just(u32::MAX), 1 => 0..40u32];
    let serial = prop_oneof![8 => Just("HS-0007"), 1 => Just("HS-00071")];
    let record = (sequence, passed_over, serial, 0..6usize);
    prop_oneof![
        6 => record.prop_map(|(sequence, passed_over, serial, number)| Piece::Record {
            sequence,
            passed_over,
            serial,
            number,
        }),
        1 => vec(any::<u8>(), 1..3000).prop_map(Piece::Random),
        1 => (0..6usize).prop_map(Piece::Blob),
    ]
}

/// A piece, its sector, its unit, and bits of it that are flipped.
type Placed = (Piece, bool, usize, Vec<prop::sample::Index>);

fn placed() -> impl Strategy<Value = Placed> {
    let flips = prop_oneof![2 => Just(Vec::new()), 1 => vec(any::<prop::sample::Index>(), 1..4)];
    (piece(), any::<bool>(), 0..SECTOR_BYTES / UNIT_BYTES, flips)
}

proptest! {
    #![proptest_config(ProptestConfig {
        failure_persistence: None,
        ..ProptestConfig::with_cases(1000)
    })]

    #[test]
    fn only_the_highest_whole_record_is_used(
        pieces in vec(placed(), 0..24),
        heads in any::<[Option<bool>; 2]>(),
    ) {
        let mut sectors = [(); 2].map(|()| std::vec![0xff; SECTOR_BYTES]);
        let mut records = Vec::new();
        for (piece, second, unit, flips) in pieces {
            let mut bytes = match &piece {
                Piece::Record { sequence, passed_over, serial, number } => {
                    let bytes = record_bytes(*sequence, *passed_over, serial, &blob(*number));
                    // A record that names another stage than its blob is never used.
                    if *serial == "HS-0007" {
                        records.push((*sequence, second, unit, bytes.clone(), *number));
                    }
                    bytes
                }
                Piece::Random(bytes) => bytes.clone(),
                Piece::Blob(number) => blob(*number),
            };
            for flip in flips {
                let bit = flip.index(8 * bytes.len());
                bytes[bit / 8] ^= 1 << (bit % 8);
            }
            let place = &mut sectors[usize::from(second)][unit * UNIT_BYTES..];
            let length = bytes.len().min(place.len());
            place[..length].copy_from_slice(&bytes[..length]);
        }
        for (sector, head) in sectors.iter_mut().zip(heads) {
            if let Some(sealed) = head {
                let unsealed = b"HJNL\xff\xff\xff\xff";
                sector[..8].copy_from_slice(if sealed { b"HJNLSEAL" } else { unsealed });
            }
        }
        // What is whole now.
        let whole = records.iter().filter(|(sequence, second, unit, bytes, _)| {
            let sector = &sectors[usize::from(*second)];
            sector.starts_with(b"HJNL") && sector[unit * UNIT_BYTES..].starts_with(bytes)
                && !matches!(*sequence, 0 | u32::MAX) && *unit > 0
        });
        let highest = whole.max_by_key(|record| (record.0, record.1, record.2));
        let mut flash = FlashModel::erased();
        for (sector, contents) in Sector::ALL.into_iter().zip(&sectors) {
            flash.load(sector, contents);
        }
        let store = Store::read(&flash, SERIAL);
        match highest {
            Some((sequence, .., number)) => {
                prop_assert_eq!(found(&store, &flash), Some(blob(*number)));
                let newest = store.newest().map(|stored| stored.sequence);
                prop_assert_eq!(newest, Some(*sequence));
            }
            None => {
                let plain = found(&store, &flash);
                prop_assert!(plain.is_none_or(|blob| sectors.iter().any(|s| s.starts_with(&blob))));
            }
        }
        // A start changes nothing about it, and what is then written is found.
        let before = found(&store, &flash);
        let store = Store::start(&mut flash, SERIAL);
        prop_assert_eq!(found(&store, &flash), before);
        store.prove(&mut flash);
        let mut store = Store::start(&mut flash, SERIAL);
        let spares_a_blob = Sector::ALL.iter().any(|s| flash.bytes(*s).starts_with(b"HALL"));
        prop_assert!(store.is_writable() || store.fault().is_some() || store.newest().is_none() && spares_a_blob);
        if store.is_writable() && store.due().is_some() {
            prop_assert_eq!(update(&mut store, &mut flash, &blob(7)), Ok(()));
            prop_assert_eq!(found(&Store::start(&mut flash, SERIAL), &flash), Some(blob(7)));
        }
    }

    #[test]
    fn noise_gives_no_record(seed in any::<u64>(), head in any::<bool>()) {
        let mut flash = FlashModel::erased();
        let mut words = Words(seed);
        for sector in Sector::ALL {
            let mut contents: Vec<u8> = (0..SECTOR_BYTES).map(|_| words.draw() as u8).collect();
            if head {
                contents[..8].copy_from_slice(b"HJNLSEAL");
            }
            flash.load(sector, &contents);
        }
        prop_assert_eq!(Store::read(&flash, SERIAL).newest(), None);
        let mut store = Store::start(&mut flash, SERIAL);
        prop_assert_eq!(store.newest(), None);
        prop_assert_eq!(update(&mut store, &mut flash, &blob(1)), Ok(()));
    }
}

#[test]
fn a_record_in_flash_is_as_documented() {
    let mut flash = FlashModel::erased();
    let mut store = Store::start(&mut flash, SERIAL);
    assert_eq!(&flash.bytes(Sector::First)[..8], b"HJNLSEAL");
    for number in 0..3 {
        assert_eq!(update(&mut store, &mut flash, &blob(number)), Ok(()));
    }
    let mut unit = 1;
    for number in 0..3 {
        let mut bytes = record_bytes(number as u32 + 1, u32::MAX, "HS-0007", &blob(number));
        bytes.extend(b"SEAL");
        assert!(flash.bytes(Sector::First)[unit * UNIT_BYTES..].starts_with(&bytes));
        unit += bytes.len().div_ceil(UNIT_BYTES);
    }
    assert!(
        flash.bytes(Sector::First)[unit * UNIT_BYTES..]
            .iter()
            .all(|&b| b == 0xff)
    );
}
