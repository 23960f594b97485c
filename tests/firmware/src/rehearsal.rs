//! The controller records its own calibration: the stage moves along a log, the converter samples the motion,
//! record mode puts the codes on the bus.

use crate::adc_model::Input;
use crate::bench::{Bench, rows};
use crate::checks::update::{KEY, talk};
use hal_adapters::can::command::Request;
use hal_adapters::candump::LogLine;
use std::fmt::Write as _;

/// Ticks before record mode is asked for, and after its end.
const TICKS_APART: u64 = 20;
/// Start of the record by the clock of the recording computer, s since 1970.
const BUS_CLOCK_S: u64 = 1_700_000_000;
/// The clock of the interferometers when the stage begins to move, us.
const REFERENCE_CLOCK_US: u64 = 5_432_100;
/// That clock is faster than the controller's by this, parts in a million.
const REFERENCE_FASTER_PPM: u64 = 20;
/// The servo period, us.
const PERIOD_US: u64 = 2000;
/// From the first tick to the middle of its sample, us.
const MIDDLE_US: u64 = 150;

/// Plays `log` to a controller without parameters in record mode. Writes the frames like `candump -L`, and the
/// reference of the log as the interferometers' own file. Row 0 is reached in the middle of the first sample: a
/// sample then has the noise of its row, not the mean of two rows.
pub fn record(bench: &Bench, log: &str, bus: &str, reference: &str) {
    let text = std::fs::read_to_string(log).expect("the log");
    let codes = rows(&text);
    let ticks = codes.len() as u64;
    let mut machine = bench.machine_playing([&[], &[]], Vec::new());
    machine.chip.adc.input = Input::moving(codes, PERIOD_US, MIDDLE_US);
    // A request before the controller has joined the bus is lost.
    machine.run_ticks(TICKS_APART);
    // Frames before the answer are not recorded.
    let (key, request) = (Some(&KEY), Request::Record { on: true });
    let (asked, _) = talk(&mut machine, |talk| talk.exchange_tagged(key, request));
    asked.expect("an answer");
    machine.run_ticks(ticks - TICKS_APART);
    let mut lines = String::new();
    for (k, sent) in machine.chip.can.sent.iter().enumerate() {
        // The computer looks at its clock up to 0.15 ms after the end of a frame.
        let us = sent.done_ns / 1000 + k as u64 * 7919 % 150;
        let line = LogLine {
            time_us: BUS_CLOCK_S * 1_000_000 + us,
            interface: "can0",
            frame: sent.frame,
        };
        let _ = writeln!(lines, "{line}");
    }
    std::fs::write(bus, lines).expect("the record");
    std::fs::write(reference, reference_columns(&text)).expect("the reference");
}

/// All columns of a log but the codes, with their own clock.
fn reference_columns(log: &str) -> String {
    let mut lines = log.lines();
    let header: Vec<_> = lines.next().unwrap_or_default().split(',').collect();
    let time = header.iter().position(|name| *name == "t_us");
    let time = time.expect("no column t_us");
    let is_kept = |k: &usize| !header[*k].ends_with("_cnt");
    let kept: Vec<_> = (0..header.len()).filter(is_kept).collect();
    let mut out = String::new();
    let mut write = |cells: Vec<&str>| out += &(cells.join(",") + "\n");
    write(kept.iter().map(|&k| header[k]).collect());
    for (row, line) in (0..).zip(lines) {
        let since_us = row * PERIOD_US;
        let gained_us = since_us * REFERENCE_FASTER_PPM / 1_000_000;
        let clock = (REFERENCE_CLOCK_US + since_us + gained_us).to_string();
        let mut cells: Vec<_> = line.split(',').collect();
        cells[time] = &clock;
        write(kept.iter().map(|&k| cells[k]).collect());
    }
    out
}
