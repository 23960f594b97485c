use super::*;
use crate::finding::Code;
use crate::log::{LogError, LogProblem, LogReading, ReadOptions, read, read_bytes};
use crate::shipped::{LOG_GZ, stage};
use std::path::{Path, PathBuf};

/// Movements of 20 rows: `row` gives by movement and row.
fn movements(count: usize, row: impl Fn(usize, usize, Row) -> Row) -> Dataset {
    let options = ReadOptions::default();
    let made = read_bytes(LOG_GZ, Path::new("log"), &stage(), &options)
        .expect("sound")
        .dataset;
    let mut dataset = Dataset::default();
    for movement in 0..count {
        let start = dataset.rows.len();
        let rows = made.rows[..20].iter().enumerate();
        dataset
            .rows
            .extend(rows.map(|(k, first)| row(movement, k, *first)));
        dataset.movements.push(Movement {
            log: 0,
            index: movement as i64,
            rows: start..dataset.rows.len(),
        });
    }
    dataset.end_log("made");
    dataset
}

/// How many runs of a sample each kind of movement gives, which repeat in turn.
fn kinds<const N: usize>(sample: &Dataset) -> [usize; N] {
    let mut counts = [0; N];
    for run in &sample.movements {
        counts[run.index as usize % N] += 1;
    }
    counts
}

/// A file with the log that ships.
fn shipped(folder: &tempfile::TempDir, name: &str) -> PathBuf {
    let path = folder.path().join(name);
    std::fs::write(&path, LOG_GZ).expect("written");
    path
}

fn options(rows_max: usize) -> ReadOptions {
    ReadOptions {
        rows_max,
        ..ReadOptions::FIT
    }
}

fn read_at_most(paths: &[PathBuf], rows_max: usize) -> Result<LogReading, LogError> {
    read(paths, &stage(), &options(rows_max))
}

/// What is kept of the rows of a dataset.
fn kept(dataset: &Dataset, rows_max: usize) -> Dataset {
    let mut sampler = Sampler::new(rows_max);
    for source in &dataset.logs {
        sampler.begin_log();
        for row in source.rows.clone() {
            let movement = &dataset.movements[dataset.rows[row].movement];
            let begins = movement.rows.start == row;
            sampler.push(movement.index, begins, &dataset.rows[row]);
            assert!(sampler.rows.len() <= rows_max);
        }
        sampler.end_log(source.clone());
    }
    sampler.into_dataset(dataset.sha256)
}

#[test]
fn a_long_log_is_sampled_in_unchanged_runs() {
    let folder = tempfile::tempdir().expect("a folder");
    let paths = [shipped(&folder, "log.csv.gz")];
    let all = read_at_most(&paths, 57_000).expect("sound");
    assert_eq!((all.dataset.rows.len(), all.warnings.len()), (57_000, 0));
    let LogReading {
        dataset, warnings, ..
    } = read_at_most(&paths, 10_000).expect("sound");
    let taken = dataset.rows.len();
    assert!((2_500..=5_000).contains(&taken), "{taken}");
    assert_eq!(dataset.sha256, all.dataset.sha256);
    assert_eq!(
        (dataset.logs[0].rows.clone(), dataset.read()),
        (0..taken, (57_000, 57))
    );
    let found: Vec<_> = warnings
        .iter()
        .map(|found| (found.code(), found.value()))
        .collect();
    assert_eq!(found, [(Code::Excerpt, Some(taken as f64))]);
    for (number, run) in dataset.movements.iter().enumerate() {
        let rows = &dataset.rows[run.rows.clone()];
        let log_rows = all.dataset.movements[run.index as usize].rows.clone();
        let log_rows = &all.dataset.rows[log_rows];
        let first = log_rows.partition_point(|row| row.t_us < rows[0].t_us);
        assert_eq!(rows.len(), RUN);
        for (have, want) in rows.iter().zip(&log_rows[first..]) {
            let sequence = want.frame.sequence() - log_rows[first].frame.sequence();
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
    for rows_max in [2_000, 10_000, 40_000] {
        let kept = kept(&dataset, rows_max);
        assert!((rows_max / 5..=rows_max / 2).contains(&kept.rows.len()));
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
    assert!((500..=2_500).contains(&rows[0]), "{rows:?}");
    assert_eq!(rows[1], 400);
    assert!((500..=2_500).contains(&rows[2]), "{rows:?}");
}

#[test]
fn a_log_named_twice_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = shipped(&folder, "a.csv.gz");
    let again = folder.path().join("./a.csv.gz");
    let refused = read_at_most(&[path, again.clone()], 200_000).expect_err("twice the same");
    assert!(matches!(refused.problem, LogProblem::SameLog), "{refused}");
    assert_eq!(refused.place.path, again);
}
