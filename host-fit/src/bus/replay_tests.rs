use super::*;
use crate::input::dataset::{Movement, Row};

fn row(t_us: i64, sequence: u32) -> Row {
    Row {
        movement: 0,
        t_us,
        frame: LoggedFrame::Codes(RawFrame {
            hall: [1, 2, 3],
            capacitive: [4, 5, 6],
            sequence,
            time_us: t_us as u32,
        }),
        signal_m: [0.0; 3],
        vertical: [0.0; 3],
        reference: [0.0; 3],
    }
}

fn dataset(movements: &[&[(i64, u32)]]) -> Dataset {
    let mut dataset = Dataset::default();
    for (index, rows) in (0i64..).zip(movements) {
        let start = dataset.rows.len();
        dataset.rows.extend(rows.iter().map(|(t, s)| row(*t, *s)));
        dataset.movements.push(Movement {
            log: 0,
            index,
            rows: start..dataset.rows.len(),
        });
    }
    dataset
}

#[test]
fn movements_follow_each_other_one_period_apart_and_gaps_within_them_stay() {
    let dataset = dataset(&[
        &[(500, 0), (2_500, 1), (8_500, 4)],
        &[(900_000, 0), (902_000, 1)],
    ]);
    let frames = numbered(&dataset).expect("codes");
    let due: Vec<_> = frames.iter().map(|d| (d.at_us, d.frame.sequence)).collect();
    assert_eq!(
        due,
        [(0, 0), (2_000, 1), (8_000, 4), (10_000, 5), (12_000, 6)]
    );
}

#[test]
fn a_log_without_capacitive_codes_cannot_be_played() {
    let mut dataset = dataset(&[&[(0, 0)]]);
    dataset.rows[0].frame = LoggedFrame::HallCodes {
        hall: [0; 3],
        vertical: runtime::VerticalPose::default(),
        sequence: 0,
        time_us: 0,
    };
    assert_eq!(numbered(&dataset), None);
}
