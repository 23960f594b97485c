//! Starts that go wrong, clocks that stop, programs that crash: the report, and no wrong pose meanwhile. Each
//! check prints a row: the fault, the ticks until it was reported, and the valid poses that were wrong.

use super::log::Stage;
use super::{no_resets, wrong_valid};
use crate::bench::{Axis, Bench, Seen};
use crate::can_model::BusState;
use crate::clock_model::Pll;
use crate::machine::{ACCESS_AND_STACKING, Machine};
use crate::unicorn::register;
use hal_adapters::can::status::{board_check, flag};

/// An address without memory and peripheral.
pub const NOWHERE: u32 = 0x6000_0000;
/// The function of the tick's arithmetic, where faults are put in.
pub const TICK: &str = "stage_node4node3run";

/// Prints the row of a fault. `reported` is the tick of the first frame that reports it.
pub fn row(bench: &Bench, fault: &str, at: u64, reported: Option<u64>, axes: &[Axis]) {
    let reported = reported.expect("it was never reported");
    let wrong = wrong_valid(axes, &bench.poses, 1);
    let ticks = reported.saturating_sub(at);
    println!("FAULT   {fault} | {ticks} | {wrong}");
    assert_eq!(wrong, 0);
}

/// The tick that runs.
pub fn tick_now(machine: &Machine) -> u64 {
    let first_ns = machine.chip.first_tick_ns.unwrap_or(machine.chip.now_ns);
    (machine.chip.now_ns - first_ns) / 2_000_000
}

/// Kind and step, address and detail of the last fault in the health frames.
fn reported_fault(seen: &Seen) -> Option<[u32; 3]> {
    Some([seen.page(6)?, seen.page(7)?, seen.page(8)?])
}

/// Flashes of the LED in 500 ticks.
fn flashes(machine: &mut Machine) -> u32 {
    let (mut flashes, mut lit) = (0, machine.chip.led);
    for _ in 0..500 {
        machine.run_ticks(1);
        flashes += u32::from(machine.chip.led && !lit);
        lit = machine.chip.led;
    }
    flashes
}

fn valid(axes: &[Axis]) -> usize {
    axes.iter().filter(|axis| axis.is_valid()).count()
}

/// A supply that rises slowly: the clocks stay slow and nothing is written before it is sound, and the
/// watchdog does not reset meanwhile.
pub fn supply_that_comes_late(bench: &Bench) {
    const LATE_NS: u64 = 300_000_000;
    let mut machine = bench.machine([&bench.blob, &[]]);
    machine.chip.supply_low_until_ns = LATE_NS;
    machine.run_ticks(400);
    let first_ns = machine.chip.first_tick_ns.unwrap_or(0);
    assert!(first_ns > LATE_NS, "a tick at {first_ns} ns");
    let raised_ns = machine.chip.clocks.pll_since;
    assert!(raised_ns > LATE_NS, "the PLL runs at {raised_ns} ns");
    no_resets(&machine);
    let seen = Seen::since_last(&mut machine);
    assert!(valid(&seen.axes) > 700, "too few poses");
    let fault = "supply low for 0.3 s at power-on";
    row(bench, fault, 0, Some(0), &seen.axes)
}

/// A crystal that takes 45 ms is awaited.
pub fn slow_crystal(bench: &Bench) {
    let mut machine = bench.machine([&bench.blob, &[]]);
    machine.chip.clocks.crystal_start_ns = 45_000_000;
    let seen = Seen::after(&mut machine, 200);
    assert_eq!(seen.flags() & flag::INTERNAL_OSCILLATOR, 0);
    assert!(valid(&seen.axes) > 700, "too few poses");
    no_resets(&machine);
}

/// A bit of the parameters in RAM flips: the program resets and loads them again.
pub fn parameters_change(bench: &Bench) {
    for k in 0..3 {
        let mut machine = bench.running(700);
        let at = tick_now(&machine);
        let constants = constants(bench, &machine);
        // Around the middle: a few of the first are in the last pose.
        machine.flip(constants[constants.len() / 2 + 5 * k], 20);
        let seen = Seen::after(&mut machine, 600);
        assert_eq!((machine.panics, machine.watchdog_resets), (1, 0));
        assert_eq!(reported_fault(&seen), Some([6, 0, 0]));
        let reported = seen.first_state(flag::WATCHDOG_RESET).expect("no report");
        let ticks = reported - at;
        let wrong = wrong_valid(&seen.axes, &bench.poses, 1) as u64;
        println!("FAULT   a bit of parameters in RAM flips | {ticks} | {wrong}");
        assert!(ticks < 280 && wrong < 280);
        let mut late = seen.axes;
        late.retain(|axis| axis.tick > reported);
        assert_eq!(wrong_valid(&late, &bench.poses, 1), 0);
        assert!(valid(&late) > 1000);
    }
}

/// Addresses of the static words that are numbers of the blob, bit for bit.
fn constants(bench: &Bench, machine: &Machine) -> Vec<u32> {
    let is_number = |word: &u32| {
        let size = f32::from_bits(*word).abs();
        word.trailing_zeros() < 8 && (1e-9..1e9).contains(&size) && !word.to_le_bytes().is_ascii()
    };
    let words = bench.blob.array_windows().map(|w| u32::from_le_bytes(*w));
    let words: Vec<_> = words.filter(is_number).collect();
    let statics = crate::image::RAM + bench.image.stack_bytes as u32;
    let mut found: Vec<_> = (statics..statics + bench.image.static_bytes as u32)
        .step_by(4)
        .collect();
    found.retain(|at| words.contains(&machine.word(*at)));
    assert!(found.len() > 20, "only {} constants", found.len());
    found
}

/// Without a crystal the internal oscillator serves; flag, check and light show it. The crystal is absent,
/// stops while the program runs (a restart), or the PLL does not lock to it (one reset by the watchdog).
pub fn no_crystal(bench: &Bench) {
    type Fault = fn(&mut Machine);
    let absent: Fault = |m| m.chip.clocks.crystal = false;
    let lost: Fault = |m| m.chip.stop_crystal();
    let unlocked: Fault = |m| m.chip.clocks.pll = Pll::NotToCrystal;
    // Fault, start of it, the fault itself, its kind and step, resets by the program and by the watchdog.
    let cases = [
        ("crystal absent", 0, absent, 0, (0, 0)),
        ("crystal lost while running", 200_700_000, lost, 4, (1, 0)),
        (
            "PLL does not lock to the crystal",
            0,
            unlocked,
            0x105,
            (0, 1),
        ),
    ];
    for (fault, from_ns, spoil, kind, resets) in cases {
        let mut machine = bench.machine([&bench.blob, &[]]);
        if from_ns > 0 {
            machine.run_ns(from_ns);
            let before = Seen::since_last(&mut machine);
            assert_eq!(before.first_state(flag::INTERNAL_OSCILLATOR), None);
        }
        spoil(&mut machine);
        let at = tick_now(&machine);
        let flashes = flashes(&mut machine);
        assert!(flashes == 4 || resets != (0, 0), "{flashes} flashes");
        let seen = Seen::since_last(&mut machine);
        assert_eq!(seen.page(11), Some(board_check::INTERNAL_OSCILLATOR));
        assert_eq!(reported_fault(&seen), Some([kind, 0, 0]));
        assert_eq!((machine.panics, machine.watchdog_resets), resets);
        assert_eq!(seen.page(9), Some(resets.0 + resets.1));
        assert!(valid(&seen.axes) > 1800, "too few poses");
        let faulted = flag::WATCHDOG_RESET * u8::from(resets != (0, 0));
        let reported = seen.first_state(flag::INTERNAL_OSCILLATOR | faulted);
        // At power-on the start-up counts, too.
        let first_ns = machine.chip.first_tick_ns.expect("a tick");
        let first = u64::from(from_ns == 0) * first_ns / 2_000_000;
        // An absent crystal is awaited for 50 ms.
        let most = if resets == (0, 1) { 15 } else { 31 };
        assert!(first <= most, "{fault}: {first} periods");
        let reported = reported.map(|tick| first + tick);
        row(bench, fault, at, reported, &seen.axes);
    }
}

/// On the internal oscillator a bus-off is for good: an inexact clock disturbs the bus only once.
pub fn silent_after_bus_off(bench: &Bench) {
    let mut machine = bench.machine([&bench.blob, &[]]);
    machine.chip.clocks.crystal = false;
    machine.run_ticks(100);
    for bus in [BusState::Off, BusState::Good] {
        machine.set_bus(bus);
        machine.run_ticks(10);
    }
    Seen::since_last(&mut machine);
    assert_eq!(Seen::after(&mut machine, 500).axes.len(), 0);
    Stage::read(&machine).has_the_pose(bench, 0);
}

/// A PLL that never locks: the chip starts over and over and sends nothing.
pub fn pll_dead(bench: &Bench) {
    let mut machine = bench.machine([&bench.blob, &[]]);
    machine.chip.clocks.pll = Pll::Dead;
    machine.run_ticks(200);
    assert!(machine.watchdog_resets > 10, "no resets");
    assert_eq!(Seen::since_last(&mut machine).axes.len(), 0);
    println!("FAULT   PLL dead | no frame at all | 0");
}

/// A CAN controller that does not start, or a receive line that is held low: no frame, but the poses are
/// there and the light shows the fault, also without parameters.
pub fn can_dead(bench: &Bench) {
    type Fault = fn(&mut Machine);
    let dead: Fault = |m| m.chip.can.is_dead = true;
    let low: Fault = |m| m.chip.can.held_low = true;
    let faults = [
        ("CAN does not start", dead, &bench.blob[..]),
        ("CAN receive line low", low, &bench.blob),
        ("CAN receive line low, no parameters", low, &[]),
    ];
    for (name, fault, blob) in faults {
        let mut machine = bench.machine([blob, &[]]);
        fault(&mut machine);
        machine.run_ticks(500);
        assert_eq!(flashes(&mut machine), 5);
        if !blob.is_empty() {
            Stage::read(&machine).has_the_pose(bench, 998);
        }
        no_resets(&machine);
        assert_eq!(Seen::since_last(&mut machine).axes.len(), 0);
        println!("FAULT   {name} | shown by the light after 0.5 s | 0");
    }
}

/// Pull-ups and option bytes of the board are reported.
pub fn the_board(bench: &Bench) {
    // As delivered, the option bytes have no brown-out level.
    const LEVEL_3: u32 = 0x0fff_aae1;
    let cases = [
        ([false, true], LEVEL_3, board_check::NO_PULL_UP_ON_SELECT),
        ([true, false], LEVEL_3, board_check::NO_PULL_UP_ON_CONTROL),
        ([true, true], 0x0fff_aaed, board_check::BROWN_OUT_LOW),
    ];
    for (pulled_up, option_bytes, check) in cases {
        let mut machine = bench.machine([&bench.blob, &[]]);
        machine.chip.pulled_up = pulled_up;
        machine.chip.option_bytes = option_bytes;
        let seen = Seen::after(&mut machine, 200);
        assert_eq!(seen.page(11), Some(check));
        assert_eq!(seen.page(10), Some(option_bytes));
        assert!(valid(&seen.axes) > 700, "too few poses");
    }
}

/// A program that crashes reports the kind and the place after the reset.
pub fn crashes(bench: &Bench) {
    let image = &bench.image;
    let stack = crate::image::RAM;
    let tick = image.range(TICK).expect(TICK);
    let panic = image.range("9panicking9panic_fmt").expect("a panic");
    // The message is ignored. The place of the panic is any words of flash here, in R1 or R2 as the linker likes.
    let place = image.address("_stext");
    let mut into_panic = vec![(register::PC, panic.start | 1)];
    into_panic.extend((0..3).map(|k| (register::R0 + k, place)));
    let line = Some(image.word(place + 8));
    let below = stack - 0x1000..stack;
    let (nowhere, overflow) = ((register::R0, NOWHERE), (register::SP, stack + 8));
    let stacking = Some(ACCESS_AND_STACKING);
    for (fault, inject, kind, addresses, wanted) in [
        ("hard fault", vec![nowhere], 2, tick, None),
        ("stack overflow", vec![overflow], 3, below, stacking),
        ("panic", into_panic, 1, place..place + 1, line),
    ] {
        let mut machine = bench.machine([&bench.blob, &[]]);
        machine.hook_injection(image.address(TICK));
        Seen::after(&mut machine, 100);
        let at = tick_now(&machine);
        machine.chip.inject = inject;
        let seen = Seen::after(&mut machine, 500);
        let [found, address, detail] = reported_fault(&seen).expect("no fault is reported");
        assert_eq!(found, kind);
        assert!(addresses.contains(&address), "{address:#010x}");
        assert_eq!(detail, wanted.unwrap_or(detail));
        assert_eq!(seen.page(9), Some(1));
        assert_eq!((machine.panics, machine.watchdog_resets), (1, 0));
        assert!(!machine.lazy_left, "late stacking still due");
        assert!(valid(&seen.axes) > 1800, "too few poses");
        let reported = seen.first_state(flag::WATCHDOG_RESET);
        row(bench, fault, at, reported, &seen.axes)
    }
}
