//! The zero deviation over resets: kept by the controller that measured it, and by no other.

use super::asking::{answers, ask};
use super::commands::{REZERO, SERVO_OFF, at_rest};
use super::start::tick_now;
use crate::bench::{Bench, Seen};
use crate::machine::Machine;
use hal_adapters::can::command::Outcome as Ended;
use hal_adapters::can::status::{NodeState, board_check, flag};

const MS: u64 = 1_000_000;
/// X of a stage at rest once it is re-zeroed is less than this, m, and more than this before.
const NOISE_M: f32 = 0.5e-6;

/// Words of X that are valid, and how many of them lie this near to the zero.
fn near_zero(seen: &Seen) -> (usize, usize) {
    let valid = || seen.x().filter(|axis| axis.is_valid());
    let near = valid().filter(|axis| f32::from_bits(axis.word).abs() < NOISE_M);
    (valid().count(), near.count())
}

fn expect_zero(seen: &Seen, is_set: bool) {
    let (valid, near) = near_zero(seen);
    assert!(valid > 200, "only {valid} poses");
    assert_eq!(near, if is_set { valid } else { 0 });
    assert_eq!(
        seen.flags() & flag::ZERO_SET,
        if is_set { flag::ZERO_SET } else { 0 }
    );
}

/// A controller whose stage was re-zeroed at rest.
fn re_zeroed(bench: &Bench) -> Machine {
    let rows = at_rest([100, -50, 70, 10, 20, -30]);
    let mut machine = bench.machine_playing([&bench.blob, &[]], rows);
    machine.run_ticks(300);
    expect_zero(&Seen::since_last(&mut machine), false);
    answers(&mut machine, &[(SERVO_OFF, 1, Ended::Done)]);
    ask(&mut machine, REZERO, 2, 420);
    // All frames of the last tick are sent then.
    machine.run_ns(300 * 2 * MS + 3 * MS / 2);
    expect_zero(&Seen::since_last(&mut machine), true);
    machine
}

/// A reset by the watchdog: the first pose after it has the zero subtracted.
pub fn over_a_watchdog_reset(bench: &Bench) {
    let mut machine = re_zeroed(bench);
    let at = tick_now(&machine);
    machine.hold_ns = 25 * MS;
    machine.run_ticks(300);
    assert_eq!(machine.watchdog_resets, 1);
    let seen = Seen::since_last(&mut machine);
    expect_zero(&seen, true);
    assert_eq!(seen.page(11), Some(0));
    let reported = seen
        .first_state(flag::WATCHDOG_RESET)
        .expect("it was never reported");
    let (valid, near) = near_zero(&seen);
    println!(
        "FAULT   watchdog reset with a zero set | {} | {}",
        reported - at,
        valid - near
    );
}

/// A reset by the pin is no fault; the zero stays.
pub fn over_a_reset_by_pin(bench: &Bench) {
    let mut machine = re_zeroed(bench);
    machine.reset_by_pin();
    let seen = Seen::after(&mut machine, 300);
    expect_zero(&seen, true);
    assert_eq!(seen.first_state(flag::WATCHDOG_RESET), None);
    let pages = [6, 9, 11].map(|number| seen.page(number));
    assert_eq!(pages, [Some(0); 3]);
}

/// Power-on: no zero, and none is missed.
pub fn over_power_on(bench: &Bench) {
    let mut machine = re_zeroed(bench);
    machine.power_cycle();
    let seen = Seen::after(&mut machine, 300);
    expect_zero(&seen, false);
    assert_eq!(seen.page(11), Some(0));
}

/// What ran is no longer in flash, or the record is damaged: no pose, and the state says so and that a zero is
/// lost.
pub fn lost(bench: &Bench) {
    let image = &bench.image;
    let record = image.address("RETAINED");
    type Change<'c> = &'c dyn Fn(&mut Machine);
    let changes: [(&str, u8, Change<'_>); 2] = [
        ("what ran is no longer in flash", 3, &|machine| {
            machine.chip.flash.sectors.load(0, &bench.later);
        }),
        ("what ran is not known: its record damaged", 2, &|machine| {
            machine.flip(record, 8 * 24 + 5);
        }),
    ];
    for (fault, reason, change) in changes {
        let mut machine = re_zeroed(bench);
        change(&mut machine);
        machine.hold_ns = 25 * MS;
        Seen::after(&mut machine, 300);
        let seen = Seen::after(&mut machine, 300);
        assert_eq!(seen.axes.len(), 0);
        let stopped = Some((NodeState::Stopped, reason));
        assert_eq!(seen.last_state(), stopped);
        assert_eq!(seen.page(11), Some(board_check::ZERO_LOST));
        println!("FAULT   {fault} | in the first state | 0");
    }
}
