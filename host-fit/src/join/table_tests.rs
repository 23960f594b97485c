//! Two tables, each with its own clock.

use super::records_for_tests::{Import, files, hall, pose, reference, reference_of};
use super::*;
use hallstage_input::finding::Kind;
use std::fmt::Write;

/// Time of the sensors less time of the reference, us.
const SENSORS_US: f64 = 7_654_321.0;

/// The sensors from `first_us` on for 1.5 s, a row in `period_us`; `keeps` says by its number whether a row is there.
fn sensors(first_us: f64, period_us: f64, keeps: impl Fn(u32) -> bool) -> String {
    let mut text = "Time [us],Cap 1,Cap 2,Cap 3,Hall A,Hall B,Hall C\n".to_owned();
    for k in (0..(1.5e6 / period_us) as u32).filter(|k| keeps(*k)) {
        let t_us = first_us + period_us * f64::from(k);
        let [a, b, c] = hall(t_us);
        let own_us = t_us + SENSORS_US;
        writeln!(text, "{own_us},100,101,99,{a},{b},{c}").expect("a string");
    }
    text
}

/// Joined in a search over all of both files.
fn tables(sensors: &str, reference: &str) -> Import {
    files(sensors, reference).with(|settings| settings.search_s = None)
}

#[test]
fn tables_are_joined_in_any_order_whatever_their_rates_ends_and_gaps() {
    // Of 1 kHz; the sensors start 0.4 s later.
    for period_us in [500.0, 1_000.0, 2_500.0] {
        let table = sensors(400_000.0, period_us, |k| k % 1000 >= 8 && k != 77);
        let join = tables(&table, &reference());
        let report = join.run();
        let found_us = report.offset.us - SENSORS_US;
        assert!(
            found_us.abs() < 5.0 * report.offset.standard_error_us + 1.0,
            "{found_us}"
        );
        assert!(report.offset.rate.abs() < 5.0 * report.offset.rate_standard_error + 1e-7);
        assert!(
            report.join.rows as f64 > 0.9 * 1.1e6 / period_us,
            "{:?}",
            report.join
        );
        join.check_poses(1e-9);
    }
    let gaps: String = reference()
        .lines()
        .enumerate()
        .filter(|(k, _)| *k == 0 || k % 1000 >= 8)
        .map(|(_, line)| line.to_owned() + "\n")
        .collect();
    let join = tables(&sensors(0.0, 2_000.0, |_| true), &gaps);
    let report = join.run();
    assert!(report.join.rows > 720);
    join.check_poses(1e-9);
    let swapped = join.with(|settings| std::mem::swap(&mut settings.a, &mut settings.b));
    assert_eq!(swapped.run(), report);
    let rows = swapped.log().rows;
    let gz = swapped.with(|settings| assert!(settings.out.set_extension("csv.gz")));
    assert_eq!(gz.run(), report);
    let bytes = std::fs::read(&gz.settings.out).expect("written");
    assert_eq!((&bytes[..2], gz.log().rows), (&[0x1f, 0x8b][..], rows));
}

#[test]
fn a_reference_with_jitter_has_a_sample_for_every_row_and_spikes_are_named() {
    let ifm = |spike_m: Option<f64>| {
        let mut ifm = "t_us,x_m,y_m,rz_rad\n".to_owned();
        for k in 0..750 {
            let t_us = 2_000.0 * f64::from(k) + f64::from(k * 7919 % 41) - 20.0;
            let [x, y, rz] = pose(t_us);
            let x = spike_m.filter(|_| k % 200 == 100).unwrap_or(x);
            writeln!(ifm, "{t_us},{x:.12},{y:.12},{rz:.12}").expect("a string");
        }
        ifm
    };
    let table = sensors(4_000.0, 500.0, |_| true);
    let spikes = tables(&table, &ifm(Some(-2e-3)));
    spikes.refused(|error| {
        matches!(error, JoinError::ReferenceSpikes { largest_um } if (1.6e3..2.4e3).contains(largest_um))
    });
    let report = tables(&table, &ifm(None)).run();
    assert_eq!(report.join.too_far, 0);
    assert!(report.join.rows > 2_900, "{:?}", report.join);
}

/// Three cycles of the same motion: each shift by a cycle explains as much.
#[test]
fn a_run_that_repeats_is_joined_where_the_records_overlap_most() {
    let cycles = |text: &str, time: usize, length_us: f64| {
        let (head, rows) = text.split_once('\n').expect("a header");
        let mut all = head.to_owned() + "\n";
        for cycle in 0..3 {
            for row in rows.lines() {
                let mut cells: Vec<String> = row.split(',').map(str::to_owned).collect();
                let t_us: f64 = cells[time].parse().expect("a number");
                cells[time] = (t_us + f64::from(cycle) * length_us).to_string();
                all += &(cells.join(",") + "\n");
            }
        }
        all
    };
    let table = cycles(&sensors(0.0, 2_000.0, |_| true), 0, 1.5e6);
    let ifm = reference().replace("movement", "run");
    let ifm: String = ifm
        .lines()
        .map(|line| line.split_once(',').expect("cells").1.to_owned() + "\n")
        .collect();
    let join = tables(&table, &cycles(&ifm, 0, 1.5e6));
    let found_us = join.run().offset.us - SENSORS_US;
    assert!(found_us.abs() < 50.0, "{found_us}");
}

#[test]
fn a_vertical_pose_in_place_of_codes_goes_through() {
    let table = sensors(0.0, 2_000.0, |_| true);
    let table = table.replace("Cap 1,Cap 2,Cap 3", "Z [um],Rx [urad],Ry [urad]");
    let join = tables(&table, &reference());
    join.run();
    let row = join.log().rows[100];
    for (have, want) in row.vertical.into_iter().zip([100e-6, 101e-6, 99e-6]) {
        assert!((have - want).abs() < 1e-10, "{have}");
    }
}

#[test]
fn slips_with_units_signs_and_columns_are_named_before_a_clock_is_blamed() {
    let table = sensors(0.0, 2_000.0, |_| true);
    let refused = |sensors: &str, reference: &str| {
        let is_why = |error: &JoinError| matches!(error, JoinError::Columns { .. });
        tables(sensors, reference).refused(is_why)
    };
    let small = tables(&table, &reference().replace("_nm", "_pm"));
    small
        .refused(|error| matches!(error, JoinError::Unit { factor } if (factor - 1e3).abs() < 5.0));
    let exchanged = reference().replace("ifm_x_nm,ifm_y1_nm", "ifm_y1_nm,ifm_x_nm");
    let error = refused(&table, &exchanged);
    assert!(error.contains("ifm_x and ifm_y1 exchanged"), "{error}");
    let exchanged = table.replace("Hall A,Hall B,Hall C", "Hall C,Hall B,Hall A");
    let error = refused(&exchanged, &reference());
    assert!(error.contains("hall_a and hall_c exchanged"), "{error}");
    let turned = |text: &str, column: usize| -> String {
        let row = |line: &str| {
            let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
            if let Ok(number) = cells[column].parse::<f64>() {
                cells[column] = (-number).to_string();
            }
            cells.join(",") + "\n"
        };
        text.lines().map(row).collect()
    };
    for (column, key) in [(2, "ifm_x"), (4, "ifm_y2")] {
        let error = refused(&table, &turned(&reference(), column));
        assert!(
            error.contains(&format!("the sign of {key} turned")),
            "{error}"
        );
    }
    let error = refused(&turned(&table, 5), &reference());
    assert!(error.contains("the sign of hall_b turned"), "{error}");
}

#[test]
fn a_table_of_the_sensors_may_skip_bad_rows_and_has_no_interface() {
    let table = sensors(0.0, 2_000.0, |_| true);
    let spoilt = table.replacen(",100,101,99,", ",100,x,99,", 3);
    let join = tables(&spoilt, &reference());
    join.refused(|error| matches!(error, JoinError::Log(_)));
    let report = join
        .with(|settings| settings.bad_rows = BadRows::Skip)
        .run();
    // The reference has the movements.
    let [found] = report.warnings.as_slice() else {
        panic!("{:?}", report.warnings);
    };
    assert!(matches!(found.kind, Kind::RowsSkipped { rows: 3, .. }));
    let bus = "can0".parse().expect("an interface");
    let join = tables(&table, &reference()).with(|settings| settings.interface = Some(bus));
    join.refused(|error| matches!(error, JoinError::NoInterface { .. }));
}

#[test]
fn two_tables_of_the_same_kind_are_refused() {
    let table = sensors(0.0, 2_000.0, |_| true);
    for (a, b, word) in [
        (table.clone(), table.clone(), "each"),
        (reference(), reference_of(300, 0.0, None), "neither"),
    ] {
        let error = tables(&a, &b).refused(|error| matches!(error, JoinError::Roles { .. }));
        assert!(error.starts_with(word), "{error}");
    }
    let (head, rows) = table.split_once('\n').expect("a header");
    let again = format!("{head}\n{rows}{rows}");
    tables(&again, &reference()).refused(|error| matches!(error, JoinError::TimeRestarts { .. }));
}
