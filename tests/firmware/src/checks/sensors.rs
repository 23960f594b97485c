//! Faults of converters, wires and sensors: reported, survived, and cleared when they end.

use super::{Outcome, equal, expect};
use crate::adc_model::{AdcFault, Part};
use crate::bench::{Bench, Comparison, Seen};
use crate::machine::Machine;
use hal_adapters::can::status::NodeState;
use runtime::Status;

/// What a fault must look like from the bus.
pub struct Case {
    /// The fault.
    pub fault: AdcFault,
    /// State in every status frame.
    pub state: NodeState,
    /// Reason in every status frame.
    pub reason: u8,
    /// Ticks after which the fault must show.
    pub within: u64,
    /// Bits of the pose's status.
    pub status: Status,
    /// Ticks after which poses must be good again once the fault is gone.
    pub back_within: u64,
}

const NOTHING: Status = Status::PLANAR_INVALID.with(Status::VERTICAL_INVALID);

/// Bits that are not compared: out of range, which means nothing of an invalid pose, and missed
/// frames.
const NOT_COMPARED: u32 = Status::VERTICAL_EXTRAPOLATED
    .with(Status::PLANAR_EXTRAPOLATED)
    .with(Status::FRAMES_MISSED)
    .bits();

/// Every fault of a part.
pub fn cases(part: Part) -> Vec<(&'static str, Case)> {
    let case = |fault, state, reason, within, status, back_within| Case {
        fault,
        state,
        reason,
        within,
        status,
        back_within,
    };
    let flipped = if part == Part::Ads131m08 { 6 } else { 8 };
    let rail = |k: u32| {
        let lost = if k < 3 {
            Status::PLANAR_INVALID
        } else {
            Status::PLANAR_INVALID.with(Status::VERTICAL_INVALID)
        };
        (
            AdcFault::Rail(k as usize),
            NodeState::SensorFault,
            0x10 + k as u8,
            1,
            Status::from_bits(1 << k).with(lost),
            1,
        )
    };
    let of_rail = |k| {
        let (fault, state, reason, within, status, back) = rail(k);
        case(fault, state, reason, within, status, back)
    };
    vec![
        (
            "silent",
            case(AdcFault::Line(0x00), NodeState::NoFrames, 3, 1, NOTHING, 20),
        ),
        (
            "all ones",
            case(AdcFault::Line(0xff), NodeState::NoFrames, 3, 1, NOTHING, 20),
        ),
        (
            "stuck",
            case(AdcFault::Stuck, NodeState::SensorFault, 9, 9, NOTHING, 1),
        ),
        (
            "a flipped bit in every frame",
            case(
                AdcFault::FlippedBit,
                NodeState::SensorFault,
                flipped,
                1,
                NOTHING,
                20,
            ),
        ),
        ("Hall A at its rail", of_rail(0)),
        ("Hall C at its rail", of_rail(2)),
        ("gap 2 at its rail", of_rail(4)),
    ]
}

/// A fault that comes and goes.
pub fn survives(bench: &Bench, part: Part, case: &Case) -> Outcome {
    let mut machine = bench.machine(part, [&bench.blob, &[]])?;
    machine.run_ticks(100)?;
    let before = Seen::since_last(&mut machine);
    let mut good = Comparison::default();
    good.add(&before.axes, &bench.poses, 0);
    equal("words that differ before", good.differing, 0)?;

    machine.chip.adc.fault = case.fault;
    machine.run_ticks(300)?;
    let during = Seen::since_last(&mut machine);
    let shown: Vec<_> = during
        .axes
        .iter()
        .filter(|axis| axis.tick > 100 + case.within)
        .collect();
    expect(shown.len() > 800, || format!("only {} words", shown.len()))?;
    let planar = shown.iter().filter(|axis| axis.axis < 3);
    let wrong = planar
        .clone()
        .find(|axis| axis.word != 0 || axis.status & !NOT_COMPARED != case.status.bits());
    equal(
        "a planar word during the fault",
        wrong.map(|axis| (axis.tick, axis.word, axis.status)),
        None,
    )?;
    let late = |tick: u64| tick > 100 + case.within;
    let statuses: Vec<_> = during
        .statuses
        .iter()
        .filter(|(tick, _)| late(*tick))
        .collect();
    expect(statuses.len() >= 16, || {
        format!("only {} status frames", statuses.len())
    })?;
    for (tick, status) in statuses {
        equal(
            &format!("state at tick {tick}"),
            (status.state, status.reason),
            (Some(case.state), case.reason),
        )?;
    }

    machine.chip.adc.fault = AdcFault::None;
    machine.run_ticks(300)?;
    let after = Seen::since_last(&mut machine);
    let mut good = Comparison::default();
    // The first good frame tells that frames were missed before it; then all is as before.
    good.add(&after.axes, &bench.poses, 402 + case.back_within);
    equal("words that differ after", good.differing, 0)?;
    expect(good.planar > 200, || {
        format!("only {} poses after", good.planar)
    })?;
    let state = after.last_status().and_then(|status| status.state);
    equal("state after", state, Some(NodeState::Running))?;
    equal(
        "damaged frames",
        before.damaged + during.damaged + after.damaged,
        0,
    )?;
    equal(
        "panics and watchdog resets",
        (machine.panics, machine.watchdog_resets),
        (0, 0),
    )
}

/// Good poses up to the end, and none that differ from `first` on.
fn all_good(machine: &mut Machine, bench: &Bench, first: u64, least: u64) -> Outcome {
    let seen = Seen::since_last(machine);
    let mut good = Comparison::default();
    good.add(&seen.axes, &bench.poses, first);
    equal("words that differ", good.differing, 0)?;
    expect(good.planar >= least, || {
        format!("only {} poses", good.planar)
    })?;
    let state = seen.last_status().and_then(|status| status.state);
    equal("state", state, Some(NodeState::Running))?;
    let resets = (machine.panics, machine.watchdog_resets);
    equal("panics and watchdog resets", resets, (0, 0))
}

/// A converter that does not answer when the controller starts, and does later.
pub fn dead_from_the_start(bench: &Bench, part: Part) -> Outcome {
    let mut machine = bench.machine(part, [&bench.blob, &[]])?;
    machine.chip.adc.fault = AdcFault::Line(0xff);
    machine.run_ticks(200)?;
    let seen = Seen::since_last(&mut machine);
    let state = seen.last_status().and_then(|status| status.state);
    equal("state", state, Some(NodeState::NoFrames))?;
    machine.chip.adc.fault = AdcFault::None;
    machine.run_ticks(200)?;
    all_good(&mut machine, bench, 225, 170)
}

/// A converter that loses its settings: noticed in the next tick, started again.
pub fn reset_by_itself(bench: &Bench, part: Part) -> Outcome {
    let mut machine = bench.machine(part, [&bench.blob, &[]])?;
    machine.run_ticks(100)?;
    Seen::since_last(&mut machine);
    machine.chip.adc.reset();
    machine.run_ticks(10)?;
    let during = Seen::since_last(&mut machine);
    let shown = during
        .axes
        .iter()
        .filter(|axis| axis.tick > 100 && axis.axis < 3);
    let told = shown
        .clone()
        .filter(|axis| axis.status & NOTHING.bits() == NOTHING.bits())
        .count();
    equal("words told invalid", told, shown.count())?;
    machine.run_ticks(200)?;
    all_good(&mut machine, bench, 125, 180)
}
