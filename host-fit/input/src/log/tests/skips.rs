use super::*;

const SKIP: ReadOptions = ReadOptions {
    bad_rows: BadRows::Skip,
    ..ReadOptions::FIT
};

fn codes(reading: &LogReading) -> Vec<i32> {
    let first = |row: &Row| row.frame.hall()[0];
    reading.dataset.rows.iter().map(first).collect()
}

#[test]
fn bad_cells_are_left_out_and_counted_by_reason() {
    let text = LOG
        .replace(",97,", ",32767,")
        .replace(",180,", ",-32768,")
        .replace(",90,", ",,")
        .replace("-860", "NaN");
    let reading = read_text(&text, &SKIP).expect("read");
    assert_eq!(codes(&reading), [13, 11]);
    assert_eq!(reading.skipped_rows, 4);
    let skipped = reading
        .warnings
        .iter()
        .filter_map(|found| match found.kind {
            Kind::RowsSkipped {
                reason,
                rows,
                line,
                column,
                ..
            } => Some((reason, rows, line, column)),
            _ => None,
        });
    let want = [
        ("a saturated code", 2, 3, 9),
        ("an empty cell", 1, 6, 9),
        ("a missing value or an infinity", 1, 7, 3),
    ];
    assert_eq!(skipped.collect::<Vec<_>>(), want);
    let want = [(0, 0, 0..1), (0, 4, 1..2)];
    assert_eq!(movements(&reading.dataset), want);
}

#[test]
fn a_movement_of_which_nothing_is_left_gives_a_warning() {
    let text = LOG
        .replace(",13,14", ",a,14")
        .replace(",97,", ",b,")
        .replace(",180,", ",c,");
    let reading = read_text(&text, &SKIP).expect("read");
    assert_eq!(reading.dataset.movements.len(), 1);
    assert_eq!(reading.dataset.rows[0].movement, 0);
    let lost = |found: &Finding| matches!(&found.kind, Kind::MovementsSkipped { movements, rows: 3, .. } if movements[..] == [0]);
    assert!(reading.warnings.iter().any(lost), "{:?}", reading.warnings);
}

#[test]
fn a_log_of_which_nothing_is_left_is_refused() {
    let text: String = LOG
        .replace(",1,", ",?,")
        .replace(",2,", ",?,")
        .replace(",-767,", ",?,")
        .replace(",-765,", ",?,")
        .replace(",-766,", ",?,");
    let error = read_text(&text, &SKIP).expect_err("nothing left");
    let LogProblem::NoGoodRows { rows: 6, first } = &error.problem else {
        panic!("{error}");
    };
    assert!(matches!(first.problem, LogProblem::Cell(_)), "{error}");
}

#[test]
fn a_wrong_structure_is_refused_all_the_same() {
    for (old, new, part) in [
        ("97,87,-6", "97,87", "10 cells"),
        ("150,2\n", "", "ends in the middle"),
        ("\n4,2000,-871", "\n4,-1,x", "backwards"),
        ("hall_b_cnt", "hall_d_cnt", "not known"),
    ] {
        let error = read_text(&spoilt(old, new), &SKIP).expect_err(part);
        assert!(error.to_string().contains(part), "{error}");
    }
}
