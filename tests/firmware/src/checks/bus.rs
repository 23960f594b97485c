//! A bus that fails.

use super::log::Stage;
use super::{Outcome, equal, expect};
use crate::adc_model::Part;
use crate::bench::{Bench, Comparison, Seen};
use crate::can_model::BusState;
use hal_adapters::can::status::flag;

const PART: Part = Part::Ads131m08;

/// The bus goes away and comes back. The ticks go on; old poses are never sent late.
pub fn goes_and_comes_back(bench: &Bench, bus: BusState) -> Outcome {
    let mut machine = bench.machine(PART, [&bench.blob, &[]])?;
    machine.run_ticks(100)?;
    Seen::since_last(&mut machine);
    let now_ns = machine.chip.now_ns;
    machine.chip.can.set_bus(bus, now_ns);
    machine.run_ticks(500)?;
    let silent = Seen::since_last(&mut machine);
    expect(silent.axes.len() <= 6, || {
        format!("{} words on a dead bus", silent.axes.len())
    })?;
    let meanwhile = Stage::read(&machine, bench, PART)?;
    expect(meanwhile.ticks >= 599, || {
        format!("only {} ticks", meanwhile.ticks)
    })?;
    equal(
        "the last pose in STAGE",
        meanwhile.pose,
        bench.poses[meanwhile.ticks as usize - 1].words,
    )?;
    expect(meanwhile.frames_dropped > 1000, || {
        format!("{} dropped", meanwhile.frames_dropped)
    })?;

    let now_ns = machine.chip.now_ns;
    machine.chip.can.set_bus(BusState::Good, now_ns);
    machine.run_ticks(500)?;
    let after = Seen::since_last(&mut machine);
    let mut comparison = Comparison::default();
    comparison.add(&after.axes, &bench.poses, 0);
    equal("words that differ after", comparison.differing, 0)?;
    expect(comparison.planar >= 498, || {
        format!("only {} poses after", comparison.planar)
    })?;
    let first = after.axes.first().map_or(0, |axis| axis.tick);
    expect(first >= 598, || {
        format!("a pose of tick {first} was sent late")
    })?;
    let status = after.last_status().ok_or("no status frame")?;
    let off = u8::from(bus == BusState::Off);
    equal("times the bus was off", status.bus_off, off)?;
    equal(
        "the flag",
        status.flags & flag::BUS_WAS_OFF,
        off * flag::BUS_WAS_OFF,
    )?;
    equal("missed ticks", status.missed_ticks, 0)?;
    equal(
        "panics and watchdog resets",
        (machine.panics, machine.watchdog_resets),
        (0, 0),
    )
}

/// A controller that starts alone on the bus runs, and is heard once other nodes are there.
pub fn alone_from_the_start(bench: &Bench) -> Outcome {
    let mut machine = bench.machine(PART, [&bench.blob, &[]])?;
    machine.chip.can.set_bus(BusState::Alone, 0);
    machine.run_ticks(200)?;
    equal(
        "words on the bus",
        Seen::since_last(&mut machine).axes.len(),
        0,
    )?;
    let now_ns = machine.chip.now_ns;
    machine.chip.can.set_bus(BusState::Good, now_ns);
    machine.run_ticks(100)?;
    let seen = Seen::since_last(&mut machine);
    let mut comparison = Comparison::default();
    comparison.add(&seen.axes, &bench.poses, 0);
    equal("words that differ", comparison.differing, 0)?;
    expect(comparison.planar >= 98, || {
        format!("only {} poses", comparison.planar)
    })?;
    equal(
        "panics and watchdog resets",
        (machine.panics, machine.watchdog_resets),
        (0, 0),
    )
}
