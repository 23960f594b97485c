//! Faults of a record: told with their place, or left out and counted.

use super::records_for_tests::{candump, files, reference};
use super::*;
use hal_adapters::candump::LineError;

#[test]
fn missing_frames_and_repeated_samples_are_reported_and_leave_gaps() {
    let bus = candump(|n, k| n == 100 && k == 0 || (200..203).contains(&n));
    let line = "0,50000,";
    let ifm = reference();
    let at = ifm.find(line).expect("that sample");
    let row = ifm[at..].lines().next().expect("a line").to_owned();
    let ifm = ifm.replacen(&row, &format!("{row}\n{row}"), 1);
    let import = files(&bus, &ifm);
    let report = import.run();
    assert_eq!(report.reference.duplicates, 1);
    assert_eq!(report.bus().health.incomplete, 1);
    // Three ticks are gone; the next tick only resumes the sequence.
    assert_eq!((report.bus().gaps, report.bus().ticks_missing), (2, 5));
    assert_eq!(report.join.rows, import.log().rows.len());
}

#[test]
fn a_broken_line_is_refused_with_its_number_or_left_out() {
    let bus = candump(|_, _| false);
    let cut = bus.lines().nth(6).expect("a line").len() - 3;
    let mut lines: Vec<&str> = bus.lines().collect();
    lines[6] = &lines[6][..cut];
    let import = files(&lines.join("\n"), &reference());
    import.refused(|error| {
        matches!(
            error,
            JoinError::BadLine {
                line: 7,
                fault: LineError::Malformed { column: 30, .. },
                ..
            }
        )
    });
    let report = import
        .with(|settings| settings.bad_rows = BadRows::Skip)
        .run();
    assert_eq!(report.bus().bad_lines, 1);
}

/// It is read as every log is, without the columns of the probes.
#[test]
fn a_fault_of_the_reference_has_its_place() {
    let head = "movement,t_us,ifm_x_nm,ifm_y1_nm,ifm_y2_nm\n";
    for (reference, place) in [
        (head.replace(",ifm_y2_nm", ""), "ifm.csv:1: "),
        (head.to_owned(), "ifm.csv: fewer than two rows"),
        (
            format!("{head}0,0,1,2,3\n0,1000,1,x,3\n"),
            "ifm.csv:3: column 4 (ifm_y1_nm)",
        ),
    ] {
        let message = files(&candump(|_, _| false), &reference).refused(|_| true);
        let is_told = message.contains(place) && message.contains("; ");
        assert!(is_told, "{message}");
    }
    let spoilt = reference().replacen("0,50000,", "0,50000,x", 1);
    let import = files(&candump(|_, _| false), &spoilt);
    import.refused(|error| matches!(error, JoinError::Log(_)));
    let report = import
        .with(|settings| settings.bad_rows = BadRows::Skip)
        .run();
    assert_eq!((report.reference.bad, report.reference.gaps), (1, 1));
}

#[test]
fn a_record_without_sensor_frames_and_one_of_two_interfaces_are_refused() {
    let ifm = reference();
    let none = files("(1.000000) can0 123#00\n", &ifm);
    none.refused(|error| matches!(error, JoinError::NoTicks { frames: 1, .. }));
    let two = "(1.000000) can0 123#00\n(1.000000) can1 123#00\n";
    let two = files(two, &ifm);
    two.refused(|error| matches!(error, JoinError::SeveralInterfaces { line: 2, .. }));
    let no_file = files("", &ifm).with(|settings| settings.a = "/no/such/file".into());
    no_file.refused(|error| matches!(error, JoinError::Log(_)));
}
