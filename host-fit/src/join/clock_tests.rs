//! Clocks that differ, over two minutes.

use super::records_for_tests::{M_PER_CODE, files, hall, record, reference_of, run, signals_m};
use super::*;

const TICKS: u32 = 57_000;

/// Imports a record of a computer with a true clock: controller and interferometer run faster by these shares.
/// Also gives the largest distance between codes and reference in a row, m.
fn imported(controller: f64, interferometer: f64) -> Result<(f64, JoinReport), JoinError> {
    let true_us = |n: u32| 2_000.0 * f64::from(n) / (1.0 + controller) + 300.0;
    let bus = record(
        TICKS,
        |n| (hall(true_us(n)), [100, 101, 99], n + 70, 2_000 * n),
        |n, _, _| Some(true_us(n) + 150.0 + f64::from(n * 7919 % 101)),
    );
    let reference = reference_of(TICKS, interferometer, None);
    let import = files(&bus, &reference).with(|settings| settings.search_s = Some(0.1));
    let report = run(&import.settings)?;
    let distance = import.log().rows.into_iter().flat_map(|row| {
        let codes = row.frame.hall().map(|code| f64::from(code) * M_PER_CODE);
        let pairs = signals_m(row.reference).into_iter().zip(codes);
        pairs.map(|(signal, code)| (signal - code).abs())
    });
    Ok((distance.fold(0.0, f64::max), report))
}

#[test]
fn clocks_that_differ_by_50_parts_in_a_million_are_followed_over_two_minutes() {
    for (controller, interferometer) in [(50e-6, 0.0), (-50e-6, 50e-6)] {
        let (distance_m, report) = imported(controller, interferometer).expect("imported");
        assert_eq!(report.bus().ticks, TICKS as usize);
        assert!(report.join.rows > 56_800, "{:?}", report.join);
        let rate = report.offset.rate - controller + interferometer;
        assert!(rate.abs() < 0.2e-6, "{rate}");
        // Half a code is 31 nm. At 3.8 mm/s 10 us are 38 nm.
        assert!(distance_m < 75e-9, "{distance_m}");
    }
}

#[test]
fn clocks_too_far_apart_in_speed_are_refused() {
    let refused = imported(0.0, 1000e-6).expect_err("refused");
    let is_speed = matches!(refused, JoinError::UnsteadyClocks { .. });
    assert!(is_speed, "{refused}");
}
