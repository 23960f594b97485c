//! The zero deviation over resets: the controller that measured it keeps it, and no other.

use super::asking::{SERVO_OFF, answers, ask};
use super::start::tick_now;
use crate::adc_model::Row;
use crate::bench::{Bench, Seen};
use crate::machine::Machine;
use hal_adapters::can::command::{Outcome, Request};
use hal_adapters::can::status::{NodeState, board_check, flag};

const MS: u64 = 1_000_000;
/// X of a re-zeroed stage at rest stays below this, m; before the re-zero it is above.
const NOISE_M: f32 = 0.5e-6;

/// Rows of a stage at rest: the noise of a few codes around one row.
fn rows_at_rest(rest: Row) -> Vec<Row> {
    let noise = |k: usize, c: usize| (k as i32 * 7 + c as i32 * 3) % 5 - 2;
    (0..1000)
        .map(|k| core::array::from_fn(|c| rest[c] + noise(k, c)))
        .collect()
}

/// All valid words of X lie near the zero, or none; the flag agrees. Returns their number.
fn expect_zero(seen: &Seen, is_set: bool) {
    let valid = || seen.x().filter(|axis| axis.is_valid());
    let near = valid().filter(|axis| f32::from_bits(axis.word).abs() < NOISE_M);
    assert!(valid().count() > 200, "only {} poses", valid().count());
    assert_eq!(near.count(), if is_set { valid().count() } else { 0 });
    assert_eq!(seen.flags() & flag::ZERO_SET != 0, is_set);
}

/// A controller after a re-zero at rest.
fn re_zeroed(bench: &Bench) -> Machine {
    let rows = rows_at_rest([100, -50, 70, 10, 20, -30]);
    let mut machine = bench.machine_playing([&bench.blob, &[]], rows);
    machine.run_ticks(300);
    expect_zero(&Seen::since_last(&mut machine), false);
    answers(&mut machine, &[(SERVO_OFF, 1, Outcome::Done)]);
    ask(&mut machine, Request::Rezero { ticks: 400 }, 2, 420);
    // All frames of the last tick are sent then.
    machine.run_ns(300 * 2 * MS + 3 * MS / 2);
    expect_zero(&Seen::since_last(&mut machine), true);
    machine
}

/// The first pose after a reset by the watchdog, by the pin or by a brown-out has the zero deviation subtracted. After
/// power-on there is no zero deviation, and none is missed.
pub fn over_resets(bench: &Bench) {
    type Reset = fn(&mut Machine);
    let resets: [(Reset, bool, bool); 4] = [
        (|machine| machine.hold_ns = 25 * MS, true, true),
        (Machine::reset_by_pin, true, false),
        (Machine::brown_out, true, false),
        (Machine::power_cycle, false, false),
    ];
    for (reset, stays, by_fault) in resets {
        let mut machine = re_zeroed(bench);
        let at = tick_now(&machine);
        reset(&mut machine);
        let seen = Seen::after(&mut machine, 300);
        expect_zero(&seen, stays);
        assert_eq!(machine.watchdog_resets, u32::from(by_fault));
        assert_eq!(seen.page(9), Some(u32::from(by_fault)));
        assert_eq!(seen.page(11), Some(0));
        let reported = seen.first_state(flag::WATCHDOG_RESET);
        assert_eq!(reported.is_some(), by_fault);
        if let Some(reported) = reported {
            let ticks = reported - at;
            println!("FAULT   watchdog reset with a zero set | {ticks} | 0");
        }
    }
}

/// The running blob is gone from flash, or the retained record is damaged, when a brown-out or the watchdog resets: no pose
/// comes, and the state says so and reports a lost zero deviation.
pub fn lost(bench: &Bench) {
    let record = bench.image.address("RETAINED");
    type Change<'c> = &'c dyn Fn(&mut Machine);
    let changes: [(&str, u8, Change<'_>); 2] = [
        ("the running blob is gone from flash", 3, &|machine| {
            machine.chip.flash.sectors.load(0, &bench.later);
        }),
        ("the retained record is damaged", 2, &|machine| {
            machine.flip(record, 8 * 24 + 5);
        }),
    ];
    let resets: [fn(&mut Machine); 2] = [Machine::brown_out, |machine| machine.hold_ns = 25 * MS];
    let cases = changes
        .iter()
        .flat_map(|change| resets.map(|reset| (change, reset)));
    for ((fault, reason, change), reset) in cases {
        let mut machine = re_zeroed(bench);
        change(&mut machine);
        reset(&mut machine);
        Seen::after(&mut machine, 300);
        let seen = Seen::after(&mut machine, 300);
        assert_eq!(seen.axes.len(), 0);
        assert_eq!(seen.last_state(), Some((NodeState::Stopped, *reason)));
        assert_eq!(seen.page(11), Some(board_check::ZERO_LOST));
        println!("FAULT   {fault} | in the first state | 0");
    }
}
