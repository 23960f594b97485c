use super::*;
use hallstage_input::shipped::stage;

/// A log of rows at these times, us, by movement.
fn log(movements: &[&[i64]], header: &str) -> tempfile::NamedTempFile {
    let file = tempfile::NamedTempFile::new().expect("a file");
    let rows = (0..).zip(movements).flat_map(|(movement, times)| {
        let row = move |t_us: &i64| format!("{movement},{t_us},0,0,0,1,2,3\n");
        times.iter().map(row)
    });
    let text = format!("movement,t_us,{header}\n{}", rows.collect::<String>());
    std::fs::write(file.path(), text).expect("written");
    file
}

const CODES: &str = "cap1_cnt,cap2_cnt,cap3_cnt,hall_a_cnt,hall_b_cnt,hall_c_cnt";

#[test]
fn movements_follow_each_other_one_period_apart_and_gaps_within_them_stay() {
    let log = log(&[&[500, 2_500, 4_500, 10_500], &[900_000, 902_000]], CODES);
    let (mut timeline, mut due) = (Timeline::default(), Vec::new());
    let stage = stage();
    let open = LogRows::open(log.path(), "reading", &stage, &ReadOptions::DECODE);
    let mut rows = open.expect("sound");
    timeline.period_us = rows.period_us() as u64;
    while let Some(row) = rows.next_row().expect("sound") {
        due.push(timeline.due(&row, codes(&row, log.path()).expect("codes")));
    }
    let times: Vec<_> = due.iter().map(|d| (d.at_us, d.frame.sequence)).collect();
    let want = [
        (0, 0),
        (2_000, 1),
        (4_000, 2),
        (10_000, 5),
        (12_000, 6),
        (14_000, 7),
    ];
    assert_eq!(times, want);
    assert!(due.iter().all(|d| u64::from(d.frame.time_us) == d.at_us));
    assert_eq!(due[0].frame.hall, [1, 2, 3]);
    assert_eq!(rows_of(log.path(), &stage).ok(), Some(6));
}

#[test]
fn a_log_without_capacitive_codes_cannot_be_played() {
    let log = log(
        &[&[0]],
        &CODES.replace("cap1_cnt,cap2_cnt,cap3_cnt", "z_m,rx_rad,ry_rad"),
    );
    let refused = rows_of(log.path(), &stage());
    assert!(matches!(refused, Err(ReplayError::NoCodes { .. })));
}
