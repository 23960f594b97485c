//! Starts that go wrong, clocks that stop, programs that crash: what the controller reports, and that no pose
//! is wrong meanwhile. Each check prints a row: the fault, the ticks until it was reported, and the
//! words of poses that were sent as valid and were wrong.

use super::log::Stage;
use super::{Failure, Outcome, equal, expect, no_resets};
use crate::adc_model::Part;
use crate::bench::{Axis, Bench, Seen};
use crate::callbacks::Injected;
use crate::can_model::BusState;
use crate::clock_model::Pll;
use crate::machine::{ACCESS_AND_STACKING, Machine};
use crate::unicorn::register;
use hal_adapters::can::status::{board_check, flag};
use runtime::Status;

const PART: Part = Part::Ads131m08;
/// Where there is no memory and no peripheral.
const NOWHERE: u32 = 0x6000_0000;
/// The function of the tick's arithmetic, where faults are put in.
pub const TICK: &str = "firmware4node3run";

/// Words that were sent as valid and are those of neither their tick nor the one before, whose
/// codes a tick after a reset may still have.
pub fn wrong_valid(bench: &Bench, axes: &[Axis]) -> usize {
    let wrong = |axis: &&Axis| {
        let invalid = if axis.axis < 3 {
            Status::PLANAR_INVALID
        } else {
            Status::VERTICAL_INVALID
        };
        let of = |tick: u64| bench.poses[tick as usize % bench.poses.len()].words[axis.axis];
        let right = [of(axis.tick), of(axis.tick.saturating_sub(1))];
        axis.status & invalid.bits() == 0 && !right.contains(&axis.word)
    };
    axes.iter().filter(wrong).count()
}

/// Prints the row of a fault. `reported` is the tick of the first frame that reports it.
pub fn row(bench: &Bench, fault: &str, at: u64, reported: Option<u64>, axes: &[Axis]) -> Outcome {
    let reported = reported.ok_or("it was never reported")?;
    let wrong = wrong_valid(bench, axes);
    println!(
        "FAULT   controller | {fault} | {} | {wrong}",
        reported.saturating_sub(at)
    );
    equal("valid poses that are wrong", wrong, 0)
}

/// The tick that runs.
pub fn tick_now(machine: &Machine) -> u64 {
    let first_ns = machine.chip.first_tick_ns.unwrap_or(machine.chip.now_ns);
    (machine.chip.now_ns - first_ns) / 2_000_000
}

/// The tick of the first state with all the flags.
pub fn first_state(seen: &Seen, flags: u8) -> Option<u64> {
    let mut states = seen.statuses.iter();
    let first = states.find(|(_, status)| status.flags & flags == flags);
    first.map(|(tick, _)| *tick)
}

pub fn page(seen: &Seen, number: u8) -> Option<u32> {
    let mut pages = seen.health.iter().rev();
    pages
        .find(|page| page.page == number)
        .map(|page| page.value)
}

/// Kind and step, address and detail of the last fault of the health frames.
fn reported_fault(seen: &Seen) -> Option<[u32; 3]> {
    Some([page(seen, 6)?, page(seen, 7)?, page(seen, 8)?])
}

/// A tick, counted from power-on in place of the first tick, which must come within so many.
fn since_power_on(
    machine: &Machine,
    tick: Option<u64>,
    first_max: u64,
) -> Result<Option<u64>, Failure> {
    let first = machine.chip.first_tick_ns.unwrap_or(u64::MAX) / 2_000_000;
    expect(first <= first_max, || {
        format!("the first tick came {first} periods after power-on")
    })?;
    Ok(tick.map(|tick| first + tick))
}

fn flashes(machine: &mut Machine) -> Result<u32, String> {
    let (mut flashes, mut lit) = (0, machine.chip.led);
    for _ in 0..500 {
        machine.run_ticks(1)?;
        flashes += u32::from(machine.chip.led && !lit);
        lit = machine.chip.led;
    }
    Ok(flashes)
}

fn valid(axes: &[Axis]) -> usize {
    let invalid = Status::PLANAR_INVALID.with(Status::VERTICAL_INVALID).bits();
    axes.iter()
        .filter(|axis| axis.status & invalid == 0)
        .count()
}

/// A supply that rises slowly: nothing runs faster than after a reset and nothing is written before it
/// is sound, and the watchdog does not bite meanwhile.
pub fn supply_that_comes_late(bench: &Bench) -> Outcome {
    const LATE_NS: u64 = 300_000_000;
    let mut machine = bench.machine(PART, [&bench.blob, &[]])?;
    machine.chip.supply_low_until_ns = LATE_NS;
    machine.run_ticks(400)?;
    let first_ns = machine.chip.first_tick_ns.unwrap_or(0);
    expect(first_ns > LATE_NS, || format!("a tick at {first_ns} ns"))?;
    let raised_ns = machine.chip.clocks.pll_since;
    expect(raised_ns > LATE_NS, || {
        format!("the PLL runs at {raised_ns} ns")
    })?;
    no_resets(&machine)?;
    let seen = Seen::since_last(&mut machine);
    expect(valid(&seen.axes) > 700, || "too few poses".to_owned())?;
    row(
        bench,
        "supply low for 0.3 s at power-on",
        0,
        Some(0),
        &seen.axes,
    )
}

/// No crystal: the internal oscillator from the start, shown by flag, check and light.
pub fn no_crystal(bench: &Bench) -> Outcome {
    let mut machine = bench.machine(PART, [&bench.blob, &[]])?;
    machine.chip.clocks.crystal = false;
    equal("flashes", flashes(&mut machine)?, 4)?;
    let seen = Seen::since_last(&mut machine);
    let checks = page(&seen, 11);
    equal("checks", checks, Some(board_check::INTERNAL_OSCILLATOR))?;
    equal("fault", reported_fault(&seen), Some([0; 3]))?;
    expect(valid(&seen.axes) > 1800, || "too few poses".to_owned())?;
    no_resets(&machine)?;
    let reported = first_state(&seen, flag::INTERNAL_OSCILLATOR);
    let reported = since_power_on(&machine, reported, 10)?;
    row(bench, "crystal absent", 0, reported, &seen.axes)
}

/// On the internal oscillator a bus-off is for good: a clock that is too inexact disturbs the bus
/// once, and then no more.
pub fn silent_after_bus_off(bench: &Bench) -> Outcome {
    let mut machine = bench.machine(PART, [&bench.blob, &[]])?;
    machine.chip.clocks.crystal = false;
    machine.run_ticks(100)?;
    for bus in [BusState::Off, BusState::Good] {
        machine.set_bus(bus);
        machine.run_ticks(10)?;
    }
    Seen::since_last(&mut machine);
    machine.run_ticks(500)?;
    let frames = Seen::since_last(&mut machine).axes.len();
    equal("words on the bus", frames, 0)?;
    let stage = Stage::read(&machine, bench, PART)?;
    equal(
        "the pose in STAGE",
        stage.pose,
        bench.poses[stage.sequence as usize].words,
    )
}

/// The crystal stops while the program runs: it starts anew by the internal oscillator.
pub fn crystal_lost(bench: &Bench) -> Outcome {
    let mut machine = bench.machine(PART, [&bench.blob, &[]])?;
    machine.run_ns(200_700_000)?;
    let before = Seen::since_last(&mut machine);
    equal(
        "flags",
        first_state(&before, flag::INTERNAL_OSCILLATOR),
        None,
    )?;
    let at = tick_now(&machine);
    machine.chip.stop_crystal();
    machine.run_ticks(500)?;
    let seen = Seen::since_last(&mut machine);
    equal("fault", reported_fault(&seen), Some([4, 0, 0]))?;
    equal("faults", page(&seen, 9), Some(1))?;
    equal("resets", (machine.panics, machine.watchdog_resets), (1, 0))?;
    expect(valid(&seen.axes) > 1800, || "too few poses".to_owned())?;
    let reported = first_state(&seen, flag::INTERNAL_OSCILLATOR | flag::WATCHDOG_RESET);
    row(
        bench,
        "crystal lost while running",
        at,
        reported,
        &seen.axes,
    )
}

/// The PLL does not lock to the crystal: the watchdog resets once, and the internal oscillator
/// serves.
pub fn pll_without_lock(bench: &Bench) -> Outcome {
    let mut machine = bench.machine(PART, [&bench.blob, &[]])?;
    machine.chip.clocks.pll = Pll::NotToCrystal;
    machine.run_ticks(500)?;
    let seen = Seen::since_last(&mut machine);
    equal("fault", reported_fault(&seen), Some([0x0105, 0, 0]))?;
    let checks = page(&seen, 11);
    equal("checks", checks, Some(board_check::INTERNAL_OSCILLATOR))?;
    equal("resets", (machine.panics, machine.watchdog_resets), (0, 1))?;
    expect(valid(&seen.axes) > 1800, || "too few poses".to_owned())?;
    let reported = first_state(&seen, flag::INTERNAL_OSCILLATOR);
    // The watchdog's 20 ms, and the start-up twice.
    let reported = since_power_on(&machine, reported, 15)?;
    row(
        bench,
        "PLL does not lock to the crystal",
        0,
        reported,
        &seen.axes,
    )
}

/// The PLL locks to nothing: the chip is broken, starts over and over, and sends nothing.
pub fn pll_dead(bench: &Bench) -> Outcome {
    let mut machine = bench.machine(PART, [&bench.blob, &[]])?;
    machine.chip.clocks.pll = Pll::Dead;
    machine.run_ticks(200)?;
    expect(machine.watchdog_resets > 10, || "no resets".to_owned())?;
    let seen = Seen::since_last(&mut machine);
    println!(
        "FAULT   controller | PLL dead | no frame at all | {}",
        seen.axes.len()
    );
    equal("words on the bus", seen.axes.len(), 0)
}

/// A CAN controller that does not start: no frame, but the poses are there and the light tells.
pub fn can_dead(bench: &Bench) -> Outcome {
    let mut machine = bench.machine(PART, [&bench.blob, &[]])?;
    machine.chip.can.acknowledges = false;
    equal("flashes", flashes(&mut machine)?, 5)?;
    let stage = Stage::read(&machine, bench, PART)?;
    expect(stage.sequence >= 498, || {
        format!("only tick {}", stage.sequence)
    })?;
    equal(
        "the pose in STAGE",
        stage.pose,
        bench.poses[stage.sequence as usize].words,
    )?;
    no_resets(&machine)?;
    let frames = Seen::since_last(&mut machine).axes.len();
    println!(
        "FAULT   controller | CAN does not start | shown by the light from tick 1 on | {frames}"
    );
    equal("words on the bus", frames, 0)
}

/// A receive line that is held low keeps the controller from the bus: the light tells, also
/// without parameters.
pub fn receive_line_low(bench: &Bench) -> Outcome {
    for (slot, flash) in [(&bench.blob[..], 1), (&[], 2)] {
        let mut machine = bench.machine(PART, [slot, &[]])?;
        equal("flashes before", flashes(&mut machine)?, flash)?;
        let mut machine = bench.machine(PART, [slot, &[]])?;
        machine.chip.can.held_low = true;
        machine.run_ticks(500)?;
        equal("flashes", flashes(&mut machine)?, 5)?;
        equal("words", Seen::since_last(&mut machine).axes.len(), 0)?;
    }
    println!("FAULT   controller | CAN receive line low | shown by the light after 0.5 s | 0");
    Ok(())
}

/// Pull-ups and option bytes of the board are reported.
pub fn the_board(bench: &Bench) -> Outcome {
    let cases = [
        (
            [false, true],
            0x0fff_aae1,
            board_check::NO_PULL_UP_ON_SELECT,
        ),
        (
            [true, false],
            0x0fff_aae1,
            board_check::NO_PULL_UP_ON_CONTROL,
        ),
        // As delivered: no brown-out level.
        ([true, true], 0x0fff_aaed, board_check::BROWN_OUT_LOW),
    ];
    for (pulled_up, option_bytes, check) in cases {
        let mut machine = bench.machine(PART, [&bench.blob, &[]])?;
        machine.chip.pulled_up = pulled_up;
        machine.chip.option_bytes = option_bytes;
        machine.run_ticks(200)?;
        let seen = Seen::since_last(&mut machine);
        equal("checks", page(&seen, 11), Some(check))?;
        equal("option bytes", page(&seen, 10), Some(option_bytes))?;
        expect(valid(&seen.axes) > 700, || "too few poses".to_owned())?;
    }
    Ok(())
}

/// A program that crashes reports after the reset how and where.
pub fn crash(bench: &Bench, wanted: &Crash) -> Outcome {
    let mut machine = bench.machine(PART, [&bench.blob, &[]])?;
    machine.hook_injection(bench.image(PART).address(TICK)?)?;
    machine.run_ticks(100)?;
    Seen::since_last(&mut machine);
    let at = tick_now(&machine);
    machine.chip.inject.clone_from(&wanted.inject);
    machine.run_ticks(500)?;
    let seen = Seen::since_last(&mut machine);
    let [kind, address, detail] = reported_fault(&seen).ok_or("no fault is reported")?;
    equal("kind and step", kind, wanted.kind)?;
    expect(wanted.address.contains(&address), || {
        format!("the address is {address:#010x}")
    })?;
    expect(wanted.detail.is_none_or(|wanted| wanted == detail), || {
        format!("the detail is {detail:#x}")
    })?;
    equal("faults", page(&seen, 9), Some(1))?;
    equal("resets", (machine.panics, machine.watchdog_resets), (1, 0))?;
    equal("late stacking still due", machine.lazy_left, false)?;
    expect(valid(&seen.axes) > 1800, || "too few poses".to_owned())?;
    let reported = first_state(&seen, flag::WATCHDOG_RESET);
    row(bench, wanted.fault, at, reported, &seen.axes)
}

/// A crash, and what is reported of it.
pub struct Crash {
    /// Its name.
    pub fault: &'static str,
    inject: Vec<Injected>,
    kind: u32,
    address: std::ops::Range<u32>,
    detail: Option<u32>,
}

/// The crashes.
pub fn crashes(bench: &Bench) -> Result<Vec<Crash>, Failure> {
    let image = bench.image(PART);
    let set = |register, value| Injected { register, value };
    let stack = crate::image::RAM;
    let mut crashes = vec![
        Crash {
            fault: "hard fault: a pointer to nowhere",
            inject: vec![set(register::R0, NOWHERE)],
            kind: 2,
            address: image.range(TICK)?,
            detail: None,
        },
        Crash {
            fault: "hard fault: a jump to nowhere",
            inject: vec![set(register::PC, NOWHERE | 1)],
            kind: 2,
            address: NOWHERE..NOWHERE + 2,
            detail: None,
        },
        Crash {
            fault: "stack overflow",
            inject: vec![set(register::SP, stack + 8)],
            kind: 3,
            address: stack - 0x1000..stack,
            detail: Some(ACCESS_AND_STACKING),
        },
    ];
    // A program from which the linker removed every panic has no such function.
    if let Ok(panic) = image.address("9panicking9panic_fmt") {
        // The message is not looked at. The place that it came from is any words of flash here.
        let place = image.address("_stext")?;
        crashes.push(Crash {
            fault: "panic",
            inject: vec![
                set(register::R0, place),
                set(register::R0 + 1, place),
                set(register::PC, panic | 1),
            ],
            kind: 1,
            address: place..place + 1,
            detail: Some(image.word(place + 8)),
        });
    }
    Ok(crashes)
}
