//! The zero deviation over resets: kept by the controller that measured it, and by no other.

use super::asking::{answers, ask};
use super::commands::{REZERO, SERVO_OFF, at_rest};
use super::start::{first_state, page, tick_now};
use super::{Failure, Outcome, equal, expect};
use crate::adc_model::Part;
use crate::bench::{Bench, Seen};
use crate::machine::Machine;
use hal_adapters::can::command::Outcome as Ended;
use hal_adapters::can::status::{NodeState, board_check, flag};
use runtime::Status;

const PART: Part = Part::Ads131m08;
const MS: u64 = 1_000_000;
/// X of a stage at rest once it is re-zeroed is less than this, m, and more than this before.
const NOISE_M: f32 = 0.5e-6;

/// Words of X that are valid, and how many of them lie this near to the zero.
fn near_zero(seen: &Seen) -> (usize, usize) {
    let invalid = Status::PLANAR_INVALID.bits();
    let x = seen.axes.iter().filter(|axis| axis.axis == 0);
    let valid: Vec<_> = x.filter(|axis| axis.status & invalid == 0).collect();
    let near = |word: u32| f32::from_bits(word).abs() < NOISE_M;
    let count = valid.iter().filter(|axis| near(axis.word)).count();
    (valid.len(), count)
}

fn expect_zero(seen: &Seen, is_set: bool) -> Outcome {
    let (valid, near) = near_zero(seen);
    expect(valid > 200, || format!("only {valid} poses"))?;
    equal("poses at the zero", near, if is_set { valid } else { 0 })?;
    equal(
        "flag",
        seen.flags() & flag::ZERO_SET,
        if is_set { flag::ZERO_SET } else { 0 },
    )
}

/// A controller whose stage was re-zeroed at rest.
fn re_zeroed(bench: &Bench) -> Result<Machine, Failure> {
    let rows = at_rest([100, -50, 70, 10, 20, -30]);
    let mut machine = bench.machine_playing(PART, [&bench.blob, &[]], rows)?;
    machine.run_ticks(300)?;
    expect_zero(&Seen::since_last(&mut machine), false)?;
    answers(&mut machine, &[(SERVO_OFF, 1, Ended::Done)])?;
    ask(&mut machine, REZERO, 2, 420)?;
    // All frames of the last tick are sent then.
    machine.run_ns(300 * 2 * MS + 3 * MS / 2)?;
    expect_zero(&Seen::since_last(&mut machine), true)?;
    Ok(machine)
}

/// A reset by the watchdog: the first pose after it has the zero subtracted.
pub fn over_a_watchdog_reset(bench: &Bench) -> Outcome {
    let mut machine = re_zeroed(bench)?;
    let at = tick_now(&machine);
    machine.hold_ns = 25 * MS;
    machine.run_ticks(300)?;
    equal("resets", machine.watchdog_resets, 1)?;
    let seen = Seen::since_last(&mut machine);
    expect_zero(&seen, true)?;
    equal("checks", page(&seen, 11), Some(0))?;
    let reported = first_state(&seen, flag::WATCHDOG_RESET).ok_or("it was never reported")?;
    let (valid, near) = near_zero(&seen);
    println!(
        "FAULT   controller | watchdog reset with a zero set | {} | {}",
        reported - at,
        valid - near
    );
    Ok(())
}

/// A reset by the pin is no fault; the zero stays.
pub fn over_a_reset_by_pin(bench: &Bench) -> Outcome {
    let mut machine = re_zeroed(bench)?;
    machine.reset_by_pin();
    machine.run_ticks(300)?;
    let seen = Seen::since_last(&mut machine);
    expect_zero(&seen, true)?;
    equal(
        "flag of a fault",
        first_state(&seen, flag::WATCHDOG_RESET),
        None,
    )?;
    let pages = [6, 9, 11].map(|number| page(&seen, number));
    equal("faults and checks", pages, [Some(0); 3])
}

/// Power-on: no zero, and none is missed.
pub fn over_power_on(bench: &Bench) -> Outcome {
    let mut machine = re_zeroed(bench)?;
    machine.power_cycle();
    machine.run_ticks(300)?;
    let seen = Seen::since_last(&mut machine);
    expect_zero(&seen, false)?;
    equal("checks", page(&seen, 11), Some(0))
}

/// What ran is no longer in flash, or the record is damaged: no pose, and the state says so and that a zero is
/// lost.
pub fn lost(bench: &Bench) -> Outcome {
    let image = bench.image(PART);
    let slot = image.address("_parameter_slot_0")?;
    let record = image.address("RETAINED")?;
    type Change<'c> = &'c dyn Fn(&mut Machine);
    let changes: [(&str, u8, Change<'_>); 2] = [
        ("what ran is no longer in flash", 3, &|machine| {
            machine.write_flash(slot, &bench.later);
        }),
        ("what ran is not known: its record damaged", 2, &|machine| {
            machine.flip(record, 8 * 24 + 5);
        }),
    ];
    for (fault, reason, change) in changes {
        let mut machine = re_zeroed(bench)?;
        change(&mut machine);
        machine.hold_ns = 25 * MS;
        machine.run_ticks(300)?;
        Seen::since_last(&mut machine);
        machine.run_ticks(300)?;
        let seen = Seen::since_last(&mut machine);
        equal("words of poses", seen.axes.len(), 0)?;
        let stopped = Some((NodeState::Stopped, reason));
        equal("state", seen.last_state(), stopped)?;
        equal("checks", page(&seen, 11), Some(board_check::ZERO_LOST))?;
        println!("FAULT   controller | {fault} | in the first state | 0");
    }
    Ok(())
}
