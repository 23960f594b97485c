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

/// The controller runs whatever its slots hold, and says so in every status frame. With one valid slot it uses this slot
/// and reports the state of the other; without, it sends no pose.
pub fn slots_in_every_state(bench: &Bench) {
    let torn = torn(&bench.blob);
    let foreign = [b"X", &bench.blob[1..]].concat();
    let (running, bad) = (NodeState::Running, NodeState::BadParameters);
    let cases: [([&[u8]; 2], NodeState, u8); 7] = [
        ([&[], &[]], NodeState::NoParameters, 2),
        ([&[], &torn], bad, 0x17),
        ([&foreign, &[]], bad, 3),
        ([&bench.other, &[]], bad, 10),
        ([&bench.blob, &[]], running, 0),
        ([&torn, &bench.blob], running, 0x87),
        ([&bench.blob, &torn], running, 0x97),
    ];
    for (slots, state, reason) in cases {
        let mut machine = bench.machine(slots);
        let seen = Seen::after(&mut machine, 200);
        assert!(seen.statuses.len() >= 12, "status frames");
        for (tick, status) in &seen.statuses {
            let found = (status.state, status.reason);
            assert_eq!(found, (Some(state), reason), "tick {tick}");
        }
        if state == running {
            same_words(&seen.axes, &bench.poses, 0, 198);
        } else {
            assert_eq!(seen.axes.len(), 0);
            assert_eq!(Stage::read(&machine).pose, [0; 6]);
        }
        no_resets(&machine)
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
