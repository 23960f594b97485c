//! Ticks that come late, a watchdog that bites, settings of the FPU that change.

use super::log::Stage;
use super::update::talk;
use super::{Outcome, equal, expect, no_resets, same_words};
use crate::adc_model::Part;
use crate::bench::{Bench, Seen};
use hal_adapters::can::status::{NodeState, flag};
use host_fit::bus::update::{UpdateError, on};
use runtime::Status;

const PART: Part = Part::Ads131m08;
const MS: u64 = 1_000_000;
/// FPSCR that rounds towards zero and flushes subnormal numbers.
const OTHER_SETTINGS: u32 = 0b111 << 22;

/// All ticks but these few send X within 0.4 ms of when they were due.
fn stays_in_step(seen: &Seen, late: usize) -> Outcome {
    let x = seen.axes.iter().filter(|axis| axis.axis == 0);
    let found = x.filter(|axis| axis.into_tick_us > 400).count();
    equal("ticks out of step", found, late)
}

/// A tick that comes 0.5 ms late is decoded and counted, and does not shift the others.
pub fn a_late_tick(bench: &Bench) -> Outcome {
    let mut machine = bench.machine(PART, [&bench.blob, &[]])?;
    machine.run_ticks(100)?;
    machine.hold_ns = MS / 2;
    machine.run_ticks(100)?;
    let seen = Seen::since_last(&mut machine);
    same_words(&seen.axes, &bench.poses, 0, 198)?;
    equal("missed ticks reported", seen.missed_ticks(), Some(1))?;
    stays_in_step(&seen, 1)?;
    no_resets(&machine)
}

/// Ticks that never come keep their numbers, and the schedule stays where it was.
pub fn ticks_that_never_come(bench: &Bench) -> Outcome {
    let mut machine = bench.machine(PART, [&bench.blob, &[]])?;
    machine.run_ticks(100)?;
    // Due at tick k, comes 2.3 periods later: ticks k and k + 1 are missed, k + 2 is late.
    machine.hold_ns = 46 * MS / 10;
    machine.run_ticks(200)?;
    let seen = Seen::since_last(&mut machine);
    let gap = seen
        .axes
        .iter()
        .find(|a| a.status == Status::FRAMES_MISSED.bits());
    let gap = gap.ok_or("no pose reports missed frames")?.tick;
    let others: Vec<_> = seen
        .axes
        .iter()
        .filter(|a| a.tick != gap)
        .copied()
        .collect();
    same_words(&others, &bench.poses, 0, 0)?;
    expect(others.iter().any(|a| a.tick > gap + 100), || {
        "no poses after".to_owned()
    })?;
    equal("missed ticks reported", seen.missed_ticks(), Some(3))?;
    stays_in_step(&seen, 1)?;
    no_resets(&machine)
}

/// The watchdog bites when ticks stay away; the program starts again, says so and goes on.
pub fn a_watchdog_reset(bench: &Bench) -> Outcome {
    let mut machine = bench.machine(PART, [&bench.blob, &[]])?;
    machine.run_ticks(1000)?;
    let before = Seen::since_last(&mut machine);
    equal("the flag before", before.flags() & flag::WATCHDOG_RESET, 0)?;
    machine.hold_ns = 60 * MS;
    machine.run_ticks(2000)?;
    equal("watchdog resets", machine.watchdog_resets, 1)?;
    let after = Seen::since_last(&mut machine);
    equal(
        "the flag after",
        after.flags() & flag::WATCHDOG_RESET,
        flag::WATCHDOG_RESET,
    )?;
    let good = after.axes.iter().filter(|a| a.status == 0).count();
    expect(good > 3 * 1900, || {
        format!("only {good} good words after the reset")
    })?;
    Ok(())
}

/// Ticks that all overrun do not feed the watchdog: it bites.
pub fn overrun_ticks_do_not_feed(bench: &Bench) -> Outcome {
    let mut machine = bench.machine(PART, [&bench.blob, &[]])?;
    machine.run_ticks(100)?;
    // An SPI so slow that the codes of a tick take 2.4 ms.
    machine.chip.spi_byte_ns = Some(80_000);
    for _ in 0..30 {
        if machine.watchdog_resets == 0 {
            machine.run_ticks(1)?;
        }
    }
    equal("bites of the watchdog", machine.watchdog_resets, 1)?;
    machine.chip.spi_byte_ns = None;
    machine.run_ticks(1000)?;
    let after = Seen::since_last(&mut machine);
    let good = after.axes.iter().filter(|a| a.status == 0).count();
    expect(good > 2000, || {
        format!("only {good} good words after the reset")
    })
}

/// Settings that an interrupt left changed are restored before the decoding, and counted.
pub fn fpu_settings_left_behind(bench: &Bench) -> Outcome {
    let mut machine = bench.machine(PART, [&bench.blob, &[]])?;
    machine.run_ticks(100)?;
    for _ in 0..50 {
        machine.set_fpscr(OTHER_SETTINGS);
        machine.run_ticks(2)?;
    }
    machine.set_fpscr(0);
    let seen = Seen::since_last(&mut machine);
    same_words(&seen.axes, &bench.poses, 0, 191)?;
    let counted = Stage::read(&machine, bench, PART)?.fpu_restored;
    expect(counted >= 50, || format!("only {counted} counted"))
}

/// Settings that change during the decoding: the pose of that tick is withdrawn.
pub fn fpu_settings_changed_during_the_decoding(bench: &Bench) -> Outcome {
    let mut machine = bench.machine(PART, [&bench.blob, &[]])?;
    machine.hook_fpscr(bench.image(PART).address("firmware4node3run")?)?;
    machine.run_ticks(100)?;
    Seen::since_last(&mut machine);
    machine.chip.fpscr_to_write = OTHER_SETTINGS;
    machine.run_ticks(100)?;
    let during = Seen::since_last(&mut machine);
    let invalid = Status::PLANAR_INVALID.with(Status::VERTICAL_INVALID).bits();
    let wrong = during.axes.iter().filter(|a| a.tick > 101);
    let wrong = wrong.filter(|a| a.word != 0 || a.status != invalid).count();
    equal("words that were not withdrawn", wrong, 0)?;
    expect(during.axes.len() > 300, || {
        format!("only {} words", during.axes.len())
    })?;
    machine.chip.fpscr_to_write = 0;
    machine.run_ticks(100)?;
    let after = Seen::since_last(&mut machine);
    same_words(&after.axes, &bench.poses, 203, 81)
}

/// The clock of 32 bits wraps after 71 minutes: no tick is lost or doubled.
pub fn the_clock_wraps(bench: &Bench) -> Outcome {
    let mut machine = bench.machine(PART, [&bench.blob, &[]])?;
    machine.chip.timer_offset_us = u32::MAX - 200_500;
    machine.run_ticks(300)?;
    let seen = Seen::since_last(&mut machine);
    same_words(&seen.axes, &bench.poses, 0, 298)?;
    stays_in_step(&seen, 0)?;
    equal("missed ticks", seen.missed_ticks(), Some(0))
}

/// A core that would give interrupts wrong settings fails the self-test: no pose, and the state
/// says so.
pub fn fpu_defaults_that_are_wrong(bench: &Bench) -> Outcome {
    let mut machine = bench.machine(PART, [&bench.blob, &[]])?;
    const FPDSCR: usize = 0xef3c;
    machine.chip.write_core(FPDSCR, OTHER_SETTINGS);
    machine.run_ticks(200)?;
    let seen = Seen::since_last(&mut machine);
    equal("words of poses", seen.axes.len(), 0)?;
    expect(seen.statuses.len() >= 12, || {
        "too few status frames".to_owned()
    })?;
    let failed = (Some(NodeState::SelfTestFailed), 1);
    let other = seen
        .statuses
        .iter()
        .find(|(_, s)| (s.state, s.reason) != failed);
    equal(
        "another state",
        other.map(|(tick, s)| (*tick, s.state)),
        None,
    )?;
    // Nor are there any parameters that run.
    let (read, _) = talk(&mut machine, |talk| on::read_back(talk, &mut |_, _| {}))?;
    let read = read.map(|(_, blob)| blob);
    equal("running", read, Err(UpdateError::NothingRuns))?;
    no_resets(&machine)
}
