use super::chunk::SampledVertical;
use super::*;
use crate::input::dataset::{Dataset, LoggedFrame};
use crate::input::log::{LogWarning, ReadOptions, read_bytes};
use crate::input::shipped::{LOG_GZ, STAGE_TOML};
use crate::input::stage::Stage;
use crate::problem::parameters::Parameters;
use crate::problem::synthetic;
use runtime::VerticalPose;
use std::path::Path;
use std::sync::Arc;

pub(super) fn stage() -> Stage {
    Stage::from_toml(STAGE_TOML, Path::new("stage.toml")).expect("sound")
}

/// The log that ships, of which more than `rows_max` rows are not held.
pub(super) fn shipped(rows_max: Option<usize>) -> (Dataset, Vec<LogWarning>) {
    let options = ReadOptions {
        rows_max,
        ..ReadOptions::FIT
    };
    let reading = read_bytes(LOG_GZ, Path::new("log.csv.gz"), &stage(), &options).expect("sound");
    (reading.dataset, reading.warnings)
}

pub(super) fn whole_of(dataset: &Dataset) -> Arc<Whole> {
    let mut samples = Samples::default();
    for row in &dataset.rows {
        samples.push(&Sample::of(row));
    }
    let (movements, logs) = (dataset.movements.clone(), dataset.logs.clone());
    Arc::new(Whole::new(Scales::of(&stage()), samples, movements, logs))
}

#[test]
fn samples_come_back_as_they_were() {
    let rail = |k: i64| (k as i32).wrapping_mul(1_234_567);
    let sample = |k: i64| {
        // Codes of 16, then of 32 bits; times that start again, then a year apart.
        let code = |part: i64| match k {
            0..9_000 => rail(k + part) >> 16,
            _ => rail(k + part),
        };
        let pose = |part: i64| 1e-4 * (k + part) as f64;
        Sample {
            t_us: match k {
                0..5_000 => 2_000 * (k % 1_000),
                _ => k * 31_557_600_000_000,
            },
            hall: [0, 1, 2].map(code),
            vertical: match k {
                0..12_000 => SampledVertical::Codes([3, 4, 5].map(code)),
                _ => SampledVertical::Pose([3, 4, 5].map(pose)),
            },
            reference: [6, 7, 8].map(pose),
        }
    };
    let all: Vec<Sample> = (0..15_000).map(sample).collect();
    let mut samples = Samples::default();
    all.iter().for_each(|sample| samples.push(sample));
    assert_eq!(samples.len(), all.len());
    for rows in [
        0..15_000,
        4_090..4_100,
        11_990..12_010,
        7..7,
        14_999..15_001,
    ] {
        let wanted = all[rows.start..rows.end.min(all.len())].iter().copied();
        assert!(samples.of(rows.clone()).eq(wanted), "{rows:?}");
    }
}

#[test]
fn a_row_of_codes_takes_46_bytes() {
    let (dataset, _) = shipped(Some(50_000));
    let whole = dataset.whole.expect("an excerpt");
    let bytes: usize = whole.samples.chunks.iter().map(Chunk::bytes).sum();
    assert_eq!(bytes, 46 * whole.rows());
}

#[test]
fn an_excerpt_holds_rows_of_the_log_in_runs() {
    let (all, quiet) = shipped(Some(57_000));
    assert!(all.whole.is_none() && quiet.is_empty());
    let (excerpt, warnings) = shipped(Some(56_999));
    assert_eq!(excerpt.named(), (57_000, 57));
    assert_eq!(excerpt.sha256, all.sha256);
    let taken = excerpt.rows.len();
    assert!((13_500..=14_500).contains(&taken), "{taken}");
    let told = LogWarning::Excerpt {
        rows: 57_000,
        taken,
        runs: excerpt.movements.len(),
    };
    assert_eq!(warnings, [told]);
    assert_eq!(excerpt.logs[0].rows, 0..taken);
    for (number, run) in excerpt.movements.iter().enumerate() {
        let of_log = &all.movements[run.index as usize];
        let rows = &excerpt.rows[run.rows.clone()];
        let first = all.rows[of_log.rows.clone()]
            .iter()
            .position(|row| row.t_us == rows[0].t_us)
            .expect("a row of the movement");
        let begin = of_log.rows.start + first;
        for (have, want) in rows.iter().zip(&all.rows[begin..begin + rows.len()]) {
            let sequence = want.frame.sequence() - first as u32;
            let frame = want.frame.with_sequence(sequence);
            let movement = number;
            let want = Row {
                movement,
                frame,
                ..*want
            };
            assert_eq!(*have, want);
        }
    }
}

#[test]
fn an_excerpt_takes_the_rare_motion_and_not_the_rest() {
    let stage = stage();
    let truth = Parameters::designed(&stage);
    let mut dataset = synthetic::Protocol::exact(truth, 100).dataset(&stage);
    let moving = dataset.rows.len();
    // Twenty times as long at rest, before all the motion.
    let rest = dataset.rows[0];
    let at_rest = 20 * moving;
    dataset
        .rows
        .splice(0..0, std::iter::repeat_n(rest, at_rest));
    for movement in &mut dataset.movements {
        movement.rows = movement.rows.start + at_rest..movement.rows.end + at_rest;
    }
    dataset.movements.insert(
        0,
        Movement {
            log: 0,
            index: -1,
            rows: 0..at_rest,
        },
    );
    dataset.logs[0].rows = 0..dataset.rows.len();
    let excerpt = whole_of(&dataset).excerpt(4_000, [0; 32]);
    let rest = excerpt.movements.iter().filter(|run| run.index == -1);
    assert_eq!(rest.count(), 0);
    let motions = excerpt.movements.len();
    // Two places may lie in one run where every other run is taken.
    assert!((33..=41).contains(&motions), "{motions}");
}

/// Movements of 20 rows, whose rows `row` gives by movement and row.
pub(super) fn movements(count: usize, row: impl Fn(usize, usize, Row) -> Row) -> Dataset {
    let truth = Parameters::designed(&stage());
    let mut dataset = synthetic::Protocol::exact(truth, 100).dataset(&stage());
    let rows: Vec<Row> = dataset.rows[..20].to_vec();
    dataset.rows.clear();
    dataset.movements.clear();
    for movement in 0..count {
        let start = dataset.rows.len();
        let of_movement = (rows.iter().enumerate()).map(|(k, first)| row(movement, k, *first));
        dataset.rows.extend(of_movement);
        dataset.movements.push(Movement {
            log: 0,
            index: movement as i64,
            rows: start..start + rows.len(),
        });
    }
    dataset.logs[0].rows = 0..dataset.rows.len();
    dataset
}

/// How many runs of an excerpt each kind of movement gives, which repeat in turn.
pub(super) fn kinds<const N: usize>(excerpt: &Dataset) -> [usize; N] {
    let mut counts = [0; N];
    for run in &excerpt.movements {
        counts[run.index as usize % N] += 1;
    }
    counts
}

#[test]
fn an_excerpt_meets_a_protocol_that_repeats_in_all_its_phases() {
    let all_move = |_, k: usize, row| Row {
        reference: [1e-5 * k as f64, 0.0, 0.0],
        ..row
    };
    let whole = whole_of(&movements(4_096, all_move));
    for part in [8, 16, 32] {
        let excerpt = whole.excerpt(whole.rows() / part, [0; 32]);
        let runs = 4_096 / part;
        assert!(excerpt.movements.len().abs_diff(runs) <= 1);
        for count in kinds::<8>(&excerpt) {
            assert!((runs / 12..=runs / 6).contains(&count), "{part}: {count}");
        }
    }
}

#[test]
fn small_motions_are_taken_beside_large_ones_of_other_axes_and_faults() {
    let reference = |movement: usize, k: usize| match (movement, movement % 4) {
        // A beam that slipped.
        (77, _) => [0.0, 0.0, 4e-3 * k as f64],
        (_, 0) => [2e-6 * k as f64, 0.0, 0.0],
        (_, 1) => [0.0, 0.0, 2.5e-4 * k as f64],
        _ => [0.0; 3],
    };
    let moved = |movement: usize, k: usize, row: Row| Row {
        reference: reference(movement, k),
        frame: LoggedFrame::HallCodes {
            hall: [0; 3],
            // Every fourth only lifts the stage.
            vertical: VerticalPose {
                z_m: if movement % 4 == 2 {
                    1e-6 * k as f32
                } else {
                    0.0
                },
                rx_rad: 0.0,
                ry_rad: 0.0,
            },
            sequence: 0,
            time_us: 0,
        },
        vertical: [
            if movement % 4 == 2 {
                1e-6 * k as f64
            } else {
                0.0
            },
            0.0,
            0.0,
        ],
        ..row
    };
    let excerpt = whole_of(&movements(1_000, moved)).excerpt(2_000, [0; 32]);
    let [x, rz, z, idle] = kinds::<4>(&excerpt);
    assert_eq!(idle, 0);
    for count in [x, rz, z] {
        assert!((28..=40).contains(&count), "{x} {rz} {z}");
    }
}

#[test]
fn a_short_log_beside_a_long_one_has_rows_in_the_excerpt() {
    let all_move = |_, k: usize, row| Row {
        reference: [1e-5 * k as f64, 0.0, 0.0],
        ..row
    };
    let mut dataset = movements(1_000, all_move);
    dataset.logs.push(dataset.logs[0].clone());
    (dataset.logs[0].rows, dataset.logs[1].rows) = (0..19_940, 19_940..20_000);
    for movement in &mut dataset.movements[997..] {
        movement.log = 1;
    }
    let excerpt = whole_of(&dataset).excerpt(100, [0; 32]);
    let of_second = excerpt.movements.iter().filter(|run| run.log == 1);
    assert_eq!(of_second.count(), 3);
    assert_eq!(excerpt.logs[1].rows.len(), 60);
}

#[test]
fn an_excerpt_holds_the_rare_runs_that_go_far() {
    let far = 1_000..1_003;
    let moves = |movement: usize, k: usize, row| Row {
        reference: [
            match far.contains(&movement) {
                true => 3e-5,
                false => 1e-5,
            } * k as f64,
            0.0,
            0.0,
        ],
        ..row
    };
    let whole = whole_of(&movements(4_096, moves));
    let excerpt = whole.excerpt(whole.rows() / 32, [0; 32]);
    let far = (excerpt.movements.iter()).filter(|run| far.contains(&(run.index as usize)));
    assert_eq!(far.count(), 3);
    assert!(excerpt.movements.len() <= 132);
}

#[test]
fn a_log_beside_longer_ones_has_its_share_of_an_excerpt() {
    let all_move = |_, k: usize, row| Row {
        reference: [1e-5 * k as f64, 0.0, 0.0],
        ..row
    };
    let mut dataset = movements(1_000, all_move);
    dataset.logs.push(dataset.logs[0].clone());
    (dataset.logs[0].rows, dataset.logs[1].rows) = (0..19_000, 19_000..20_000);
    for movement in &mut dataset.movements[950..] {
        movement.log = 1;
    }
    let excerpt = whole_of(&dataset).excerpt(2_000, [0; 32]);
    let of_second = excerpt.movements.iter().filter(|run| run.log == 1);
    let numbers: Vec<i64> = of_second.map(|run| run.index).collect();
    assert_eq!(numbers.len(), 25);
    let early = numbers.iter().filter(|number| **number < 975).count();
    assert!((10..=15).contains(&early), "{numbers:?}");
}

#[test]
fn a_report_says_how_much_of_a_long_log_is_drawn() {
    let (excerpt, _) = shipped(Some(50_000));
    let mut provenance = crate::report::provenance::Provenance::default();
    provenance.add_logs(&excerpt);
    let (rows, runs) = (excerpt.rows.len(), excerpt.movements.len());
    let want =
        format!("log, 57000 rows in 57 movements; {rows} of them, in {runs} runs, are drawn");
    assert_eq!(provenance.inputs[0].what, want);
}
