//! Ticks that come late, a watchdog that resets, settings of the FPU that change.

use super::log::Stage;
use super::start::TICK;
use super::{no_resets, same_words};
use crate::bench::{Axis, Bench, Seen};
use crate::unicorn::register;
use hal_adapters::can::status::{NodeState, flag};
use runtime::Status;

const MS: u64 = 1_000_000;
/// FPSCR that rounds towards zero and flushes subnormal numbers.
const OTHER_SETTINGS: u32 = 0b111 << 22;

/// All ticks but `late` send X within 0.4 ms of their due time.
fn stays_in_step(seen: &Seen, late: usize) {
    let found = seen.x().filter(|axis| axis.into_tick_us > 400).count();
    assert_eq!(found, late);
}

/// A tick 0.5 ms late is decoded and counted and shifts no other; missed ticks keep their numbers.
pub fn late_and_missed_ticks(bench: &Bench) {
    // The second is due at tick k and comes 2.3 periods later: ticks k and k + 1 are missed, k + 2 is late.
    for (hold_ns, missed) in [(MS / 2, 1), (46 * MS / 10, 3)] {
        let mut machine = bench.machine([&bench.blob, &[]]);
        machine.run_ticks(100);
        machine.hold_ns = hold_ns;
        let seen = Seen::after(&mut machine, 200);
        let after_a_gap = |axis: &&Axis| axis.status == Status::FRAMES_MISSED.bits();
        let gap = seen.axes.iter().find(after_a_gap).map(|axis| axis.tick);
        assert_eq!(gap.is_some(), missed > 1);
        let mut others = seen.axes.clone();
        others.retain(|axis| Some(axis.tick) != gap);
        same_words(&others, &bench.poses, 0, 295);
        assert_eq!(seen.last_status().map(|s| s.missed_ticks), Some(missed));
        stays_in_step(&seen, 1);
        no_resets(&machine);
    }
}

/// The watchdog resets when ticks stay away, and when all of them overrun; the program starts again,
/// reports the reset and goes on.
pub fn a_watchdog_reset(bench: &Bench) {
    for overruns in [false, true] {
        let mut machine = bench.machine([&bench.blob, &[]]);
        let before = Seen::after(&mut machine, 100);
        assert_eq!(before.flags() & flag::WATCHDOG_RESET, 0);
        if overruns {
            // An SPI so slow that the codes of a tick take 2.4 ms.
            machine.chip.spi_byte_ns = Some(80_000);
        } else {
            machine.hold_ns = 60 * MS;
        }
        for _ in 0..30 {
            if machine.watchdog_resets == 0 {
                machine.run_ticks(1);
            }
        }
        assert_eq!(machine.watchdog_resets, 1);
        machine.chip.spi_byte_ns = None;
        let after = Seen::after(&mut machine, 500);
        assert_eq!(after.flags() & flag::WATCHDOG_RESET, flag::WATCHDOG_RESET);
        let good = after.axes.iter().filter(|a| a.status == 0).count();
        assert!(good > 1000, "only {good} good words after the reset");
    }
}

/// The program restores settings that an interrupt left changed before it decodes, and counts them.
pub fn fpu_settings_left_behind(bench: &Bench) {
    let mut machine = bench.machine([&bench.blob, &[]]);
    machine.run_ticks(100);
    for _ in 0..50 {
        machine.set_fpscr(OTHER_SETTINGS);
        machine.run_ticks(2);
    }
    machine.set_fpscr(0);
    let seen = Seen::since_last(&mut machine);
    same_words(&seen.axes, &bench.poses, 0, 191);
    assert!(Stage::read(&machine).count("fpu_restored") >= 50);
}

/// Settings that change during the decoding withdraw the pose of that tick.
pub fn fpu_settings_changed_during_the_decoding(bench: &Bench) {
    let mut machine = bench.machine([&bench.blob, &[]]);
    machine.hook_injection(bench.image.address(TICK));
    Seen::after(&mut machine, 100);
    machine.chip.inject = vec![(register::FPSCR, OTHER_SETTINGS)];
    machine.chip.injects_again = true;
    let during = Seen::after(&mut machine, 100);
    let invalid = Status::PLANAR_INVALID.with(Status::VERTICAL_INVALID).bits();
    let wrong = during.axes.iter().filter(|a| a.tick > 101);
    let wrong = wrong.filter(|a| a.word != 0 || a.status != invalid).count();
    assert_eq!(wrong, 0);
    assert!(during.axes.len() > 300, "only {} words", during.axes.len());
    machine.chip.inject.clear();
    let after = Seen::after(&mut machine, 100);
    same_words(&after.axes, &bench.poses, 203, 81);
}

/// The clock of 32 bits wraps after 71 minutes: no tick is lost or doubled.
pub fn the_clock_wraps(bench: &Bench) {
    let mut machine = bench.machine([&bench.blob, &[]]);
    machine.chip.timer_offset_us = u32::MAX - 200_500;
    let seen = Seen::after(&mut machine, 300);
    same_words(&seen.axes, &bench.poses, 0, 298);
    stays_in_step(&seen, 0);
    assert_eq!(seen.last_status().map(|s| s.missed_ticks), Some(0));
}

/// A core with wrong default settings for interrupts fails the self-test: no pose, and the state says so.
pub fn fpu_defaults_that_are_wrong(bench: &Bench) {
    let mut machine = bench.machine([&bench.blob, &[]]);
    const FPDSCR: usize = 0xef3c;
    machine.chip.write_core(FPDSCR, OTHER_SETTINGS);
    let seen = Seen::after(&mut machine, 200);
    assert_eq!(seen.axes.len(), 0);
    assert!(seen.statuses.len() >= 12, "too few status frames");
    let failed = (Some(NodeState::SelfTestFailed), 1);
    let mut states = seen.statuses.iter().map(|(_, s)| (s.state, s.reason));
    assert!(states.all(|state| state == failed));
    no_resets(&machine)
}
