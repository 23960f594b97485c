//! Frames that the recorder lost or received late: each row still holds the data of its own tick.

use super::records_for_tests::{Import, files, hall, record, reference};
use super::*;
use hal_adapters::can::Coded;
use std::f64::consts::TAU;

/// When the node sampled a tick, us on the clock of the reference.
fn sampled_us(n: u32) -> f64 {
    2_000.0 * f64::from(n) + 300.0
}

/// A record with the tick's number as capacitive codes. `received_us` is the receive time of a frame, us on the
/// clock of the reference, or `None` for a lost frame.
fn candump(received_us: impl Fn(u32, &Coded) -> Option<f64>) -> String {
    let codes = |n| (hall(sampled_us(n)), [n as i32 + 1; 3], n + 5, 2_000 * n);
    record(750, codes, |n, _, coded| received_us(n, coded))
}

/// Receive times with a jitter of up to 1.2 ms.
fn jittered_us(n: u32) -> f64 {
    sampled_us(n) + 150.0 + f64::from(n * 7919 % 1_201)
}

/// How many rows a log has, each checked against its own tick.
fn check(import: &Import, what: &str) -> usize {
    import.run();
    let log = std::fs::read_to_string(&import.settings.out).expect("written");
    for line in log.lines().skip(1) {
        let cells: Vec<f64> = line
            .split(',')
            .map(|cell| cell.parse().expect("a number"))
            .collect();
        let t_us = sampled_us(cells[5] as u32 - 1);
        assert!((cells[1] - t_us).abs() < 400.0, "{what}: {line}, at {t_us}");
        // The first movement moves X alone, at up to 3.8 um a ms.
        if t_us < 499_000.0 {
            let x_nm = 300e3 * (TAU * t_us / 500_000.0).sin();
            assert!((cells[2] - x_nm).abs() < 1_600.0, "{what}: {line}");
        }
    }
    log.lines().count() - 1
}

#[test]
fn frames_that_come_late_all_at_once_with_or_without_a_loss_shift_no_row() {
    for late in [16u32, 33, 50] {
        for lost in [0, 15, 16, 17, 32] {
            // The recorder sleeps for `late` ticks; then it gets what its buffer kept: the first.
            let start = 200 + lost % 12;
            let end = start + late;
            let bus = candump(|n, _| {
                let is_lost = (end.saturating_sub(lost)..end).contains(&n);
                let is_late = (start..end).contains(&n);
                (!is_lost).then(|| jittered_us(if is_late { end } else { n }))
            });
            let what = format!("{late} late, {lost} lost, from {start} on");
            assert!(check(&files(&bus, &reference()), &what) > 650, "{what}");
        }
    }
}

#[test]
fn a_record_without_time_frames_and_one_of_a_tenth_of_a_second_are_refused() {
    let is_time = |coded: &Coded| coded.message == hal_adapters::can::Message::SensorTime;
    for bus in [
        candump(|n, coded| (!is_time(coded)).then(|| jittered_us(n))),
        candump(|n, _| (n < 60).then(|| jittered_us(n))),
    ] {
        let import = files(&bus, &reference());
        import.refused(|error| matches!(error, JoinError::NoTicks { .. }));
    }
}

/// The sensor node's clock says when its codes were sampled, not the recorder's.
#[test]
fn a_recorder_whose_clock_is_set_shifts_no_row() {
    for step_us in [50_000.0, 3e6, -1_500_000.0] {
        for start in [200, 500] {
            let bus = candump(|n, _| Some(jittered_us(n) + if n < start { 0.0 } else { step_us }));
            let what = format!("{step_us} us from {start} on");
            let import = files(&bus, &reference());
            assert!(check(&import, &what) > 700, "{what}");
        }
    }
}
