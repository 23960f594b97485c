//! Starts that go wrong, clocks that stop, programs that crash: what the controller reports, and that no pose
//! is wrong meanwhile. Each check prints a row: the fault, the ticks until it was reported, and the
//! words of poses that were sent as valid and were wrong.

use super::log::Stage;
use super::{no_resets, wrong_valid};
use crate::bench::{Axis, Bench, Seen};
use crate::can_model::BusState;
use crate::clock_model::Pll;
use crate::machine::{ACCESS_AND_STACKING, Machine};
use crate::unicorn::register;
use hal_adapters::can::status::{board_check, flag};

/// Where there is no memory and no peripheral.
pub const NOWHERE: u32 = 0x6000_0000;
/// The function of the tick's arithmetic, where faults are put in.
pub const TICK: &str = "firmware4node3run";

/// Prints the row of a fault. `reported` is the tick of the first frame that reports it.
pub fn row(bench: &Bench, fault: &str, at: u64, reported: Option<u64>, axes: &[Axis]) {
    let reported = reported.expect("it was never reported");
    let wrong = wrong_valid(axes, &bench.poses, 1);
    println!(
        "FAULT   {fault} | {} | {wrong}",
        reported.saturating_sub(at)
    );
    assert_eq!(wrong, 0);
}

/// The tick that runs.
pub fn tick_now(machine: &Machine) -> u64 {
    let first_ns = machine.chip.first_tick_ns.unwrap_or(machine.chip.now_ns);
    (machine.chip.now_ns - first_ns) / 2_000_000
}

/// Kind and step, address and detail of the last fault of the health frames.
fn reported_fault(seen: &Seen) -> Option<[u32; 3]> {
    Some([seen.page(6)?, seen.page(7)?, seen.page(8)?])
}

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

/// A supply that rises slowly: nothing runs faster than after a reset and nothing is written before it
/// is sound, and the watchdog does not bite meanwhile.
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

/// Without a crystal the internal oscillator serves, shown by flag, check and light: none from the
/// start; one that stops while the program runs, which starts anew; one that the PLL does not lock to,
/// where the watchdog resets once.
pub fn no_crystal(bench: &Bench) {
    type Case = (&'static str, u64, fn(&mut Machine), u32, (u32, u32));
    let cases: [Case; 3] = [
        (
            "crystal absent",
            0,
            |m| m.chip.clocks.crystal = false,
            0,
            (0, 0),
        ),
        (
            "crystal lost while running",
            200_700_000,
            |m| m.chip.stop_crystal(),
            4,
            (1, 0),
        ),
        (
            "PLL does not lock to the crystal",
            0,
            |m| m.chip.clocks.pll = Pll::NotToCrystal,
            0x0105,
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
        let first = if from_ns == 0 {
            first_ns / 2_000_000
        } else {
            0
        };
        assert!(first <= 10 + 5 * u64::from(resets.1), "{first} periods");
        let reported = reported.map(|tick| first + tick);
        row(bench, fault, at, reported, &seen.axes);
    }
}

/// On the internal oscillator a bus-off is for good: a clock that is too inexact disturbs the bus
/// once, and then no more.
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

/// The PLL locks to nothing: the chip is broken, starts over and over, and sends nothing.
pub fn pll_dead(bench: &Bench) {
    let mut machine = bench.machine([&bench.blob, &[]]);
    machine.chip.clocks.pll = Pll::Dead;
    machine.run_ticks(200);
    assert!(machine.watchdog_resets > 10, "no resets");
    assert_eq!(Seen::since_last(&mut machine).axes.len(), 0);
    println!("FAULT   PLL dead | no frame at all | 0");
}

/// A CAN controller that does not start: no frame, but the poses are there and the light tells.
pub fn can_dead(bench: &Bench) {
    let mut machine = bench.machine([&bench.blob, &[]]);
    machine.chip.can.acknowledges = false;
    assert_eq!(flashes(&mut machine), 5);
    Stage::read(&machine).has_the_pose(bench, 498);
    no_resets(&machine);
    assert_eq!(Seen::since_last(&mut machine).axes.len(), 0);
    println!("FAULT   CAN does not start | shown by the light from tick 1 on | 0");
}

/// A receive line that is held low keeps the controller from the bus: the light tells, also
/// without parameters.
pub fn receive_line_low(bench: &Bench) {
    for (slot, flash) in [(&bench.blob[..], 1), (&[], 2)] {
        let mut machine = bench.machine([slot, &[]]);
        assert_eq!(flashes(&mut machine), flash);
        let mut machine = bench.machine([slot, &[]]);
        machine.chip.can.held_low = true;
        machine.run_ticks(500);
        assert_eq!(flashes(&mut machine), 5);
        assert_eq!(Seen::since_last(&mut machine).axes.len(), 0);
    }
    println!("FAULT   CAN receive line low | shown by the light after 0.5 s | 0");
}

/// Pull-ups and option bytes of the board are reported.
pub fn the_board(bench: &Bench) {
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
        let mut machine = bench.machine([&bench.blob, &[]]);
        machine.chip.pulled_up = pulled_up;
        machine.chip.option_bytes = option_bytes;
        let seen = Seen::after(&mut machine, 200);
        assert_eq!(seen.page(11), Some(check));
        assert_eq!(seen.page(10), Some(option_bytes));
        assert!(valid(&seen.axes) > 700, "too few poses");
    }
}

/// A program that crashes reports after the reset how and where.
pub fn crash(bench: &Bench, wanted: &Crash) {
    let mut machine = bench.machine([&bench.blob, &[]]);
    machine.hook_injection(bench.image.address(TICK));
    Seen::after(&mut machine, 100);
    let at = tick_now(&machine);
    machine.chip.inject.clone_from(&wanted.inject);
    let seen = Seen::after(&mut machine, 500);
    let [kind, address, detail] = reported_fault(&seen).expect("no fault is reported");
    assert_eq!(kind, wanted.kind);
    assert!(wanted.address.contains(&address), "{address:#010x}");
    assert_eq!(detail, wanted.detail.unwrap_or(detail));
    assert_eq!(seen.page(9), Some(1));
    assert_eq!((machine.panics, machine.watchdog_resets), (1, 0));
    assert!(!machine.lazy_left, "late stacking still due");
    assert!(valid(&seen.axes) > 1800, "too few poses");
    let reported = seen.first_state(flag::WATCHDOG_RESET);
    row(bench, wanted.fault, at, reported, &seen.axes)
}

/// A crash, and what is reported of it.
pub struct Crash {
    /// Its name.
    pub fault: &'static str,
    inject: Vec<(i32, u32)>,
    kind: u32,
    address: std::ops::Range<u32>,
    detail: Option<u32>,
}

/// The crashes.
pub fn crashes(bench: &Bench) -> Vec<Crash> {
    let image = &bench.image;
    let stack = crate::image::RAM;
    let mut crashes = vec![
        Crash {
            fault: "hard fault: a pointer to nowhere",
            inject: vec![(register::R0, NOWHERE)],
            kind: 2,
            address: image.range(TICK).expect(TICK),
            detail: None,
        },
        Crash {
            fault: "hard fault: a jump to nowhere",
            inject: vec![(register::PC, NOWHERE | 1)],
            kind: 2,
            address: NOWHERE..NOWHERE + 2,
            detail: None,
        },
        Crash {
            fault: "stack overflow",
            inject: vec![(register::SP, stack + 8)],
            kind: 3,
            address: stack - 0x1000..stack,
            detail: Some(ACCESS_AND_STACKING),
        },
    ];
    // A program from which the linker removed every panic has no such function.
    if let Some(panic) = image.range("9panicking9panic_fmt") {
        // The message is not looked at. The place that it came from is any words of flash here.
        let place = image.address("_stext");
        crashes.push(Crash {
            fault: "panic",
            inject: vec![
                (register::R0, place),
                (register::R0 + 1, place),
                (register::PC, panic.start | 1),
            ],
            kind: 1,
            address: place..place + 1,
            detail: Some(image.word(place + 8)),
        });
    }
    crashes
}
