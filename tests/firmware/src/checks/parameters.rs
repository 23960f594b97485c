//! Parameter slots in every state.

use super::log::Stage;
use super::{no_resets, same_words};
use crate::adc_model::Row;
use crate::bench::{Bench, Seen, Words};
use hal_adapters::can::status::{NodeState, board_check};
use runtime::ParameterSet;
use runtime::blob::MAX_BYTES;
use runtime::frame::MISSING_CODE;
use runtime::parameters::Text;

/// The blob cut short as a power failure leaves it: the rest is erased.
fn torn(blob: &[u8]) -> Vec<u8> {
    let mut torn = blob.to_vec();
    torn[blob.len() / 2..].fill(0xff);
    torn
}

/// Without usable parameters the controller runs, says why in every status frame and gives
/// no pose.
fn none_usable(bench: &Bench, [slot_0, slot_1]: [&[u8]; 2], state: NodeState, reason: u8) {
    let mut machine = bench.machine([slot_0, slot_1]);
    let seen = Seen::after(&mut machine, 400);
    assert_eq!(seen.axes.len(), 0);
    assert!(seen.statuses.len() >= 24, "status frames");
    for (tick, status) in &seen.statuses {
        let found = (status.state, status.reason);
        assert_eq!(found, (Some(state), reason), "tick {tick}");
    }
    let stage = Stage::read(&machine);
    assert!(stage.sequence >= 398, "only tick {}", stage.sequence);
    assert_eq!(stage.pose, [0; 6]);
    no_resets(&machine)
}

/// Unusable parameters: both slots erased, a torn blob in either, no blob, the blob of another stage.
pub fn unusable(bench: &Bench) {
    let torn = torn(&bench.blob);
    let bad = NodeState::BadParameters;
    none_usable(bench, [&[], &[]], NodeState::NoParameters, 2);
    none_usable(bench, [&torn, &[]], bad, 7);
    let foreign = [b"X", &bench.blob[1..]].concat();
    none_usable(bench, [&foreign, &[]], bad, 3);
    none_usable(bench, [&bench.other, &[]], bad, 10);
    none_usable(bench, [&[], &torn], bad, 0x17)
}

/// With one valid slot the controller uses it, and says what is wrong with the other.
pub fn one_usable(bench: &Bench) {
    let torn = torn(&bench.blob);
    let cases: [([&[u8]; 2], u8); 4] = [
        ([&bench.blob, &[]], 0),
        ([&[], &bench.blob], 0),
        ([&torn, &bench.blob], 0x87),
        ([&bench.blob, &torn], 0x97),
    ];
    for (slots, reason) in cases {
        let mut machine = bench.machine(slots);
        let seen = Seen::after(&mut machine, 100);
        same_words(&seen.axes, &bench.poses, 0, 98);
        let state = Some((NodeState::Running, reason));
        assert_eq!(seen.last_state(), state);
    }
}

/// The golden example of the field model, in a stage of its own.
pub(super) const FIELD: &[u8] = include_bytes!("../../../../runtime/examples/field.bin");

/// What the host's decoder makes of the log with these parameters.
pub(super) fn poses_of(bench: &Bench, set: &ParameterSet) -> Vec<Words> {
    let decoder = set.decoder();
    let decoded = |row: &Row| Words::decoded(&decoder, *row, [MISSING_CODE; 2]);
    bench.rows.iter().map(decoded).collect()
}

/// With a blob of the field model the words on the bus are those of the host's decoder.
pub fn the_field_model(bench: &Bench) {
    let (blob, set) = of_stage_7(FIELD);
    let poses = poses_of(bench, &set);
    let mut machine = bench.machine([&blob, &[]]);
    let seen = Seen::after(&mut machine, 1000);
    let comparison = same_words(&seen.axes, &poses, 0, 998);
    println!("RESULT firmware_field_words={}", comparison.words);
    println!("RESULT firmware_field_differing={}", comparison.differing);
    let checks = seen.page(11).expect("no page 11");
    assert_eq!(checks & board_check::TEMPERATURE_MISSING, 0);
    assert!(seen.x().filter(|axis| axis.word != 0).count() >= 998);
}

/// An example as a blob of the bench's stage.
pub(super) fn of_stage_7(example: &[u8]) -> (Vec<u8>, ParameterSet) {
    let mut set = ParameterSet::from_bytes(example).expect("an example");
    set.serial = Text::try_from("stage-7").expect("short");
    (bytes_of(&set), set)
}

pub(super) fn bytes_of(set: &ParameterSet) -> Vec<u8> {
    let mut buffer = [0; MAX_BYTES];
    set.to_bytes(&mut buffer).expect("room").to_vec()
}

/// Of two blobs that a probe has flashed the one in slot 0 is used.
pub fn the_first_of_two(bench: &Bench) {
    let run = |slots: [&[u8]; 2]| -> [u32; 6] {
        let mut machine = bench.machine(slots);
        machine.run_ticks(100);
        Stage::read(&machine).pose
    };
    let (first, second) = (run([&bench.blob, &[]]), run([&bench.later, &[]]));
    assert!(first != second, "both calibrations decode alike");
    assert_eq!(run([&bench.blob, &bench.later]), first);
    assert_eq!(run([&bench.later, &bench.blob]), second);
}
