//! A record as the stage controller sends it with its own converter: poses, temperatures, codes of 24
//! bits and times on one bus, over two minutes, by clocks that differ.

use super::tests::files;
use super::*;
use hal_adapters::can::Layout;
use hal_adapters::can::sensor::{self, TemperatureSender};
use hal_adapters::can::{BusFrame, Coded, PoseSender};
use hal_adapters::candump::LogLine;
use hallstage_input::dataset::Row;
use runtime::{RawFrame, Reading};
use std::f64::consts::TAU;
use std::fmt::Write;

const TICKS: u32 = 57_000;
const MOVEMENT_S: f64 = 2.0;
/// Codes of the 24-bit converter: 256 for one of 16 bits.
const M_PER_CODE: f64 = 6.25e-8 / 256.0;

/// X, Y, Rz at a time, m, m, rad: one axis a movement, in turn, at 1.5 Hz.
fn pose(t_s: f64) -> [f64; 3] {
    let axis = (t_s / MOVEMENT_S).floor() as usize % 3;
    let mut q = [0.0; 3];
    q[axis] = 300e-6 * (TAU * 1.5 * t_s).sin();
    q
}

fn hall(t_s: f64) -> [i32; 3] {
    let [x, y, rz] = pose(t_s);
    let s = [y + 0.1975 * rz, y - 0.1975 * rz, x - 0.36 * rz];
    s.map(|s| (s / M_PER_CODE).round() as i32)
}

/// Temperatures of mount and body in tick `n`, m degC: both are read every 100 ms, one after the other.
fn temperature_mc(n: u32) -> [i32; 2] {
    [20_000 + (n / 50) as i32, 21_000 - n.div_ceil(50) as i32]
}

/// The record by a computer with a true clock: the controller's clock runs faster by `fast`, and the frames
/// arrive in order.
fn candump(fast: f64) -> String {
    let mut text = String::new();
    let (mut poses, mut temperatures) = (PoseSender::default(), TemperatureSender::START);
    for n in 0..TICKS {
        let t_s = 0.002 * f64::from(n) / (1.0 + fast) + 0.0003;
        let codes = RawFrame::new(hall(t_s), [100, 101, 99], n + 70, 2_000 * n)
            .with_temperature_mc(temperature_mc(n));
        let pose: Vec<Coded> = poses.frames(&Reading::default(), Some(&codes)).collect();
        let frames = pose
            .into_iter()
            .chain(temperatures.frame(&codes))
            .chain(sensor::frames(Layout::Bits24, &codes));
        let late_us = f64::from(n * 7919 % 101);
        for (k, coded) in (1u32..).zip(frames) {
            let line = LogLine {
                time_us: (1e6 * t_s + 150.0 + late_us + 125.0 * f64::from(k)) as u64,
                interface: "can0",
                frame: BusFrame::from(coded),
            };
            writeln!(text, "{line}").expect("a string");
        }
    }
    text
}

/// The interferometers' log at 1 kHz by a clock that runs faster by `fast`.
fn reference(fast: f64) -> String {
    let mut text = "movement,t_us,x_m,y_m,rz_rad\n".to_owned();
    for k in 0..2 * TICKS {
        let t_us = 1_000.0 * f64::from(k);
        let t_s = 1e-6 * t_us / (1.0 + fast);
        let [x, y, rz] = pose(t_s);
        let movement = (t_s / MOVEMENT_S) as i64;
        writeln!(text, "{movement},{t_us},{x:.12},{y:.12},{rz:.12}").expect("a string");
    }
    text
}

/// Largest distance between the codes and the reference in their row, m; and the report. Each row has the
/// temperatures of its tick.
fn imported(controller: f64, interferometer: f64) -> (f64, ImportReport) {
    let (distance_m, rows, report) = try_import(controller, interferometer).expect("imported");
    let differ = rows.iter().filter(|row| {
        let t_s = 1e-6 * row.t_us as f64 / (1.0 + interferometer);
        let n = ((t_s - 0.0003) * (1.0 + controller) / 0.002).round() as u32;
        row.frame.temperature_mc() != temperature_mc(n)
    });
    assert_eq!(differ.count(), 0);
    assert!(!report.temperatures_left_out);
    (distance_m, report)
}

fn try_import(
    controller: f64,
    interferometer: f64,
) -> Result<(f64, Vec<Row>, ImportReport), ImportError> {
    let stage = hallstage_input::shipped::STAGE_TOML
        .replace("m_per_count = 6.25e-8 ", "m_per_count = 2.44140625e-10 ")
        .replace("m_per_count = 1.5625e-8 ", "m_per_count = 6.103515625e-11 ")
        .replace("-32768", "-8388608")
        .replace("32767", "8388607")
        + "\n[temperature]\nmount = \"mount_c\"\nbody = \"body_c\"\nunit = \"C\"\n";
    let import = files(&candump(controller), &reference(interferometer));
    std::fs::write(&import.settings.stage, stage).expect("written");
    let import = import.with(|settings| settings.search_s = 0.1);
    let report = run(&import.settings, Watch::NONE)?;
    let rows = import.log().rows;
    let distance = rows.iter().flat_map(|row| {
        let [x, y, rz] = row.reference;
        let s = [y + 0.1975 * rz, y - 0.1975 * rz, x - 0.36 * rz];
        let signals = row.frame.hall().map(|code| f64::from(code) * M_PER_CODE);
        s.into_iter().zip(signals).map(|(s, code)| (s - code).abs())
    });
    Ok((distance.fold(0.0, f64::max), rows, report))
}

#[test]
fn clocks_that_differ_by_50_parts_in_a_million_are_followed_over_two_minutes() {
    for (controller, interferometer) in [(50e-6, 0.0), (-50e-6, 50e-6), (0.0, -50e-6)] {
        let (distance_m, report) = imported(controller, interferometer);
        assert_eq!(report.bus.ticks, TICKS as usize);
        assert!(report.join.rows > 56_900, "{:?}", report.join);
        let rate = report.offset.rate - controller + interferometer;
        assert!(rate.abs() < 0.2e-6, "{rate}");
        // At 2.8 mm/s: 10 us are 28 nm.
        assert!(distance_m < 40e-9, "{distance_m}");
    }
}

#[test]
fn clocks_too_far_apart_in_speed_are_refused() {
    let refused = try_import(0.0, 1000e-6).expect_err("refused");
    assert!(
        matches!(refused, ImportError::UnsteadyClocks { .. }),
        "{refused}"
    );
}
