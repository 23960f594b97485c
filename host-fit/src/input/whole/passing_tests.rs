use super::super::tests::{kinds, movements, stage};
use super::*;
use crate::fit::{FitSettings, ModelChoice, fit};
use crate::input::log::{LogError, LogReading, LogWarning, ReadOptions, read, read_passing};
use crate::input::shipped::LOG_GZ;
use crate::judge::of_rows::{NO_LIMIT, OfRows};
use crate::judge::statistics::AxisError;
use crate::judge::whole::{Judge, WholeJudgement};
use crate::judge::{Zeros, error};
use crate::problem::model::Model;
use std::path::PathBuf;

/// A file with the log that ships.
fn shipped(folder: &tempfile::TempDir, name: &str) -> PathBuf {
    let path = folder.path().join(name);
    std::fs::write(&path, LOG_GZ).expect("written");
    path
}

fn options(rows_max: usize) -> ReadOptions {
    ReadOptions {
        rows_max: Some(rows_max),
        ..ReadOptions::FIT
    }
}

fn passed(paths: &[PathBuf], rows_max: usize) -> Result<LogReading, LogError> {
    read_passing(paths, &stage(), &options(rows_max), |_| (), |_, _| ())
}

/// What is kept of a dataset that passes.
fn kept(dataset: &Dataset, rows_max: usize) -> Dataset {
    let mut passing = Passing::new(&stage(), rows_max);
    for source in &dataset.logs {
        passing.begin_log();
        for row in source.rows.clone() {
            let movement = &dataset.movements[dataset.rows[row].movement];
            let begins = movement.rows.start == row;
            let sequence = dataset.rows[row].frame.sequence();
            passing.push(
                movement.index,
                begins,
                sequence,
                &Sample::of(&dataset.rows[row]),
            );
            // A vector has up to twice the room.
            assert!(passing.bytes() <= 2 * (rows_max * size_of::<Row>()) as u64 + 100_000);
        }
        passing.end_log(source.clone());
    }
    passing.into_dataset(dataset.sha256)
}

#[test]
fn logs_that_are_short_are_read_as_a_fit_reads_them() {
    let folder = tempfile::tempdir().expect("a folder");
    let paths = [shipped(&folder, "log.csv.gz")];
    let want = read(&paths, &stage(), &options(57_000)).expect("sound");
    assert_eq!(passed(&paths, 57_000).expect("sound"), want);
}

#[test]
fn of_a_long_log_runs_are_kept_as_they_are() {
    let folder = tempfile::tempdir().expect("a folder");
    let paths = [shipped(&folder, "log.csv.gz")];
    let all = read(&paths, &stage(), &options(57_000)).expect("sound");
    let LogReading {
        dataset, warnings, ..
    } = passed(&paths, 10_000).expect("sound");
    let taken = dataset.rows.len();
    assert!((4_000..=10_000).contains(&taken), "{taken}");
    assert_eq!(dataset.sha256, all.dataset.sha256);
    assert_eq!(dataset.logs[0].rows, 0..taken);
    let told = LogWarning::Excerpt {
        rows: 57_000,
        taken,
        runs: dataset.movements.len(),
    };
    assert_eq!(warnings, [told]);
    for (number, run) in dataset.movements.iter().enumerate() {
        let rows = &dataset.rows[run.rows.clone()];
        let of_log = all.dataset.movements[run.index as usize].rows.clone();
        let of_log = &all.dataset.rows[of_log];
        let first = of_log.partition_point(|row| row.t_us < rows[0].t_us);
        assert_eq!(rows.len(), RUN);
        for (have, want) in rows.iter().zip(&of_log[first..]) {
            let sequence = want.frame.sequence() - of_log[first].frame.sequence();
            let want = Row {
                movement: number,
                frame: want.frame.with_sequence(sequence),
                ..*want
            };
            assert_eq!(*have, want);
        }
    }
}

#[test]
fn a_protocol_that_repeats_is_kept_in_all_its_phases_and_its_rests_are_not() {
    // Every eighth movement stands still.
    let dataset = movements(4_096, |movement, k: usize, row| Row {
        movement,
        reference: [1e-5 * (k * (movement % 8).min(1)) as f64, 0.0, 0.0],
        ..row
    });
    for rows_max in [1_000, 5_000, 20_000] {
        let kept = kept(&dataset, rows_max);
        assert!(kept.rows.len() <= rows_max && kept.rows.len() >= rows_max * 2 / 5);
        let [still, moving @ ..] = kinds::<8>(&kept);
        assert_eq!(still, 0);
        let runs = kept.movements.len();
        for count in moving {
            assert!((runs / 10..=runs / 5).contains(&count), "{runs}: {count}");
        }
    }
}

#[test]
fn short_logs_and_logs_at_rest_keep_rows_beside_a_long_one() {
    let mut dataset = movements(3_000, |movement, k: usize, row| Row {
        movement,
        reference: [1e-5 * (k * usize::from(movement < 2_400)) as f64, 0.0, 0.0],
        ..row
    });
    // The second moves, the third does not, and is too long to be kept whole.
    let ends = [0, 2_380, 2_400, 3_000];
    dataset.logs = vec![dataset.logs[0].clone(); 3];
    for (log, source) in dataset.logs.iter_mut().enumerate() {
        source.rows = 20 * ends[log]..20 * ends[log + 1];
        for movement in &mut dataset.movements[ends[log]..ends[log + 1]] {
            movement.log = log;
        }
    }
    let kept = kept(&dataset, 6_000);
    let rows: Vec<usize> = kept.logs.iter().map(|log| log.rows.len()).collect();
    assert!((1_000..=4_000).contains(&rows[0]), "{rows:?}");
    assert_eq!(rows[1], 400);
    assert!((1_000..=4_000).contains(&rows[2]), "{rows:?}");
}

#[test]
fn a_log_named_twice_is_refused_whatever_its_length() {
    let folder = tempfile::tempdir().expect("a folder");
    let paths = [shipped(&folder, "a.csv.gz"), shipped(&folder, "b.csv.gz")];
    for rows_max in [200_000, 10_000] {
        let refused = passed(&paths, rows_max).expect_err("twice the same");
        assert!(
            matches!(&refused, LogError::SameLog { path, first } if *path == paths[1] && *first == paths[0]),
            "{refused}"
        );
    }
}

#[test]
fn rows_that_pass_are_judged_as_those_that_are_held() {
    let folder = tempfile::tempdir().expect("a folder");
    let (stage, paths) = (stage(), [shipped(&folder, "log.csv.gz")]);
    let held = read(&paths, &stage, &options(10_000)).expect("sound");
    let model = Model::of(runtime::ModelKind::M31);
    let settings = FitSettings {
        // However badly so few rows tell the parameters.
        force: true,
        ..FitSettings::new(ModelChoice::Named(model))
    };
    let set = fit(&held.dataset, &stage, &settings).expect("a fit").set;
    let whole = held.dataset.whole.expect("an excerpt");
    let decoder = set.decoder();
    let mut judge = Judge::new(&set, &stage, 1);
    let error = |sample: &Sample| error(&decoder, &sample.frame(), sample.reference);
    read_passing(&paths, &stage, &options(10_000), error, |log, row| {
        judge.take(log, row.begins, row.item.1, row.item.0.reference);
    })
    .expect("sound");
    for zeros in [Zeros::Refit, Zeros::None] {
        let have = judge.judgement(zeros);
        let [want, _] = OfRows::new(&set, &whole, NO_LIMIT).judgements(&set, &whole, &stage, zeros);
        assert_eq!((have.rows(), have.zeros.len()), (57_000, 57));
        assert_eq!(
            (have.rows(), have.zeros.len()),
            (want.rows(), want.zeros.len())
        );
        let clipped = |judged: &WholeJudgement| judged.zeros.iter().filter(|z| z.clipped).count();
        assert_eq!(clipped(&have), clipped(&want));
        let figures = |judged: &WholeJudgement| {
            let of_axis = |axis: &AxisError| [axis.rms, axis.peak];
            judged
                .errors
                .axes
                .iter()
                .flat_map(of_axis)
                .collect::<Vec<f64>>()
        };
        for (have, want) in figures(&have).into_iter().zip(figures(&want)) {
            assert!((have / want - 1.0).abs() < 1e-9, "{have} {want}");
        }
    }
}
