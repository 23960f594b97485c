//! Faults of converter, wires and sensors: reported, survived, and gone when they end. Each prints a row: the
//! ticks until it is reported, and the valid poses that were wrong.

mod cases;

pub use cases::{Case, cases};

use super::log::Stage;
use super::{no_resets, same_words, wrong_valid};
use crate::adc_model::AdcFault;
use crate::bench::{Axis, Bench, Seen};
use crate::machine::Machine;
use cases::BOTH_INVALID;
use hal_adapters::can::status::NodeState;
use runtime::Status;

const TICK_NS: u64 = 2_000_000;
/// Ticks before a fault begins.
const BEFORE: u64 = 100;
/// Ticks that a fault lasts, unless it is over at once.
const LASTS: u64 = 300;
/// Ticks without codes after which the converter is started again.
const RESTART: u64 = 16;

/// Bits that are not compared: out of range, meaningless for an invalid pose, and missed frames.
const NOT_COMPARED: u32 = Status::VERTICAL_EXTRAPOLATED
    .with(Status::PLANAR_EXTRAPOLATED)
    .with(Status::FRAMES_MISSED)
    .bits();

/// Runs to the middle between two ticks; tick `from` is the next one.
fn run_to(machine: &mut Machine, from: u64) {
    // The first tick comes a period after the start.
    machine.run_ticks(u64::from(machine.chip.first_tick_ns.is_none()) * 2);
    let first_ns = machine.chip.first_tick_ns.expect("no tick");
    let until_ns = first_ns + from * TICK_NS - TICK_NS / 2;
    machine.run_ns(until_ns.saturating_sub(machine.chip.now_ns));
}

fn state(seen: &Seen) -> Option<NodeState> {
    seen.last_state().map(|(state, _)| state)
}

/// A fault that comes and goes.
pub fn survives(bench: &Bench, case: &Case) {
    let mut machine = bench.machine([&bench.blob, &[]]);
    run_to(&mut machine, BEFORE);
    let before = Seen::since_last(&mut machine);
    same_words(&before.axes, &bench.poses, 0, 98);

    let now_ns = machine.chip.now_ns;
    case.event.happen(&mut machine.chip.adc, now_ns);
    let lasts = if case.is_long { LASTS } else { 1 };
    run_to(&mut machine, BEFORE + lasts);
    machine.chip.adc.fault = AdcFault::None;
    let during = Seen::since_last(&mut machine);
    let end = BEFORE + LASTS;
    run_to(&mut machine, end + LASTS);
    let after = Seen::since_last(&mut machine);

    let mut axes = during.axes;
    axes.extend(&after.axes);
    let planar = |axis: &&Axis| axis.axis < 3;
    let mut invalid = axes.iter().filter(planar).filter(|axis| !axis.is_valid());
    let reported = invalid.next().map(|axis| axis.tick + 1 - BEFORE);
    let wrong = wrong_valid(&axes, &bench.poses, 0);
    let text = reported.map_or("never".to_owned(), |ticks| ticks.to_string());
    println!("FAULT   {} | {text} | {wrong}", case.name);
    assert!(reported.is_some_and(|ticks| ticks <= case.within));
    assert!(wrong as u64 <= case.wrong);

    if case.is_long {
        let late = |tick: u64| (BEFORE + case.within..end).contains(&tick);
        let shown: Vec<_> = axes.iter().filter(|axis| late(axis.tick)).collect();
        assert!(shown.len() > 800, "only {} words", shown.len());
        let other = shown.into_iter().filter(planar).find(|axis| {
            let status = axis.status & !NOT_COMPARED;
            axis.word != 0 || status != case.status.bits() && status != BOTH_INVALID.bits()
        });
        let other = other.map(|axis| (axis.tick, axis.word, axis.status));
        assert_eq!(other, None);
        let statuses = during.statuses.iter().filter(|(tick, _)| late(*tick));
        assert!(statuses.clone().count() >= 12, "few states");
        for (tick, status) in statuses {
            let found = (status.state, status.reason);
            let known = case.reported.iter().any(|(s, r)| found == (Some(*s), *r));
            assert!(known, "{found:?} at tick {tick}");
        }
    }

    // The first good frame says that frames were missed before it; then all is as before.
    let good = BEFORE + lasts + 1 + case.back_within;
    same_words(&axes, &bench.poses, good, 201);
    assert_eq!(state(&after), Some(NodeState::Running));
    let damaged = before.damaged + during.damaged + after.damaged;
    assert_eq!(damaged, 0);
    no_resets(&machine)
}

/// A converter that does not answer at the start but does later, and a converter with a late supply.
pub fn dead_from_the_start(bench: &Bench) {
    for late_supply in [false, true] {
        let mut machine = bench.machine([&bench.blob, &[]]);
        machine.chip.adc.fault = AdcFault::Line(0xff);
        run_to(&mut machine, 200);
        let seen = Seen::since_last(&mut machine);
        assert_eq!(state(&seen), Some(NodeState::NoFrames));
        let starts = u64::from(Stage::read(&machine).count("adc_starts"));
        assert_eq!(starts, 1 + 199 / RESTART);
        machine.chip.adc.fault = AdcFault::None;
        if late_supply {
            let now_ns = machine.chip.now_ns;
            machine.chip.adc.part.power_up(now_ns);
        }
        run_to(&mut machine, 400);
        let seen = Seen::since_last(&mut machine);
        assert_eq!(wrong_valid(&seen.axes, &bench.poses, 0), 0);
        let first = 200 + 2 * RESTART;
        same_words(&seen.axes, &bench.poses, first, 150);
        assert_eq!(state(&seen), Some(NodeState::Running));
        no_resets(&machine);
    }
}

/// Transfers by DMA that never end are given up, reported as errors of the bus, and work again later.
pub fn transfers_that_never_end(bench: &Bench) {
    let mut machine = bench.machine([&bench.blob, &[]]);
    run_to(&mut machine, BEFORE);
    Seen::since_last(&mut machine);
    machine.chip.dma_stands = true;
    run_to(&mut machine, BEFORE + 20);
    let during = Seen::since_last(&mut machine);
    assert!(!during.axes.iter().any(Axis::is_valid));
    let fault = Some((NodeState::SensorFault, 1));
    assert_eq!(during.last_state(), fault);
    machine.chip.dma_stands = false;
    run_to(&mut machine, BEFORE + 300);
    let after = Seen::since_last(&mut machine);
    let first = BEFORE + 20 + RESTART;
    same_words(&after.axes, &bench.poses, first, 201);
    no_resets(&machine)
}

/// A register that changes at any time of a period is reported two ticks later at the latest: a change while
/// codes settle can be flagged after they are read.
pub fn a_register_changes_at_any_time(bench: &Bench) {
    for offset_ns in (0..TICK_NS).step_by(200_000) {
        let mut machine = bench.machine([&bench.blob, &[]]);
        run_to(&mut machine, BEFORE);
        machine.run_ns(TICK_NS / 2 + offset_ns);
        let now_ns = machine.chip.now_ns;
        machine.chip.adc.part.flip(0x04, 1, now_ns);
        Seen::since_last(&mut machine);
        run_to(&mut machine, BEFORE + 4);
        let seen = Seen::since_last(&mut machine);
        let mut soon = seen.axes.iter().filter(|axis| axis.tick <= BEFORE + 1);
        assert!(
            soon.any(|axis| !axis.is_valid()),
            "{offset_ns} ns after a trigger"
        );
    }
}
