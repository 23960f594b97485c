//! Logs without a column for the movement.

use super::*;

/// Rows at these times, ms, without a movement.
fn log_at(times_ms: impl IntoIterator<Item = i64>) -> String {
    let (header, _) = LOG.split_once('\n').expect("a header");
    let rows = (0..).zip(times_ms);
    let rows = rows.map(|(k, t)| format!("{},{k},0,0,0,0,0,{},13,14\n", t * 1000, k % 100));
    header.replace("movement,", "") + "\n" + &rows.collect::<String>()
}

fn read_skipping(text: &str) -> Result<LogReading, LogError> {
    let options = ReadOptions {
        bad_rows: BadRows::Skip,
        ..ReadOptions::default()
    };
    read_text(text, &options)
}

/// How many rows each movement has.
#[track_caller]
fn lengths(text: &str) -> Vec<usize> {
    let reading = read_skipping(text).expect("sound");
    let movements = reading.dataset.movements;
    let is_found = reading.warnings.iter().any(|found| {
        found.code() == Code::MovementsByTime && found.value() == Some(movements.len() as f64)
    });
    assert!(is_found, "{:?}", reading.warnings);
    for (slot, (movement, index)) in movements.iter().zip(0..).enumerate() {
        assert_eq!(movement.index, index);
        let rows = &reading.dataset.rows[movement.rows.clone()];
        assert!(rows.iter().all(|row| row.movement == slot));
        assert_eq!(rows[0].frame.sequence(), 0);
    }
    movements
        .into_iter()
        .map(|movement| movement.rows.len())
        .collect()
}

#[test]
fn a_continuous_log_is_one_movement_however_its_times_jitter() {
    assert_eq!(lengths(&log_at((0..500).map(|k| 2 * k))), [500]);
    let jitter = (0..500).map(|k| 20 * k + [0, 3, -4, 8][k as usize % 4]);
    assert_eq!(lengths(&log_at(jitter)), [500]);
    // Every tenth row is missing, and ten in a row once.
    let missing = (0..500).filter(|k| k % 10 != 3 && !(100..109).contains(k));
    assert_eq!(lengths(&log_at(missing.map(|k| 2 * k))).len(), 1);
}

#[test]
fn a_movement_ends_at_a_gap_and_where_the_time_starts_again() {
    let gaps = (0..20).chain(31..50).chain(200..230).map(|k| 2 * k);
    assert_eq!(lengths(&log_at(gaps)), [20, 19, 30]);
    let again = (0..20).chain(0..30).chain(-5..20).map(|k| 2 * k);
    assert_eq!(lengths(&log_at(again)), [20, 30, 25]);
}

#[test]
fn rows_that_are_left_out_make_no_gap() {
    let mut lines: Vec<String> = log_at((0..60).map(|k| 2 * k))
        .lines()
        .map(str::to_owned)
        .collect();
    for line in &mut lines[20..45] {
        *line = line.replace(",13,", ",32767,");
    }
    assert_eq!(lengths(&(lines.join("\n") + "\n")), [35]);
    // A gap before rows that are left out is one.
    for line in &mut lines[20..] {
        let (time, rest) = line.split_once(',').expect("cells");
        *line = format!("{},{rest}", time.parse::<i64>().expect("a time") + 100_000);
    }
    assert_eq!(lengths(&(lines.join("\n") + "\n")), [19, 16]);
}

#[test]
fn rows_out_of_order_stay_refused() {
    for times in [
        vec![0, 2, 0, 4, 6],
        (0..30).chain(20..40).collect(),
        (0..30).chain(29..40).collect(),
    ] {
        let error = read_skipping(&log_at(times)).expect_err("out of order");
        let text = error.to_string();
        let is_order = text.contains("backwards") || text.contains("repeats");
        assert!(is_order, "{text}");
    }
    // A column that stage.toml names must be there.
    let stage = stage_with("movement = \"run\"");
    let log = log_at((0..30).map(|k| 2 * k));
    let missing = problem(read_in(&log, &stage));
    let key = "movement";
    assert!(matches!(missing, LogProblem::MissingColumn { key: found, .. } if found == key));
}
