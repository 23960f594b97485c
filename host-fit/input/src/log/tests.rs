mod accepts;
mod forms;
mod long;
mod movements;
mod patterns;
mod refuses;
mod refuses_files;
mod shapes;
mod skips;

use super::*;
use crate::dataset::{Dataset, Row};
use crate::finding::Code;
use crate::source::SourceProblem;
use crate::stage::tests::SOUND;
use std::io::Write;

/// A sound log of two movements of three rows; the tests spoil one thing at a time.
const LOG: &str = "\
movement,t_us,ifm_x_nm,ifm_y1_nm,ifm_y2_nm,cap1_cnt,cap2_cnt,cap3_cnt,hall_a_cnt,hall_b_cnt,hall_c_cnt
0,0,221,1325,1373,2,1,3,13,14,3
0,2000,161,7664,7702,1,0,1,97,87,-6
0,4000,101,13950,14011,0,2,1,180,160,-9
4,0,-864,2501,2898,766,-767,-3,11,3,3
4,2000,-871,8700,9102,764,-765,0,90,75,1
4,4000,-860,15000,15300,765,-766,1,170,150,2
";

/// The stage of these logs, with `log` in its table `[log]`.
fn stage_with(log: &str) -> Stage {
    let text = format!("{SOUND}[log]\n{log}\n");
    Stage::from_toml(&text, Path::new("stage.toml")).expect("sound")
}

fn stage() -> &'static Stage {
    static STAGE: std::sync::LazyLock<Stage> = std::sync::LazyLock::new(|| stage_with(""));
    &STAGE
}

fn read_text(text: &str, options: &ReadOptions) -> Result<LogReading, LogError> {
    read_bytes(text.as_bytes(), Path::new("log.csv"), stage(), options)
}

fn sound(text: &str) -> LogReading {
    read_text(text, &ReadOptions::default()).expect("sound")
}

/// The log after replacing `old`, which must be there once, by `new`.
#[track_caller]
fn spoilt(old: &str, new: &str) -> String {
    assert_eq!(LOG.matches(old).count(), 1, "{old}");
    LOG.replace(old, new)
}

/// The log by a stage.
fn read_in(bytes: impl AsRef<[u8]>, stage: &Stage) -> Result<LogReading, LogError> {
    let options = ReadOptions::default();
    read_bytes(bytes.as_ref(), Path::new("log.csv"), stage, &options)
}

/// It has the rows of [`LOG`], however it is written down, and nothing is odd about it.
#[track_caller]
fn same_rows(bytes: impl AsRef<[u8]>, stage: &Stage) {
    let bytes = bytes.as_ref();
    let shown = String::from_utf8_lossy(bytes.get(..200).unwrap_or(bytes)).into_owned();
    let reading = read_in(bytes, stage).unwrap_or_else(|error| panic!("{error}: {shown}"));
    let near = |a: f64, b: f64| (a - b).abs() <= 1e-12 * b.abs();
    let want = sound(LOG).dataset;
    assert_eq!(reading.warnings, [], "{shown}");
    assert_eq!(reading.dataset.rows.len(), want.rows.len(), "{shown}");
    for (have, want) in reading.dataset.rows.iter().zip(&want.rows) {
        assert_eq!((have.t_us, have.frame), (want.t_us, want.frame), "{shown}");
        let pairs = have.reference.into_iter().zip(want.reference);
        assert!(pairs.into_iter().all(|(a, b)| near(a, b)), "{shown}");
    }
}

/// How the log is refused in `stage`: with these words and a remedy.
#[track_caller]
fn refused_with(text: &str, stage: &Stage, parts: &[&str]) -> LogError {
    let error = read_in(text, stage).expect_err(text);
    let message = error.to_string();
    assert!(message.contains("; "), "names a remedy: {message}");
    for part in parts {
        assert!(message.contains(part), "{part}: {message}");
    }
    error
}

/// The problem of a log that is refused.
#[track_caller]
fn problem(read: Result<LogReading, LogError>) -> LogProblem {
    read.expect_err("refused").problem
}

/// It is refused for this reason.
#[track_caller]
fn is_for(error: &LogError, is_why: impl Fn(&LogProblem) -> bool) {
    assert!(is_why(&error.problem), "{error}");
}

/// A log with each of these texts in place of another.
fn replaced(log: &str, pairs: &[(&str, &str)]) -> String {
    let replace = |log: String, (old, new): &(&str, &str)| log.replace(old, new);
    pairs.iter().fold(log.to_owned(), replace)
}

/// Log, index and rows of each movement.
fn movements(dataset: &Dataset) -> Vec<(usize, i64, std::ops::Range<usize>)> {
    let movements = dataset.movements.iter();
    movements
        .map(|m| (m.log, m.index, m.rows.clone()))
        .collect()
}

/// The log with the cells of each line changed.
fn with_cells(change: impl Fn(&mut Vec<&str>)) -> String {
    let line = |line: &'static str| {
        let mut cells: Vec<&str> = line.split(',').collect();
        change(&mut cells);
        cells.join(",") + "\n"
    };
    LOG.lines().map(line).collect()
}

fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::default());
    encoder.write_all(bytes).expect("in memory");
    encoder.finish().expect("in memory")
}

/// Line and column (from 1) of the cell that an error names, with the column's name and the
/// movement.
fn place(error: &LogError) -> (usize, usize, &str, Option<i64>) {
    match &*error.place {
        Place {
            line: Some(line),
            column: Some((column, name)),
            movement,
            ..
        } => (*line, *column, name, *movement),
        _ => panic!("no cell: {error}"),
    }
}

/// The error of a log that is refused, which must name the file and a remedy.
#[track_caller]
fn refused(text: &str) -> LogError {
    let error = read_text(text, &ReadOptions::default()).expect_err("refused");
    let message = error.to_string();
    assert!(message.starts_with("log.csv"), "names the file: {message}");
    assert!(message.contains("; "), "names a remedy: {message}");
    error
}
