//! Parameter slots in every state.

use super::log::Stage;
use super::start::page;
use super::{Outcome, equal, expect};
use crate::adc_model::Part;
use crate::bench::{Bench, Comparison, Seen, Words};
use hal_adapters::can::status::{NodeState, board_check};
use runtime::blob::{CRC_BYTES, MAX_BYTES};
use runtime::parameters::Text;
use runtime::{Decode, ParameterSet, PlanarPose, RawFrame};

const PART: Part = Part::Ads131m08;

/// The blob cut short as a power failure leaves it: the rest is erased.
fn torn(blob: &[u8]) -> Vec<u8> {
    let mut torn = blob.to_vec();
    torn[blob.len() / 2..].fill(0xff);
    torn
}

/// The blob with another layout version, and the check that belongs to it.
fn newer(blob: &[u8]) -> Vec<u8> {
    let mut newer = blob.to_vec();
    newer[4] = 9;
    let body = newer.len() - CRC_BYTES;
    let register = newer[..body].iter().fold(u32::MAX, |crc, byte| {
        (0..8).fold(crc ^ u32::from(*byte), |c, _| {
            c >> 1 ^ if c & 1 == 1 { 0x82f6_3b78 } else { 0 }
        })
    });
    newer[body..].copy_from_slice(&(!register).to_le_bytes());
    newer
}

fn foreign(blob: &[u8]) -> Vec<u8> {
    let mut foreign = blob.to_vec();
    foreign[..4].copy_from_slice(b"FONT");
    foreign
}

/// Without usable parameters the controller runs, says why in every status frame and gives
/// no pose.
pub fn none_usable(
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
        let found = (status.state, status.reason);
        equal(
            &format!("state at tick {tick}"),
            found,
            (Some(state), reason),
        )?;
    }
    let stage = Stage::read(&machine, bench, PART)?;
    expect(stage.sequence >= 398, || {
        format!("only tick {}", stage.sequence)
    })?;
    equal("the pose in STAGE", stage.pose, [0; 6])?;
    equal(
        "panics and watchdog resets",
        (machine.panics, machine.watchdog_resets),
        (0, 0),
    )
}

/// Every kind of unusable parameters.
pub fn unusable_kinds(bench: &Bench) -> Vec<(&'static str, Outcome)> {
    let (torn, newer, foreign) = (torn(&bench.blob), newer(&bench.blob), foreign(&bench.blob));
    let bad = NodeState::BadParameters;
    let check = |slots, state, reason| none_usable(bench, slots, state, reason);
    vec![
        (
            "both slots erased",
            check([&[], &[]], NodeState::NoParameters, 2),
        ),
        ("a torn blob", check([&torn, &[]], bad, 7)),
        ("a newer blob", check([&newer, &[]], bad, 4)),
        ("something else in the slot", check([&foreign, &[]], bad, 3)),
        (
            "the blob of another stage",
            check([&bench.other, &[]], bad, 10),
        ),
        ("a torn blob in slot 1", check([&[], &torn], bad, 0x17)),
    ]
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
        let mut comparison = Comparison::default();
        comparison.add(&seen.axes, &bench.poses, 0);
        equal("words that differ", comparison.differing, 0)?;
        expect(comparison.planar >= 98, || {
            format!("only {} poses", comparison.planar)
        })?;
        let status = seen.last_status().ok_or("no status frame")?;
        equal(
            "state",
            (status.state, status.reason),
            (Some(NodeState::Running), reason),
        )?;
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
