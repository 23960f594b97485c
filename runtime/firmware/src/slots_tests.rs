extern crate std;

use super::*;
use runtime::calibration::{Calibration, Origin};
use runtime::frame::CodeWindow;
use runtime::geometry::ProbeGeometry;
use runtime::model::{ModelKind, Probes, Sensitivity};
use std::vec;
use std::vec::Vec;

const WINDOW: CodeWindow = CodeWindow {
    low: -32767,
    high: 32766,
};

/// A slot of 1 KiB with a blob of this stage, made at this time.
pub(crate) fn slot(serial: &str, created: &str) -> Vec<u8> {
    let calibration = Calibration {
        model: ModelKind::M31,
        geometry: ProbeGeometry {
            lever_arm_m: [0.19, -0.21, -0.34],
            misalignment_rad: [0.01, -0.02, 0.03],
        },
        probes: Probes::Linear(
            [Sensitivity {
                eta: 0.8,
                per_z_m: -190.0,
                per_rx_rad: -70.0,
                per_ry_rad: 15.0,
            }; 3],
        ),
        hall_m_per_code: 6.25e-8,
        hall_window: WINDOW,
        capacitive_probes_m: [[0.12, 0.0], [-0.12, 0.0], [0.0, -0.12]],
        capacitive_m_per_code: 1.5625e-8,
        capacitive_window: WINDOW,
        calibrated_planar: [1e-3; 3],
        calibrated_vertical: [5e-4; 3],
        sensitivity_min: 0.1,
    };
    let origin = Origin {
        serial: Text::try_from(serial).expect("short"),
        created: Text::try_from(created).expect("short"),
        ..Origin::default()
    };
    let set = calibration.prepare(&origin).expect("a sound calibration");
    let mut buffer = [0; runtime::blob::MAX_BYTES];
    let mut memory = set.to_bytes(&mut buffer).expect("it fits").to_vec();
    memory.resize(1024, 0xff);
    memory
}

#[test]
fn a_damaged_slot_is_told_and_an_erased_one_is_not() {
    let (good, erased) = (slot("7", ""), vec![0xff; 1024]);
    let mut torn = good.clone();
    torn[200..].fill(0xff);
    let mut journal = erased.clone();
    journal[..4].copy_from_slice(b"HJNL");
    let told = |slots| refusal(slots, &None.into()).map(|refusal| (refusal.reason, refusal.erased));
    assert_eq!(told([&torn, &good]), Some((0x07, false)));
    assert_eq!(told([&good, &torn]), Some((0x17, false)));
    assert_eq!(told([&erased, &torn]), Some((0x17, false)));
    assert_eq!(told([&good, &erased]), None);
    assert_eq!(told([&journal, &erased]), None);
}

#[test]
fn a_blob_of_another_stage_is_refused_only_if_the_stage_is_known() {
    let slots: [&[u8]; 2] = [&slot("8", ""), &[0xff; 16]];
    assert_eq!(refusal(slots, &None.into()), None);
    let told = refusal(slots, &Some("7").into()).map(|refusal| refusal.reason);
    assert_eq!(told, Some(0x0a));
    let loaded = load(slots[0]).expect("a sound slot");
    assert_eq!(loaded.serial.as_str(), "8");
}
