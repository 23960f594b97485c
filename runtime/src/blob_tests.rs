//! Tests of the blob: a golden example both ways, and every kind of damage.

use super::*;
use crate::parameters::Text;
use crate::sample;
use crate::{Decode, PlanarPose, RawFrame, Status};
use proptest::prelude::*;
use proptest::sample::Index;

/// The blobs of [`samples`], by version of their layout.
const GOLDEN: [&[u8]; 4] = [
    include_bytes!("../examples/stage.bin"),
    include_bytes!("../examples/field.bin"),
    include_bytes!("../examples/warm.bin"),
    include_bytes!("../examples/motion.bin"),
];

/// The golden example of each version, and its length.
fn goldens() -> [([u8; MAX_BYTES], usize); 4] {
    GOLDEN.map(|golden| {
        let mut bytes = [0; MAX_BYTES];
        bytes[..golden.len()].copy_from_slice(golden);
        (bytes, golden.len())
    })
}

/// The sets that [`goldens`] were made of.
fn samples() -> [ParameterSet; 4] {
    [
        sample::parameters(),
        sample::field_parameters(),
        sample::warm_parameters(),
        sample::with_motion(sample::warm_calibration()),
    ]
}

fn golden() -> ([u8; MAX_BYTES], usize) {
    goldens()[0]
}

/// CRC-32C bit by bit, as its definition says: polynomial 1EDC6F41, reflected.
fn crc32c(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(u32::MAX, |crc, &byte| {
        (0..8).fold(crc ^ u32::from(byte), |crc, _| {
            (crc >> 1) ^ (0x82f6_3b78 * (crc & 1))
        })
    })
}

/// Puts the right check behind the first `n` bytes.
fn seal(blob: &mut [u8], n: usize) {
    let check = crc32c(&blob[..n]).to_le_bytes();
    blob[n..n + CRC_BYTES].copy_from_slice(&check);
}

/// Sets, other than the sample, written into a blob: for damage that a CRC does not show.
fn blob_of(set: &ParameterSet) -> ([u8; MAX_BYTES], usize) {
    let mut buffer = [0; MAX_BYTES];
    let n = set.to_bytes(&mut buffer).expect("room enough").len();
    (buffer, n)
}

#[test]
fn the_golden_blobs_are_written_byte_for_byte_and_read_as_their_sets() {
    for ((golden, n), set) in goldens().into_iter().zip(samples()) {
        let (blob, written) = blob_of(&set);
        assert_eq!(blob[..written], golden[..n]);
        assert_eq!(ParameterSet::from_flash(&golden).as_ref(), Ok(&set));
        assert_eq!(ParameterSet::from_bytes(&golden[..n]), Ok(set));
    }
}

#[test]
fn the_layout_is_as_documented() {
    let (golden, n) = golden();
    assert_eq!(&golden[..8], b"HALL\x01\x00\x00\x00");
    let payload = u32::from_le_bytes(golden[8..12].try_into().expect("four bytes"));
    assert_eq!(HEADER_BYTES + payload as usize + CRC_BYTES, n);
    let check = u32::from_le_bytes(golden[n - 4..n].try_into().expect("four bytes"));
    assert_eq!(check, crc32c(&golden[..n - 4]));
    // Model (31) is the fourth kind; then the serial number with its length.
    assert_eq!(&golden[12..21], b"\x03\x07HS-0007");
    assert_eq!(&GOLDEN[1][..8], b"HALL\x02\x00\x00\x00");
    // The field model is the fifth kind.
    assert_eq!(&GOLDEN[1][12..21], b"\x04\x07HS-0007");
    assert_eq!(&GOLDEN[2][..8], b"HALL\x03\x00\x00\x00");
    assert_eq!(&GOLDEN[3][..8], b"HALL\x04\x00\x00\x00");
    // A and L are 27 numbers. Beyond, the CRC misses four flipped bits somewhere.
    const { assert!(8 * (MAX_BYTES - 4 * 27 - CRC_BYTES) <= 5243) }
}

#[test]
fn a_model_in_the_layout_of_another_is_refused() {
    for (own, (mut blob, n)) in (1u16..).zip(goldens()) {
        for version in (1..=LAYOUT_VERSION).filter(|version| *version != own) {
            blob[4..6].copy_from_slice(&version.to_le_bytes());
            seal(&mut blob, n - CRC_BYTES);
            let refused = ParameterSet::from_bytes(&blob[..n]);
            assert_eq!(refused, Err(BlobError::BadPayload), "{own} as {version}");
        }
    }
}

#[test]
fn the_largest_set_fits_the_largest_blob() {
    for (mut set, (_, length)) in samples().into_iter().zip(goldens()) {
        let mut short = [0; MAX_BYTES];
        for room in 0..MAX_BYTES {
            assert_eq!(set.to_bytes(&mut short[..room]).is_ok(), room >= length);
        }
        set.serial = Text::try_from("01234567890123456789012345678901").expect("32 bytes");
        set.created = set.serial.clone();
        set.fit.rows = u32::MAX;
        set.fit.train_rows = u32::MAX;
        let most = crate::frame::CODE_MAGNITUDE_MAX;
        let window = crate::frame::CodeWindow {
            low: -most,
            high: most,
        };
        (set.constants.hall_window, set.constants.capacitive_window) = (window, window);
        let (blob, n) = blob_of(&set);
        assert_eq!(ParameterSet::from_bytes(&blob[..n]), Ok(set));
    }
}

/// The same numbers follow each model, with temperatures and without, and the decoder stays the same.
#[test]
fn a_motion_correction_goes_with_every_model_and_changes_no_other_number() {
    for calibration in [
        sample::calibration(),
        sample::field_calibration(),
        sample::warm_calibration(),
    ] {
        let without = calibration.prepare(&sample::origin()).expect("sound");
        let set = sample::with_motion(calibration);
        let (blob, n) = blob_of(&set);
        let read = ParameterSet::from_bytes(&blob[..n]).expect("sound");
        assert_eq!(read, set);
        assert_eq!(read.motion_correction, Some(sample::MOTION));
        assert_eq!(read.decoder(), without.decoder());
    }
}

#[test]
fn every_flipped_bit_is_refused() {
    for (mut blob, n) in goldens() {
        for bit in 0..8 * n {
            blob[bit / 8] ^= 1 << (bit % 8);
            assert!(ParameterSet::from_bytes(&blob[..n]).is_err(), "bit {bit}");
            assert!(ParameterSet::from_flash(&blob).is_err(), "bit {bit}");
            blob[bit / 8] ^= 1 << (bit % 8);
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(9_000))]
    #[test]
    fn up_to_five_flipped_bits_are_refused(which in 0..4usize, bits in prop::collection::vec(any::<Index>(), 2..=5)) {
        let (golden, n) = goldens()[which];
        let mut blob = golden;
        for bit in bits.into_iter().map(|bit| bit.index(8 * n)) {
            blob[bit / 8] ^= 1 << (bit % 8);
        }
        // The same bit twice is no flip.
        prop_assert!(blob == golden || ParameterSet::from_flash(&blob).is_err());
    }
}

#[test]
fn every_truncation_is_refused_with_what_is_missing() {
    for (blob, n) in goldens() {
        for found in 0..n {
            let needed = if found < HEADER_BYTES {
                HEADER_BYTES
            } else {
                n
            };
            let truncated = Err(BlobError::Truncated { needed, found });
            assert_eq!(ParameterSet::from_bytes(&blob[..found]), truncated);
            assert_eq!(ParameterSet::from_flash(&blob[..found]), truncated);
        }
    }
}

#[test]
fn padding_is_refused_in_a_file_and_passed_over_in_flash() {
    let (blob, n) = golden();
    for fill in [0x00, 0xff, 0x5a] {
        let mut padded = [fill; MAX_BYTES];
        padded[..n].copy_from_slice(&blob[..n]);
        for found in n + 1..=MAX_BYTES {
            let trailing = BlobError::TrailingBytes {
                blob_bytes: n,
                found,
            };
            assert_eq!(ParameterSet::from_bytes(&padded[..found]), Err(trailing));
            assert!(ParameterSet::from_flash(&padded[..found]).is_ok());
        }
    }
}

#[test]
fn a_header_that_no_blob_has_is_refused_by_its_reason_even_with_a_right_check() {
    let with = |at: usize, bytes: &[u8]| {
        let (mut blob, n) = golden();
        blob[at..at + bytes.len()].copy_from_slice(bytes);
        seal(&mut blob, n - CRC_BYTES);
        ParameterSet::from_flash(&blob).expect_err("refused")
    };
    let supported = LAYOUT_VERSION;
    for found in [0, LAYOUT_VERSION + 1, 0x0100, u16::MAX] {
        let unknown = BlobError::UnknownVersion { found, supported };
        assert_eq!(with(4, &found.to_le_bytes()), unknown);
    }
    let most = MAX_BYTES - HEADER_BYTES - CRC_BYTES;
    for payload_bytes in [most as u32 + 1, u32::MAX, u32::MAX - 15] {
        let bad = BlobError::BadHeader { payload_bytes };
        assert_eq!(with(8, &payload_bytes.to_le_bytes()), bad);
    }
    for (at, byte) in [(6, 2), (7, 1)] {
        let refused = with(at, &[byte]);
        assert!(matches!(refused, BlobError::BadHeader { .. }), "{at}");
    }
    let found = *b"\x7fELF";
    assert_eq!(with(0, &found), BlobError::BadMagic { found });
    for fill in [0x00, 0xff] {
        let erased = ParameterSet::from_flash(&[fill; MAX_BYTES]);
        assert_eq!(erased, Err(BlobError::Erased));
    }
}

#[test]
fn a_forced_blob_and_its_poses_say_so_and_are_else_the_same() {
    let frame = RawFrame::new([1200, 900, 700], [300, -200, 100], 0, 0);
    for (golden, n) in goldens() {
        let sound = ParameterSet::from_bytes(&golden[..n]).expect("golden");
        let mut forced = sound.clone();
        forced.fit.forced = true;
        let mut buffer = [0; MAX_BYTES];
        let blob = forced.to_bytes(&mut buffer).expect("it fits");
        let read = ParameterSet::from_bytes(blob).expect("sound");
        assert_eq!(read, forced);
        let decode = |set: &ParameterSet| set.decoder().decode(&frame, &PlanarPose::ZERO);
        let (plain, marked) = (decode(&sound), decode(&read));
        assert_eq!(marked.status, plain.status | Status::FORCED);
        assert!(marked.pose == plain.pose && !marked.status.is_good());
        assert_eq!((blob[6], golden[6]), (1, 0));
        assert_eq!(
            blob[HEADER_BYTES..n - CRC_BYTES],
            golden[HEADER_BYTES..n - CRC_BYTES]
        );
    }
}

/// With the check made right again, the damage must be found in the payload itself.
#[test]
fn a_sealed_payload_of_another_length_is_refused() {
    for (golden, n) in goldens() {
        for payload in 0..MAX_BYTES - HEADER_BYTES - CRC_BYTES {
            if HEADER_BYTES + payload + CRC_BYTES == n {
                continue;
            }
            let mut blob = golden;
            blob[8..12].copy_from_slice(&(payload as u32).to_le_bytes());
            seal(&mut blob, HEADER_BYTES + payload);
            assert_eq!(
                ParameterSet::from_flash(&blob),
                Err(BlobError::BadPayload),
                "{payload}"
            );
        }
    }
}

#[test]
fn another_stage_is_refused_when_one_is_expected() {
    let set = sample::parameters();
    assert_eq!(set.expect_serial("HS-0007"), Ok(()));
    for serial in ["HS-0008", "HS-00071", "HS-000", "", "hs-0007"] {
        assert_eq!(set.expect_serial(serial), Err(BlobError::OtherStage));
    }
}
