//! The controller records its own calibration: the stage moves as a log says, the converter samples
//! it, record mode puts the codes on the bus; and the poses of a controller that has what was
//! made of them are judged against the log.

use crate::adc_model::Input;
use crate::bench::{Bench, Seen, rows};
use crate::checks::no_resets;
use crate::checks::update::{KEY, talk};
use crate::machine::Machine;
use embedded_can::{Frame, StandardId};
use hal_adapters::can::BusFrame;
use hal_adapters::can::command::Request;
use hal_adapters::candump::LogLine;
use host_fit::input::dataset::{Dataset, Row};
use host_fit::input::log::{self, ReadOptions};
use host_fit::input::stage::Stage;
use runtime::ParameterSet;
use std::fmt::Write as _;
use std::path::Path;

/// Ticks before record mode is asked for, and after its end.
const TICKS_APART: u64 = 20;
/// When the record begins by the clock of the computer that records, s since 1970.
const BUS_CLOCK_S: u64 = 1_700_000_000;
/// What the clock of the interferometers shows when the stage begins to move, us.
const REFERENCE_CLOCK_US: u64 = 5_432_100;
/// How much faster that clock runs than the controller's, parts in a million.
const REFERENCE_FASTER_PPM: u64 = 20;
/// The servo period, us.
const PERIOD_US: u64 = 2000;
/// From the first tick to the middle of its sample, us.
const MIDDLE_US: u64 = 150;
/// Errors of the poses over those of a fit to the log itself, at most.
const RATIO_MAX: f64 = 1.03;
/// Lag of the poses by their own time stamps, at most, us.
const LAG_US_MAX: f64 = 20.0;

/// A controller whose stage moves as the codes say. Row 0 is there in the middle of the first
/// sample, so that samples see rows with all of their noise, not means of two rows.
fn moving(bench: &Bench, slots: [&[u8]; 2], log: &str) -> (Machine, u64) {
    let codes = rows(log);
    let ticks = codes.len() as u64;
    let mut machine = bench.machine_playing(slots, Vec::new());
    machine.chip.adc.input = Input::moving(codes, PERIOD_US, MIDDLE_US);
    (machine, ticks)
}

/// Plays `log` to a controller without parameters in record mode; writes what was on the bus as
/// `candump -L` does, and the reference of the log as the interferometers' own file.
pub fn record(bench: &Bench, log: &str, bus: &str, reference: &str) {
    let text = std::fs::read_to_string(log).expect("the log");
    let (mut machine, ticks) = moving(bench, [&[], &[]], &text);
    // A request before the controller has joined the bus is lost.
    machine.run_ticks(TICKS_APART);
    // What was on the bus before the answer is not recorded. The record ends as candump does.
    let (key, request) = (Some(&KEY), Request::Record { on: true });
    let (asked, _) = talk(&mut machine, |talk| talk.exchange_tagged(key, request));
    asked.expect("an answer");
    machine.run_ticks(ticks - TICKS_APART);
    let mut lines = String::new();
    for (k, sent) in machine.chip.can.sent.iter().enumerate() {
        // The computer looks at its clock up to 0.15 ms after the end of a frame.
        let us = sent.done_ns / 1000 + k as u64 * 7919 % 150;
        let id = StandardId::new(sent.id).expect("of the table");
        let line = LogLine {
            time_us: BUS_CLOCK_S * 1_000_000 + us,
            interface: "can0",
            frame: BusFrame::new(id, &sent.bytes).expect("eight bytes"),
        };
        let _ = writeln!(lines, "{line}");
    }
    std::fs::write(bus, lines).expect("the record");
    std::fs::write(reference, reference_of(&text)).expect("the reference");
}

/// The columns of a log that are no codes, with a clock of their own.
fn reference_of(log: &str) -> String {
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

/// Runs a controller whose second slot holds `blob` while the stage moves as `log` says, and
/// compares the poses on its bus, at the times that it tells, with the reference of the log. Their
/// errors must be those that `direct` tells, the blob that was fitted to the log itself.
pub fn judge(bench: &Bench, (log, stage): (&str, &str), (blob, direct): (&str, &str)) {
    let stage = Stage::from_file(Path::new(stage)).expect("the stage");
    let dataset = log::read(&[Path::new(log)], &stage, &ReadOptions::default());
    let dataset = dataset.expect("the log").dataset;
    let blob = std::fs::read(blob).expect("the blob");
    let direct = std::fs::read(direct).expect("that of the log itself");
    let of_fit = ParameterSet::from_bytes(&direct).expect("sound").fit.rms;
    let text = std::fs::read_to_string(log).expect("the log");
    let (mut machine, ticks) = moving(bench, [&[], &blob], &text);
    machine.run_ticks(ticks - 1);
    no_resets(&machine);

    let errors = errors(&mut machine, &dataset);
    let enough = errors.len() as u64 + 2 * TICKS_APART > ticks;
    assert!(enough, "only {} poses", errors.len());
    let (sums, weights) = errors.iter().fold((0.0, 0.0), |(sum, weight), error| {
        let [ex, ey, _] = error.less_zero;
        let [vx, vy, _] = error.speed;
        (sum + ex * vx + ey * vy, weight + vx * vx + vy * vy)
    });
    let lag_us = -sums / weights * 1e6;
    println!("RESULT rehearsal_lag_us={lag_us:.1}");
    for (axis, unit) in ["x_um", "y_um", "rz_urad"].iter().enumerate() {
        let squares: f64 = errors.iter().map(|e| e.less_zero[axis].powi(2)).sum();
        let rms = (squares / errors.len() as f64).sqrt() * 1e6;
        let of_fit = f64::from(of_fit[axis]) * 1e6;
        println!("RESULT rehearsal_rms_{unit}={rms:.4}");
        println!("RESULT rehearsal_rms_of_fit_{unit}={of_fit:.4}");
        assert!(rms <= RATIO_MAX * of_fit);
    }
    assert!(lag_us.abs() <= LAG_US_MAX);
}

/// A pose on the bus beside the reference at its time: X, Y, Rz in m, m, rad, and per s.
struct PoseError {
    movement: usize,
    less_zero: [f64; 3],
    speed: [f64; 3],
}

/// What the poses on the bus are off, less the mean of each movement: zero deviations.
fn errors(machine: &mut Machine, dataset: &Dataset) -> Vec<PoseError> {
    let seen = Seen::since_last(machine);
    let start_us = machine
        .chip
        .motion_start_us()
        .expect("the stage did not move");
    let mut errors = Vec::new();
    for of_tick in seen.axes.chunk_by(|a, b| a.tick == b.tick) {
        let mut pose = [None; 3];
        for axis in of_tick.iter().filter(|a| a.axis < 3 && a.is_valid()) {
            pose[axis.axis] = Some(f64::from(f32::from_bits(axis.word)));
        }
        let [Some(x), Some(y), Some(rz)] = pose else {
            continue;
        };
        let tick = of_tick[0].tick;
        let before = |&&(sequence, _): &&(u32, u32)| u64::from(sequence) <= tick;
        let Some(&(sequence, time_us)) = seen.times.iter().take_while(before).last() else {
            continue;
        };
        // A tick is one servo period by the controller's clock.
        let since_us = f64::from(time_us.wrapping_sub(start_us) as i32)
            + ((tick - u64::from(sequence)) * PERIOD_US) as f64;
        let Some((movement, reference, speed)) = reference_at(dataset, since_us) else {
            continue;
        };
        let less_zero = [x - reference[0], y - reference[1], rz - reference[2]];
        errors.push(PoseError {
            movement,
            less_zero,
            speed,
        });
    }
    for of_movement in errors.chunk_by_mut(|a, b| a.movement == b.movement) {
        for axis in 0..3 {
            let sum: f64 = of_movement.iter().map(|e| e.less_zero[axis]).sum();
            let mean = sum / of_movement.len() as f64;
            of_movement
                .iter_mut()
                .for_each(|e| e.less_zero[axis] -= mean);
        }
    }
    errors
}

/// Movement, reference and its speed so many us after row 0; `None` outside of the movements.
fn reference_at(dataset: &Dataset, since_us: f64) -> Option<(usize, [f64; 3], [f64; 3])> {
    let place = since_us / PERIOD_US as f64;
    let index = place.floor();
    let pair = dataset.rows.get(index.max(0.0) as usize..)?.get(..2)?;
    let [a, b]: &[Row; 2] = pair.try_into().ok()?;
    if index < 0.0 || a.movement != b.movement {
        return None;
    }
    let step: [f64; 3] = std::array::from_fn(|k| b.reference[k] - a.reference[k]);
    let reference = std::array::from_fn(|k| a.reference[k] + (place - index) * step[k]);
    Some((
        a.movement,
        reference,
        step.map(|step| step / (PERIOD_US as f64 * 1e-6)),
    ))
}
