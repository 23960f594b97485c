//! A parameter blob, unchanged and with the right check behind it. An accepted blob decodes any codes
//! to a pose or to a status that says why not, and is written as the same set. A motion correction gives a pose.

#![no_main]

use crc::{CRC_32_ISCSI, Crc};
use libfuzzer_sys::fuzz_target;
use runtime::blob::{CRC_BYTES, HEADER_BYTES, MAX_BYTES};
use runtime::{CommandedMotion, Decode, ParameterSet, PlanarPose, RawFrame};

const CRC: Crc<u32> = Crc::<u32>::new(&CRC_32_ISCSI);

fuzz_target!(|data: &[u8]| {
    let _ = ParameterSet::from_bytes(data);
    let _ = ParameterSet::from_flash(data);
    let Some(sealed) = sealed(data) else { return };
    let Ok(set) = ParameterSet::from_bytes(&sealed) else {
        return;
    };
    assert_eq!(ParameterSet::from_flash(&sealed).as_ref(), Ok(&set));
    let mut buffer = [0; MAX_BYTES];
    let written = set.to_bytes(&mut buffer).expect("room enough");
    assert_eq!(ParameterSet::from_bytes(written).as_ref(), Ok(&set));
    let decoder = set.decoder();
    let window = decoder.constants().hall_window;
    let gaps = decoder.constants().capacitive_window;
    let codes = |low: i32, high: i32| [low, high, low / 2 + high / 2];
    for (hall, capacitive) in [
        ([0; 3], [0; 3]),
        (codes(window.low, window.high), codes(gaps.low, gaps.high)),
        (codes(window.high, window.low), codes(gaps.high, gaps.low)),
        ([i32::MIN; 3], [i32::MAX; 3]),
    ] {
        let frame = RawFrame::new(hall, capacitive, 0, 0);
        let reading = decoder.decode(&frame, &PlanarPose::ZERO);
        let (q, v) = (
            reading.pose.planar.to_array(),
            reading.pose.vertical.to_array(),
        );
        assert!(q.iter().chain(&v).all(|x| x.is_finite()));
        assert!(reading.planar().is_some() || q == [0.0; 3]);
        assert!(reading.vertical().is_some() || v == [0.0; 3]);
        if let Some(correction) = set.motion_correction {
            let commanded = CommandedMotion {
                velocity: [1.0, -1.0, 10.0],
                acceleration: [-10.0, 10.0, 100.0, 10.0, -100.0, 100.0],
            };
            let corrected = correction.correct(reading.pose.planar, &commanded);
            assert!(corrected.is_some());
        }
    }
});

/// The blob with length and check that fit it; `None` of what has no header.
fn sealed(data: &[u8]) -> Option<Vec<u8>> {
    let body = data.len().checked_sub(CRC_BYTES)?;
    let payload = u32::try_from(body.checked_sub(HEADER_BYTES)?).ok()?;
    let mut blob = data[..body].to_vec();
    blob[..4].copy_from_slice(b"HALL");
    blob[8..12].copy_from_slice(&payload.to_le_bytes());
    let check = CRC.checksum(&blob).to_le_bytes();
    blob.extend(check);
    Some(blob)
}
