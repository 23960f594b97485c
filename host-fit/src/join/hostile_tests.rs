//! Inputs that are damaged, mixed up or not what they should be. The fuzz targets `candump` and `reference`
//! try what no one thinks of.

use super::records_for_tests::{candump, files, reference};
use super::*;

#[test]
fn two_records_in_one_file_are_refused_where_the_second_begins() {
    let bus = candump(|_, _| false);
    let twice = files(&format!("{bus}{bus}"), &reference());
    let second = bus.lines().count() + 1;
    let second = second..second + 40;
    twice.refused(
        |error| matches!(error, JoinError::TwoRecords { line, .. } if second.contains(line)),
    );
}

#[test]
fn a_bus_that_saw_little_of_the_reference_is_joined_where_it_saw_it() {
    let join = files(&candump(|n, _| !(100..450).contains(&n)), &reference());
    assert!(join.run().join.rows > 300);
    join.check_poses(1e-9);
}

#[test]
fn codes_beyond_the_converter_are_refused_and_those_at_its_rails_left_out() {
    let import = |code_max: &str| {
        let import = files(&candump(|_, _| false), &reference());
        let text = hallstage_input::shipped::STAGE_TOML.replace("32767", code_max);
        std::fs::write(&import.settings.stage.path, text).expect("written");
        import
    };
    // A motion of 300 um has codes up to 4800; with the lever arm more.
    let beyond = import("4000");
    beyond.refused(|error| matches!(error, JoinError::OutsideConverter { .. }));
    let at_rails = import("4800");
    let report = at_rails.run();
    assert!(report.bus().saturated > 0);
    assert_eq!(at_rails.log().rows.len(), report.join.rows);
}

#[test]
fn a_slow_reference_is_joined_as_long_as_its_samples_show_the_motion() {
    let ifm = reference();
    let (head, rows) = ifm.split_once('\n').expect("a header");
    let every = |step: usize| {
        let slow: Vec<&str> = rows.lines().step_by(step).collect();
        files(
            &candump(|_, _| false),
            &format!("{head}\n{}", slow.join("\n")),
        )
    };
    // One sample in 5 ms, a servo period of 2 ms.
    let join = every(5);
    join.run();
    join.check_poses(30e-9);
    every(60).refused(|error| matches!(error, JoinError::ReferenceTooSlow { .. }));
    // Held values are no slow clock.
    let mut last = "";
    let held = rows.lines().enumerate().map(|(k, row)| {
        let cells: Vec<&str> = row.splitn(3, ',').collect();
        last = if k % 40 == 0 { cells[2] } else { last };
        format!("{},{},{last}\n", cells[0], cells[1])
    });
    let held = format!("{head}\n{}", held.collect::<String>());
    files(&candump(|_, _| false), &held).refused(
        |error| matches!(error, JoinError::ReferenceHeld { rows } if (35.0..45.0).contains(rows)),
    );
}
