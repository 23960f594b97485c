//! `fit` and `check` end in a defined way, whatever a log consists of.

use crate::common::{Bench, log, stderr};
use proptest::prelude::*;
use proptest::test_runner::{Config, RngSeed, TestRunner};
use std::fmt::Write;

/// Logs that are tried: they take some eight seconds.
const CASES: u32 = 16;
const FIT: &str = "fit log.csv --bad-rows skip --out p.bin";
const PERIOD_US: i64 = 2000;
const SHIPPED_MOVEMENTS: usize = 57;

/// The rows of one movement.
#[derive(Clone, Copy, Debug)]
enum Rows {
    /// Of the shipped log, which moves in all axes.
    Moving,
    /// One row again and again.
    Idle,
    /// Moving, with a channel that holds one value: its place among the columns.
    Constant(usize),
    /// Moving, with times that jump ahead now and then.
    Gaps,
    /// Moving, with a time that comes twice.
    RepeatedTime,
    /// Moving, with every Hall code at the rail of its converter.
    AllBad,
}

fn movements() -> impl Strategy<Value = Vec<(Rows, usize)>> {
    let rows = prop_oneof![
        20 => Just(Rows::Moving),
        8 => Just(Rows::Idle),
        2 => (2usize..11).prop_map(Rows::Constant),
        2 => Just(Rows::Gaps),
        2 => Just(Rows::AllBad),
        1 => Just(Rows::RepeatedTime),
    ];
    let count = prop_oneof![
        1 => Just(1usize),
        4 => 1usize..60,
        1 => 60usize..400,
    ];
    // Long movements are rare, as they cost time.
    let long = prop_oneof![
        9 => Just(None),
        1 => (400usize..=50_000).prop_map(Some),
    ];
    let rows = rows.boxed();
    let short = prop::collection::vec((rows.clone(), count), 1..70);
    (short, rows, long).prop_map(|(mut all, rows, long)| {
        all.extend(long.map(|count| (rows, count)));
        all
    })
}

/// The text of a log of these movements, made of the rows of the shipped one.
fn text(shipped: &str, movements: &[(Rows, usize)]) -> String {
    let (header, rows) = shipped.split_once('\n').expect("a header");
    let cells =
        |row: &str| -> Vec<i64> { row.split(',').map(|c| c.parse().expect("whole")).collect() };
    let shipped: Vec<Vec<i64>> = rows.lines().map(cells).collect();
    let mut text = header.to_owned() + "\n";
    for (number, (rows, count)) in movements.iter().enumerate() {
        // A movement begins where one of the shipped log does.
        let mut next = number % SHIPPED_MOVEMENTS * shipped.len() / SHIPPED_MOVEMENTS;
        let mut t_us = 0;
        for k in 0..*count {
            let mut cells = shipped[next % shipped.len()].clone();
            next += usize::from(!matches!(rows, Rows::Idle));
            t_us += match rows {
                Rows::RepeatedTime if k == 5 && number % 8 == 0 => 0,
                Rows::Gaps if k % 7 == 6 => 100 * PERIOD_US,
                _ => PERIOD_US,
            };
            (cells[0], cells[1]) = (number as i64, t_us);
            match rows {
                Rows::Constant(column) => cells[*column] = 0,
                Rows::AllBad => cells[8..].fill(-32_768),
                _ => {}
            }
            let cells: Vec<String> = cells.iter().map(i64::to_string).collect();
            let _ = writeln!(text, "{}", cells.join(","));
        }
    }
    text
}

/// The command ends with a status of the contract. It writes a blob, or says why not.
fn assert_defined(bench: &Bench, command: &str) {
    let _ = std::fs::remove_file(bench.path("p.bin"));
    let output = bench.run(command);
    let (status, message) = (output.status.code(), stderr(&output));
    let is_defined = matches!(status, Some(0 | 3 | 4));
    assert!(is_defined, "{command}: {status:?} {message}");
    let is_refused = status != Some(0);
    assert_eq!(is_refused, message.contains("host-fit: "), "{message}");
    assert!(!(is_refused && bench.has("p.bin")), "{message}");
}

#[test]
fn every_log_is_fitted_or_refused_with_a_reason() {
    let (bench, shipped) = (Bench::new(), log());
    // An idle movement outweighs all that move.
    let mut idle = vec![(Rows::Moving, 20); 57];
    idle.push((Rows::Idle, 38_000));
    bench.write("log.csv", text(&shipped, &idle));
    assert_defined(&bench, FIT);
    assert_defined(&bench, "check log.csv");
    let mut runner = TestRunner::new(Config {
        cases: CASES,
        rng_seed: RngSeed::Fixed(34),
        failure_persistence: None,
        max_shrink_iters: 100,
        ..Config::default()
    });
    let checked = runner.run(&movements(), |movements| {
        bench.write("log.csv", text(&shipped, &movements));
        assert_defined(&bench, FIT);
        Ok(())
    });
    checked.expect("a defined end");
}
