//! Long logs, and files that would take much memory or time.

use super::*;
use crate::log::lines::LINE_BYTES_MAX;
use crate::log::table::COLUMNS_MAX;

/// More rows than are read for the period of a log, in movements of a thousand.
const ROWS: usize = 100_000;

/// The line of a row, from 1.
const fn line_of(row: usize) -> usize {
    row + 2
}

fn lines() -> Vec<String> {
    let header = LOG.lines().next().expect("a header").to_owned();
    let row = |k: usize| {
        let (movement, t_us) = (k / 1000, 2000 * (k % 1000));
        format!("{movement},{t_us},{},1325,1373,2,1,3,13,14,3", k % 777)
    };
    [header].into_iter().chain((0..ROWS).map(row)).collect()
}

fn text_of(lines: &[String]) -> String {
    lines.join("\n") + "\n"
}

/// The log with a part of one row replaced.
fn spoilt_row(row: usize, old: &str, new: &str) -> String {
    let mut lines = lines();
    let line = &mut lines[line_of(row) - 1];
    assert!(line.contains(old), "{line}");
    *line = line.replacen(old, new, 1);
    text_of(&lines)
}

#[test]
fn every_row_of_a_long_log_is_read() {
    let text = text_of(&lines());
    let dataset = sound(&text).dataset;
    assert_eq!((dataset.rows.len(), dataset.movements.len()), (ROWS, 100));
    for (k, row) in dataset.rows.iter().enumerate() {
        assert_eq!(
            (row.movement, row.frame.sequence() as usize),
            (k / 1000, k % 1000)
        );
        assert_eq!(row.reference[0], (k % 777) as f64 * 1e-9);
    }
    assert_eq!(dataset.sha256, <[u8; 32]>::from(Sha256::digest(&text)));
}

#[test]
fn faults_far_down_are_named_with_their_place_and_the_first_wins() {
    let mut lines = lines();
    lines[line_of(90_001) - 1] = lines[line_of(90_000) - 1].clone();
    lines[line_of(90_001)] = "1,2".to_owned();
    let error = refused(&text_of(&lines));
    is_for(&error, |why| {
        matches!(why, LogProblem::DuplicatedRow { .. })
    });
    assert_eq!(place(&error).0, line_of(90_001));
    let error = refused(&spoilt_row(90_000, "90,0,", "3,0,"));
    is_for(
        &error,
        |why| matches!(why, LogProblem::MovementReturns { left_line } if *left_line == line_of(4000)),
    );
    let error = refused(&spoilt_row(90_000, "90,0,", "90,2026-01-02T03:04:05,"));
    let LogProblem::Cell(fault) = &error.problem else {
        panic!("{error}");
    };
    assert!(matches!(fault, CellFault::OtherTime { .. }), "{fault}");
    let (line, column, ..) = place(&error);
    assert_eq!((line, column), (line_of(90_000), 2));
}

#[test]
fn rows_that_are_left_out_of_many_movements_are_reported_in_few_lines() {
    let mut lines = lines();
    for (row, line) in lines[1..].iter_mut().enumerate() {
        if (row / 1000) % 4 == 1 {
            *line = line.replace(",13,14,", ",13,x,");
        }
    }
    let options = ReadOptions {
        bad_rows: BadRows::Skip,
        ..ReadOptions::default()
    };
    let reading = read_text(&text_of(&lines), &options).expect("the others");
    assert_eq!(reading.skipped_rows, 25_000);
    assert_eq!(reading.warnings.len(), 1 + 1);
    let last = reading.warnings.last().expect("warnings");
    let lost = matches!(&last.kind, Kind::MovementsSkipped { movements, rows: 25_000, .. }
        if movements.len() == 25 && movements[..3] == [1, 5, 9]);
    assert!(lost, "{last:?}");
}

#[test]
fn headers_and_lines_that_no_log_has_are_refused_by_their_length() {
    let names: Vec<String> = (0..=COLUMNS_MAX).map(|k| format!("n{k}")).collect();
    let error = refused(&names.join(","));
    is_for(&error, |why| {
        matches!(why, LogProblem::TooManyColumns { .. })
    });
    assert_eq!(error.place.line, Some(1));
    let error = refused(&",".repeat(2 * LINE_BYTES_MAX));
    is_for(&error, |why| matches!(why, LogProblem::LineTooLong { .. }));
    assert_eq!(error.place.line, Some(1));
    let long = "7".repeat(2 * LINE_BYTES_MAX);
    let error = refused(&format!("{LOG}5,0,{long}\n"));
    is_for(&error, |why| matches!(why, LogProblem::LineTooLong { .. }));
    assert_eq!(error.place.line, Some(8));
    let packed = gzip(&vec![b'\n'; 100 << 20]);
    let read = |bytes: &[u8]| read_bytes(bytes, Path::new("log"), stage(), &ReadOptions::default());
    let error = read(&packed).expect_err("empty");
    assert!(matches!(error.problem, LogProblem::Empty), "{error}");
}
