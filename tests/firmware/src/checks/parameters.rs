//! Parameter slots in every state.

use super::log::Stage;
use super::{no_resets, same_words};
use crate::adc_model::Row;
use crate::bench::{Bench, Seen, Words};
use hal_adapters::can::status::NodeState;
use runtime::ParameterSet;
use runtime::blob::MAX_BYTES;
use runtime::frame::MISSING_CODE;
use runtime::parameters::Text;

/// The first half of a blob.
fn torn(blob: &[u8]) -> Vec<u8> {
    let mut torn = blob.to_vec();
    torn[blob.len() / 2..].fill(0xff);
    torn
}

/// Unusable slots: both erased, a torn blob, no blob, another stage's blob. The controller runs, reports the
/// reason in every status frame, and sends no pose.
pub fn unusable(bench: &Bench) {
    let torn = torn(&bench.blob);
    let foreign = [b"X", &bench.blob[1..]].concat();
    let bad = NodeState::BadParameters;
    let cases: [([&[u8]; 2], NodeState, u8); 4] = [
        ([&[], &[]], NodeState::NoParameters, 2),
        ([&[], &torn], bad, 0x17),
        ([&foreign, &[]], bad, 3),
        ([&bench.other, &[]], bad, 10),
    ];
    for (slots, state, reason) in cases {
        let mut machine = bench.machine(slots);
        let seen = Seen::after(&mut machine, 200);
        assert_eq!(seen.axes.len(), 0);
        assert!(seen.statuses.len() >= 12, "status frames");
        for (tick, status) in &seen.statuses {
            let found = (status.state, status.reason);
            assert_eq!(found, (Some(state), reason), "tick {tick}");
        }
        let stage = Stage::read(&machine);
        assert!(stage.sequence >= 198, "only tick {}", stage.sequence);
        assert_eq!(stage.pose, [0; 6]);
        no_resets(&machine)
    }
}

/// With one valid slot the controller uses it and reports the state of the other.
pub fn one_usable(bench: &Bench) {
    let torn = torn(&bench.blob);
    let cases: [([&[u8]; 2], u8); 3] = [
        ([&bench.blob, &[]], 0),
        ([&torn, &bench.blob], 0x87),
        ([&bench.blob, &torn], 0x97),
    ];
    for (slots, reason) in cases {
        let mut machine = bench.machine(slots);
        let seen = Seen::after(&mut machine, 100);
        same_words(&seen.axes, &bench.poses, 0, 98);
        assert_eq!(seen.last_state(), Some((NodeState::Running, reason)));
    }
}

/// The host's words of the log with these parameters.
pub(super) fn host_poses(bench: &Bench, set: &ParameterSet) -> Vec<Words> {
    let decoder = set.decoder();
    let decoded = |row: &Row| Words::decoded(&decoder, *row, [MISSING_CODE; 2]);
    bench.rows.iter().map(decoded).collect()
}

/// An example as a blob of the bench's stage.
pub(super) fn for_stage_7(example: &[u8]) -> (Vec<u8>, ParameterSet) {
    let mut set = ParameterSet::from_bytes(example).expect("an example");
    set.serial = Text::try_from("stage-7").expect("short");
    // The longest text of a time.
    set.created = Text::try_from("2026-11-22T10:00:00.000000+00:00").expect("short");
    let mut buffer = [0; MAX_BYTES];
    (set.to_bytes(&mut buffer).expect("room").to_vec(), set)
}
