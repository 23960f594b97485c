//! What the program takes: flash, RAM, instructions.

use super::{Outcome, equal, expect};
use crate::adc_model::Part;
use crate::bench::{Bench, Seen};
use crate::machine::Cost;

/// Flash that the program may take, bytes.
const TEXT_BYTES_MAX: usize = 48 << 10;
/// RAM that statics and stack may take, bytes.
const RAM_BYTES_MAX: usize = 8 << 10;
/// Cycles of a tick at 168 MHz.
const TICK_CYCLES: u64 = 336_000;
/// Cycles assumed for an instruction: flash at five wait states, loads, branches.
const CYCLES_PER_INSTRUCTION: f64 = 2.0;

/// Flash, RAM, and the stack's painted maximum, with faults of all kinds behind it.
pub fn flash_and_ram(bench: &Bench, part: Part, name: &str) -> Outcome {
    let image = bench.image(part);
    let mut machine = bench.machine(part, [&bench.other, &bench.blob])?;
    machine.run_ticks(200)?;
    machine.chip.adc.fault = crate::adc_model::AdcFault::Line(0);
    machine.run_ticks(200)?;
    let stack = machine.stack_bytes();
    let ram = image.static_bytes + stack;
    println!("RESULT firmware_{name}_text_bytes={}", image.text_bytes);
    println!("RESULT firmware_{name}_static_bytes={}", image.static_bytes);
    println!("RESULT firmware_{name}_stack_max_bytes={stack}");
    println!("RESULT firmware_{name}_ram_bytes={ram}");
    expect(image.text_bytes <= TEXT_BYTES_MAX, || {
        format!("{} bytes of flash", image.text_bytes)
    })?;
    expect(ram <= RAM_BYTES_MAX, || format!("{ram} bytes of RAM"))?;
    // No instruction of the program ends up where parameters lie, and it never writes flash.
    let same = machine
        .flash()
        .iter()
        .zip(&image.flash)
        .filter(|(a, b)| a != b)
        .count();
    expect(same <= 2 * bench.blob.len(), || {
        format!("{same} bytes of flash changed")
    })
}

/// Instructions from the interrupt to the third mailbox, over all ticks of a run.
pub fn interrupt_to_mailbox(bench: &Bench, part: Part, name: &str) -> Outcome {
    let mut machine = bench.machine(part, [&bench.blob, &[]])?;
    machine.count_instructions()?;
    machine.run_ticks(200)?;
    let seen = Seen::since_last(&mut machine);
    expect(seen.axes.len() > 600, || "too few poses".to_owned())?;
    // With a converter that settles, a tick is two interrupts: its trigger, and its codes.
    let per_tick = if part == Part::Ads131m08 { 2 } else { 1 };
    let of_tick = machine.costs.chunks_exact(per_tick).map(|interrupts| {
        let mut sum = Cost::default();
        for cost in interrupts {
            sum.instructions += cost.instructions;
            sum.spi_bytes += cost.spi_bytes;
            sum.mailboxes += cost.mailboxes;
        }
        sum
    });
    // The first ticks join the bus.
    let steady: Vec<_> = of_tick.skip(4).collect();
    expect(steady.len() > 190, || "too few ticks".to_owned())?;
    let counts = steady.iter().map(|tick| tick.instructions);
    let (most, fewest) = (
        counts.clone().max().unwrap_or(u64::MAX),
        counts.min().unwrap_or(0),
    );
    let all_three = steady.iter().filter(|tick| tick.mailboxes == 3).count();
    equal(
        "ticks that fill three mailboxes at once",
        all_three,
        steady.len(),
    )?;
    let spi_bytes = steady.iter().map(|tick| tick.spi_bytes).max().unwrap_or(0);
    equal(
        "bytes over the SPI",
        spi_bytes,
        if per_tick == 2 { 30 } else { 35 },
    )?;
    let us = most as f64 * CYCLES_PER_INSTRUCTION / 168.0;
    println!("RESULT firmware_{name}_instructions_to_mailbox_max={most}");
    println!("RESULT firmware_{name}_instructions_to_mailbox_min={fewest}");
    println!("RESULT firmware_{name}_us_to_mailbox_estimate={us:.1}");
    println!("RESULT firmware_{name}_spi_bytes_per_tick={spi_bytes}");
    let limit = (TICK_CYCLES as f64 * 0.05 / CYCLES_PER_INSTRUCTION) as u64;
    expect(most <= limit, || format!("{most} instructions of {limit}"))
}
