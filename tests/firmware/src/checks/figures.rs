//! Flash, RAM and instructions of the program.

use crate::bench::{Bench, Seen};
use crate::flash_model::{BYTES, FIRST};
use crate::image::FLASH;
use crate::machine::Cost;

/// Flash that the program may take, bytes.
const TEXT_BYTES_MAX: usize = 96 << 10;
/// RAM that statics and stack may take, bytes.
pub const RAM_BYTES_MAX: usize = 18 << 10;
/// An interrupt may block for a tenth of a period, us.
const BLOCKED_US_MAX: f64 = 200.0;
/// A start of the converter may block longer, and ends within the tick, us.
const START_US_MAX: f64 = 700.0;
/// The fastest clock with data at the core in time, Hz.
const SPI_HZ_MAX: u64 = 10_500_000;
/// Three frames of a tick.
const SPI_BYTES: u64 = 3 * 30;
/// Cycles assumed for an instruction: flash at five wait states, loads, branches.
pub const CYCLES_PER_INSTRUCTION: f64 = 2.0;

/// Flash, RAM, and the stack's painted maximum, with faults of all kinds behind it.
pub fn flash_and_ram(bench: &Bench) {
    let image = &bench.image;
    let mut machine = bench.machine([&bench.other, &bench.blob]);
    machine.run_ticks(200);
    machine.chip.adc.fault = crate::adc_model::AdcFault::Line(0);
    machine.run_ticks(200);
    let stack = machine.stack_bytes();
    let ram = image.static_bytes + stack;
    println!("RESULT firmware_text_bytes={}", image.text_bytes);
    println!("RESULT firmware_static_bytes={}", image.static_bytes);
    println!("RESULT firmware_stack_max_bytes={stack}");
    println!("RESULT firmware_ram_bytes={ram}");
    assert!(image.text_bytes <= TEXT_BYTES_MAX);
    assert!(ram <= RAM_BYTES_MAX);
    // No instruction of the program ends up where parameters lie, and it writes nowhere else.
    let bytes = machine.flash().iter().zip(&image.flash);
    let changed = bytes.filter(|(a, b)| a != b).count();
    assert_eq!(changed, 0);
    let slots = &image.flash[(FIRST - FLASH) as usize..][..BYTES];
    let used = slots.iter().filter(|byte| **byte != 0xff).count();
    assert_eq!(used, 0);
}

/// Instructions and time from the interrupt to the third mailbox, over all ticks of a run, and the time of
/// the longest interrupt.
pub fn interrupt_to_mailbox(bench: &Bench) {
    let mut machine = bench.machine([&bench.blob, &[]]);
    machine.count_instructions();
    let seen = Seen::after(&mut machine, 200);
    assert!(seen.axes.len() > 600, "too few poses");
    // A tick is two interrupts: its trigger, and its codes. The first ticks join the bus.
    let steady = machine.costs.get(8..).unwrap_or_default().to_vec();
    assert!(steady.len() > 360, "too few ticks");
    let codes: Vec<_> = steady.iter().filter(|cost| cost.spi_bytes > 0).collect();
    assert_eq!(codes.len(), steady.len() / 2);
    let is_usual = |cost: &&Cost| cost.mailboxes == 3 && cost.spi_bytes == SPI_BYTES;
    assert!(codes.iter().all(is_usual));

    let spi_hz = machine.chip.spi_hz();
    assert!(spi_hz <= SPI_HZ_MAX, "SPI at {spi_hz} Hz");
    let spi_byte_us = 8e6 / spi_hz as f64;
    let spi_us = SPI_BYTES as f64 * spi_byte_us;
    let us = |instructions: u64| instructions as f64 * CYCLES_PER_INSTRUCTION / 168.0;
    let counts = || codes.iter().map(|cost| cost.instructions);
    let (least, most) = (
        counts().min().unwrap_or(0),
        counts().max().unwrap_or(u64::MAX),
    );
    let trigger = steady.iter().filter(|cost| cost.spi_bytes == 0);
    let trigger = trigger.map(|cost| cost.instructions).max().unwrap_or(0);
    let blocked = codes.iter().map(|cost| cost.all_instructions).max();
    // A start that follows a loss of power.
    let before = machine.costs.len();
    let now_ns = machine.chip.now_ns;
    machine.chip.adc.part.power_up(now_ns);
    machine.run_ticks(20);
    let longest = |cost: &Cost| us(cost.all_instructions) + cost.spi_bytes as f64 * spi_byte_us;
    let starts = machine.costs[before..].iter().map(longest);
    let start_us = starts.fold(0.0, f64::max);
    let (to_mailbox_us, blocked_us) = (us(most) + spi_us, us(blocked.unwrap_or(0)) + spi_us);
    for (key, value) in [
        ("instructions_to_mailbox_max", most.to_string()),
        ("instructions_to_mailbox_min", least.to_string()),
        ("instructions_of_trigger_max", trigger.to_string()),
        ("spi_hz", spi_hz.to_string()),
        ("spi_us_per_tick", format!("{spi_us:.1}")),
        ("us_to_mailbox_estimate", format!("{to_mailbox_us:.1}")),
        ("us_blocked_estimate", format!("{blocked_us:.1}")),
        ("us_blocked_by_start_estimate", format!("{start_us:.1}")),
    ] {
        println!("RESULT firmware_{key}={value}");
    }
    assert!(blocked_us <= BLOCKED_US_MAX && start_us <= START_US_MAX);
}
