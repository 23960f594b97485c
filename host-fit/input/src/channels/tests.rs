//! Each property is put into the shipped run. Its channels have none.

use super::*;
use crate::dataset::Row;
use crate::log::{self, ReadOptions};
use crate::shipped::{RUN_GZ, stage};
use std::f64::consts::TAU;

fn sound() -> Dataset {
    let reading = log::read_bytes(RUN_GZ, "run.csv.gz".as_ref(), &stage(), &ReadOptions::FIT);
    reading.expect("a log").dataset
}

fn column(dataset: &Dataset, channel: Channel) -> Column {
    let mut columns = columns(dataset, &stage()).into_iter();
    columns
        .find(|column| column.channel == channel)
        .expect("a channel")
}

/// The run with other values of beam X, nm, made from the old ones.
fn with_beam_x(change: impl Fn(&[f64]) -> Vec<f64>) -> Column {
    let mut dataset = sound();
    let nm = |row: &Row| row.reference[0] * 1e9;
    let values = change(&dataset.rows.iter().map(nm).collect::<Vec<f64>>());
    for (row, nm) in dataset.rows.iter_mut().zip(values) {
        row.reference[0] = nm.round() * 1e-9;
    }
    column(&dataset, Channel::BeamX)
}

/// The run with other codes of Hall A.
fn with_hall_a(change: impl Fn(usize, i32) -> i32) -> Column {
    let mut dataset = sound();
    for (k, row) in dataset.rows.iter_mut().enumerate() {
        row.frame.codes.hall[0] = change(k, row.frame.codes.hall[0]);
    }
    column(&dataset, Channel::HallA)
}

/// Even noise of variance one.
fn noise() -> impl FnMut() -> f64 {
    let mut state = 1u64;
    move || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        12f64.sqrt() * ((state >> 33) as f64 / 2f64.powi(31) - 0.5)
    }
}

#[test]
fn a_sound_log_has_the_noise_of_its_sensors_and_no_fault() {
    let stage = stage();
    let units_m = [stage.hall.m_per_count, 1e-9, stage.capacitive.m_per_count];
    for (k, column) in columns(&sound(), &stage).iter().enumerate() {
        let unit_m = units_m[k / 3];
        let noise = column.white_noise_m.expect("rows") / unit_m;
        let near = [7.5..8.5, 5.0..6.5, 0.7..1.3][k / 3].contains(&noise);
        assert!(near, "{:?}: {noise}", column.channel);
        assert!((column.step_m / unit_m - 1.0).abs() < 1e-9);
        assert!((column.to_siblings.expect("three") - 1.0).abs() < 0.1);
        let [low, high] = column.falls.expect("500 rows a second");
        assert!(low < 1.0 && high < 0.45, "{low} {high}");
        assert_eq!(
            (column.slow, &column.straight, column.overflows),
            (None, &None, None)
        );
        assert_eq!(column.stuck_bits, Vec::<u32>::new());
    }
}

#[test]
fn a_step_divides_all_differences() {
    let rounded = with_beam_x(|nm| nm.iter().map(|nm| (nm / 50.0).round() * 50.0).collect());
    assert!((rounded.step_m * 1e9 - 50.0).abs() < 1e-6 && rounded.is_rounded());
    assert_eq!(with_hall_a(|_, _| 7).step_m, 0.0);
}

#[test]
fn a_bit_that_never_changes_is_named_and_motion_of_its_size_is_none() {
    assert_eq!(with_hall_a(|_, code| code | 1 << 5).stuck_bits, [5]);
    assert_eq!(with_hall_a(|_, code| code & !(1 << 9)).stuck_bits, [9]);
    assert_eq!(
        with_hall_a(|k, _| (k % 16) as i32).stuck_bits,
        Vec::<u32>::new()
    );
}

#[test]
fn a_counter_that_overflows_has_its_bits_and_an_outlier_is_none() {
    let wrapped = with_hall_a(|_, code| (code + 2048).rem_euclid(4096) - 2048);
    assert_eq!(wrapped.overflows.map(|(bits, _)| bits), Some(12));
    let sparks = with_hall_a(|k, code| match k % 100 {
        7 => -20_000 * code.signum(),
        _ => code,
    });
    assert_eq!(sparks.overflows, None);
}

#[test]
fn a_slow_rate_is_named() {
    for every in [2, 5, 10] {
        let held = with_beam_x(|nm| (0..nm.len()).map(|k| nm[k - k % every]).collect());
        let slow = held.slow.expect("held");
        assert_eq!((slow.every, slow.is_held), (every, true));
        let lines = |nm: &[f64]| -> Vec<f64> {
            let line = |k: usize| {
                let (start, part) = (k - k % every, (k % every) as f64 / every as f64);
                let end = (start + every).min(nm.len() - 1);
                nm[start] + part * (nm[end] - nm[start])
            };
            (0..nm.len()).map(line).collect()
        };
        let slow = with_beam_x(lines).slow.expect("interpolated");
        assert_eq!((slow.every, slow.is_held), (every, false));
    }
}

#[test]
fn a_line_in_the_spectrum_is_no_slow_rate() {
    let hum = |k: usize| 40.0 * libm::sin(TAU * 120.0 * 0.002 * k as f64);
    assert_eq!(with_hall_a(|k, code| code + hum(k) as i32).slow, None);
    let beam = with_beam_x(|nm| {
        nm.iter()
            .enumerate()
            .map(|(k, nm)| nm + 12.0 * hum(k))
            .collect()
    });
    assert_eq!(beam.slow, None);
    let [low, high] = beam.falls.expect("rows");
    assert!(low < 3.0 && high < 1.0, "{low} {high}");
}

#[test]
fn a_filter_makes_noise_fall_faster_than_drift_does() {
    let low_pass = |nm: &[f64]| {
        let mut state = nm[0];
        let part = 1.0 - libm::exp(-TAU * 10.0 * 0.002);
        let next = |nm: &f64| {
            state += part * (nm - state);
            state
        };
        nm.iter().map(next).collect()
    };
    let mean = |nm: &[f64]| {
        let window = |k: usize| &nm[k.saturating_sub(25)..nm.len().min(k + 25)];
        (0..nm.len())
            .map(|k| window(k).iter().sum::<f64>() / window(k).len() as f64)
            .collect()
    };
    for filtered in [with_beam_x(low_pass), with_beam_x(mean)] {
        let [low, high] = filtered.falls.expect("rows");
        assert!(low > 3.0 && high > 1.0, "{low} {high}");
    }
}

#[test]
fn a_line_that_fills_a_gap_is_a_straight_run_and_a_level_one_is_not() {
    let filled = |level: f64| {
        with_beam_x(|nm| {
            let line = |k: usize| nm[5000] + (k - 5000) as f64 * level;
            let value = |(k, nm): (usize, &f64)| {
                if (5000..5100).contains(&k) {
                    line(k)
                } else {
                    *nm
                }
            };
            nm.iter().enumerate().map(value).collect()
        })
    };
    let straight = filled(300.0).straight.expect("a line");
    assert!(
        straight.start.abs_diff(5000) < 3 && straight.end.abs_diff(5100) < 3,
        "{straight:?}"
    );
    assert_eq!(filled(0.0).straight, None);
}

#[test]
fn noise_is_compared_with_siblings_and_over_time() {
    let noisy = |from: usize| {
        let mut random = noise();
        let added: Vec<i32> = (0..15_001).map(|_| (30.0 * random()) as i32).collect();
        with_hall_a(move |k, code| code + if k < from { 0 } else { added[k] })
    };
    let ratio = noisy(0).to_siblings.expect("three");
    assert!((3.0..5.5).contains(&ratio), "{ratio}");
    let late = noisy(14_000);
    assert!(late.to_siblings < Some(1.2), "{late:?}");
}

#[test]
fn missing_rows_thinned_rows_and_short_movements_are_no_fault() {
    let all = sound();
    let missing: Vec<usize> = (0..all.rows.len()).filter(|row| row % 17 == 5).collect();
    let mut short = sound();
    short.movements.clear();
    for start in (0..15_000).step_by(20) {
        short.movements.push(crate::dataset::Movement {
            log: 0,
            index: start as i64,
            rows: start..start + 20,
        });
    }
    for (k, row) in short.rows.iter_mut().enumerate() {
        row.movement = k / 20;
    }
    let mut thinned = all.without(&(0..15_000).filter(|row| row % 2 != 0).collect::<Vec<_>>());
    thinned.logs[0].rows = 0..7500;
    let mut gaps = all.without(&missing);
    gaps.logs[0].rows = 0..gaps.rows.len();
    for dataset in [gaps, short, thinned] {
        for column in columns(&dataset, &stage()) {
            assert_eq!(
                (column.slow, &column.straight, column.falls),
                (None, &None, None),
                "{column:?}"
            );
            assert!(
                (column.to_siblings.expect("noise") - 1.0).abs() < 0.15,
                "{column:?}"
            );
        }
    }
}

#[test]
fn fast_motion_of_the_stage_is_no_filter() {
    let mut dataset = sound();
    let mut state = [0.0f64; 2];
    for (k, row) in dataset.rows.iter_mut().enumerate() {
        // Steps of 200 um through two filters of 20 Hz.
        let to = if (k / 250) % 2 == 0 { 200e-6 } else { 0.0 };
        state[0] += 0.22 * (to - state[0]);
        state[1] += 0.22 * (state[0] - state[1]);
        row.reference[0] += state[1];
        row.frame.codes.hall = row
            .frame
            .codes
            .hall
            .map(|code| code + (state[1] * 16e6) as i32);
    }
    assert_eq!(column(&dataset, Channel::BeamX).falls, None);
}

#[test]
fn the_floor_has_no_coarse_steps_and_a_noisy_probe_counts_as_the_middle_one() {
    let floor = |change: &dyn Fn(i32, f64) -> i32| {
        let (mut dataset, mut random) = (sound(), noise());
        for row in &mut dataset.rows {
            row.frame.codes.hall[1] = change(row.frame.codes.hall[1], random());
        }
        let noise_m = probe_noise_m(&columns(&dataset, &stage())).expect("runs of six rows");
        noise_m.map(|m| m / stage().hall.m_per_count)
    };
    let own = floor(&|code, _| code);
    assert!(
        own.iter().all(|codes| (7.5..8.5).contains(codes)),
        "{own:?}"
    );
    let coarse = floor(&|code, _| code - code.rem_euclid(20));
    assert!((coarse[1] / own[1] - 1.0).abs() < 0.1, "{coarse:?}");
    let noisy = floor(&|code, random| code + (60.0 * random) as i32);
    assert!(own.contains(&noisy[1]), "{noisy:?}");
}

#[test]
fn noise_that_all_probes_share_is_no_part_of_the_floor() {
    let floor = |codes: f64| {
        let mut dataset = sound();
        let mut random = noise();
        for row in &mut dataset.rows {
            let own = (codes * random()).round() as i32;
            row.frame
                .codes
                .hall
                .iter_mut()
                .for_each(|code| *code += own);
        }
        let columns = columns(&dataset, &stage());
        let floor_m = probe_noise_m(&columns).expect("rows");
        let beyond_m2 = columns[0].beyond_m2;
        let unit_m = stage().hall.m_per_count;
        (
            floor_m.map(|m| m / unit_m),
            beyond_m2.map(|m2| m2 / unit_m / unit_m),
        )
    };
    let (own, none) = floor(0.0);
    assert_eq!(none, [0.0; 3]);
    let (floor, beyond) = floor(32.0);
    for k in 0..3 {
        assert!((floor[k] / own[k] - 1.0).abs() < 0.1, "{floor:?}");
        assert!((beyond[k] / 1024.0 - 1.0).abs() < 0.1, "{beyond:?}");
    }
}

#[test]
fn lines_and_outliers_are_named_with_their_size_and_their_variance() {
    let unit_m = stage().hall.m_per_count;
    let sine = |k: usize| (40.0 * libm::sin(TAU * 37.3 * 0.002 * k as f64)).round() as i32;
    let hum = with_hall_a(|k, code| code + sine(k));
    let line = hum.line.expect("a line");
    assert!((line.frequency_hz - 37.3).abs() < 0.3, "{line:?}");
    assert!(
        (line.amplitude_m / unit_m / 40.0 - 1.0).abs() < 0.1,
        "{line:?}"
    );
    let variance = hum.beyond_m2[0] / unit_m / unit_m;
    assert!((variance / 800.0 - 1.0).abs() < 0.15, "{variance}");
    let spikes = |size: i32| with_hall_a(move |k, code| code + if k % 101 == 7 { size } else { 0 });
    let large = spikes(400);
    assert_eq!(large.outliers.len(), 149);
    assert_eq!(large.outliers[3].0, 310);
    for (column, size) in [(large, 400.0), (spikes(-100), 100.0)] {
        let variance = column.beyond_m2[0] / unit_m / unit_m;
        assert!(
            (variance * 101.0 / (size * size) - 1.0).abs() < 0.25,
            "{variance}"
        );
    }
    let few = with_hall_a(|k, code| code + if k % 5000 == 7 { 4000 } else { 0 });
    let variance = few.beyond_m2[0] / unit_m / unit_m;
    assert!(
        (variance / (16e6 / 5000.0) - 1.0).abs() < 0.05,
        "{variance}"
    );
    let step = with_hall_a(|k, code| if k > 7000 { code + 4000 } else { code });
    assert_eq!((step.outliers, step.beyond_m2), (Vec::new(), [0.0; 3]));
}

#[test]
fn motion_that_beams_and_probes_show_is_no_line() {
    let mut dataset = sound();
    for (k, row) in dataset.rows.iter_mut().enumerate() {
        let error_m = 3e-6 * libm::sin(TAU * 60.0 * 0.002 * k as f64);
        row.reference[0] += error_m;
        let codes = (error_m / stage().hall.m_per_count).round() as i32;
        row.frame.codes.hall[0] += codes;
    }
    let columns = columns(&dataset, &stage());
    assert!(
        columns.iter().all(|column| column.line.is_none()),
        "{columns:#?}"
    );
    assert_eq!(columns[0].beyond_m2, [0.0; 3]);
}
