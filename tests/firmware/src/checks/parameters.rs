//! Parameter slots in every state.

use super::log::Stage;
use super::start::page;
use super::{Outcome, equal, expect, no_resets, same_words};
use crate::adc_model::Part;
use crate::bench::{Bench, Comparison, Seen, Words};
use hal_adapters::can::status::{NodeState, board_check};
use runtime::blob::MAX_BYTES;
use runtime::parameters::Text;
use runtime::{Decode, ParameterSet, PlanarPose, RawFrame};

const PART: Part = Part::Ads131m08;

/// The blob cut short as a power failure leaves it: the rest is erased.
fn torn(blob: &[u8]) -> Vec<u8> {
    let mut torn = blob.to_vec();
    torn[blob.len() / 2..].fill(0xff);
    torn
}

/// Without usable parameters the controller runs, says why in every status frame and gives
/// no pose.
fn none_usable(
    bench: &Bench,
    [slot_0, slot_1]: [&[u8]; 2],
    state: NodeState,
    reason: u8,
) -> Outcome {
    let mut machine = bench.machine(PART, [slot_0, slot_1])?;
    machine.run_ticks(400)?;
    let seen = Seen::since_last(&mut machine);
    equal("words of poses", seen.axes.len(), 0)?;
    expect(seen.statuses.len() >= 24, || {
        format!("only {} status frames", seen.statuses.len())
    })?;
    for (tick, status) in &seen.statuses {
        let (what, found) = (
            format!("state at tick {tick}"),
            (status.state, status.reason),
        );
        equal(&what, found, (Some(state), reason))?;
    }
    let stage = Stage::read(&machine, bench, PART)?;
    expect(stage.sequence >= 398, || {
        format!("only tick {}", stage.sequence)
    })?;
    equal("the pose in STAGE", stage.pose, [0; 6])?;
    no_resets(&machine)
}

/// Unusable parameters: both slots erased, a torn blob in either, the blob of another stage.
pub fn unusable(bench: &Bench) -> Outcome {
    let torn = torn(&bench.blob);
    let bad = NodeState::BadParameters;
    none_usable(bench, [&[], &[]], NodeState::NoParameters, 2)?;
    none_usable(bench, [&torn, &[]], bad, 7)?;
    none_usable(bench, [&bench.other, &[]], bad, 10)?;
    none_usable(bench, [&[], &torn], bad, 0x17)
}

/// With one valid slot the controller uses it, and says what is wrong with the other.
pub fn one_usable(bench: &Bench) -> Outcome {
    let torn = torn(&bench.blob);
    let cases: [([&[u8]; 2], u8); 4] = [
        ([&bench.blob, &[]], 0),
        ([&[], &bench.blob], 0),
        ([&torn, &bench.blob], 0x87),
        ([&bench.blob, &torn], 0x97),
    ];
    for (slots, reason) in cases {
        let mut machine = bench.machine(PART, slots)?;
        machine.run_ticks(100)?;
        let seen = Seen::since_last(&mut machine);
        same_words(&seen.axes, &bench.poses, 0, 98)?;
        let state = Some((NodeState::Running, reason));
        equal("state", seen.last_state(), state)?;
    }
    Ok(())
}

/// The golden example of the field model, in a stage of its own.
pub(super) const FIELD: &[u8] = include_bytes!("../../../../runtime/examples/field.bin");

/// What the host's decoder makes of the log with these parameters.
pub(super) fn poses_of(bench: &Bench, set: &ParameterSet) -> Vec<Words> {
    let decoder = set.decoder();
    (bench.rows.iter())
        .map(|&[a, b, c, g1, g2, g3]| {
            let frame = RawFrame::new([a, b, c], [g1, g2, g3], 0, 0);
            let reading = decoder.decode(&frame, &PlanarPose::ZERO);
            let [x, y, rz] = reading.pose.planar.to_array();
            let [z, rx, ry] = reading.pose.vertical.to_array();
            Words {
                words: [x, y, rz, z, rx, ry].map(f32::to_bits),
                status: reading.status.bits(),
            }
        })
        .collect()
}

/// With a blob of the field model the words on the bus are those of the host's decoder.
pub fn the_field_model(bench: &Bench) -> Outcome {
    let (blob, set) = of_stage_7(FIELD)?;
    let poses = poses_of(bench, &set);
    let mut machine = bench.machine(PART, [&blob, &[]])?;
    machine.run_ticks(1000)?;
    let seen = Seen::since_last(&mut machine);
    let mut comparison = Comparison::default();
    comparison.add(&seen.axes, &poses, 0);
    println!("RESULT firmware_field_words={}", comparison.words);
    println!("RESULT firmware_field_differing={}", comparison.differing);
    equal("words that differ", comparison.differing, 0)?;
    let checks = page(&seen, 11).ok_or("no page 11")?;
    equal(
        "temperature missing",
        checks & board_check::TEMPERATURE_MISSING,
        0,
    )?;
    expect(comparison.planar >= 998, || {
        format!("only {} poses", comparison.planar)
    })?;
    let planar = seen.axes.iter().filter(|axis| axis.axis == 0);
    expect(planar.filter(|axis| axis.word != 0).count() >= 998, || {
        "poses that are not valid".to_owned()
    })
}

/// An example as a blob of the bench's stage.
pub(super) fn of_stage_7(example: &[u8]) -> Result<(Vec<u8>, ParameterSet), super::Failure> {
    let mut set = ParameterSet::from_bytes(example)?;
    set.serial = Text::try_from("stage-7").map_err(|_| "the serial")?;
    let mut buffer = [0; MAX_BYTES];
    Ok((set.to_bytes(&mut buffer)?.to_vec(), set))
}

/// Of two blobs that a probe has flashed the one in slot 0 is used.
pub fn the_first_of_two(bench: &Bench) -> Outcome {
    let run = |slots: [&[u8]; 2]| -> Result<[u32; 6], super::Failure> {
        let mut machine = bench.machine(PART, slots)?;
        machine.run_ticks(100)?;
        Ok(Stage::read(&machine, bench, PART)?.pose)
    };
    let (first, second) = (run([&bench.blob, &[]])?, run([&bench.later, &[]])?);
    expect(first != second, || {
        "both calibrations decode alike".to_owned()
    })?;
    equal("both", run([&bench.blob, &bench.later])?, first)?;
    equal("the other way", run([&bench.later, &bench.blob])?, second)
}
