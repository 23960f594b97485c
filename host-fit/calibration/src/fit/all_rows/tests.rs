use super::*;
use crate::fit::ModelChoice;
use flate2::read::GzDecoder;
use hallstage_input::finding::Code;
use hallstage_input::log::{ReadOptions, SaturatedCodes, read};
use hallstage_input::shipped::{LOG_GZ, STAGE_TOML};
use hallstage_solver::problem::model::Model;
use runtime::ModelKind;
use std::io::Read;
use std::path::PathBuf;

fn stage() -> Stage {
    Stage::from_toml(STAGE_TOML, "stage.toml".as_ref()).expect("sound")
}

/// The shipped log in a file, with some cells changed: by movement and row of the movement.
fn log_file(folder: &tempfile::TempDir, change: impl Fn(usize, usize, &mut [String])) -> PathBuf {
    let mut text = String::new();
    let read = GzDecoder::new(LOG_GZ).read_to_string(&mut text);
    read.expect("text");
    let mut changed = Vec::new();
    for (number, line) in text.lines().enumerate() {
        let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
        if let Some(row) = number.checked_sub(1) {
            change(row / 1000, row % 1000, &mut cells);
        }
        changed.push(cells.join(","));
    }
    let path = folder.path().join("log.csv");
    std::fs::write(&path, changed.join("\n") + "\n").expect("written");
    path
}

/// The fit to a sample of at most `rows_max` rows.
fn fitted(path: PathBuf, stage: &Stage, rows_max: usize) -> Fit {
    let options = ReadOptions {
        rows_max: Some(rows_max),
        saturated: SaturatedCodes::Keep,
        ..ReadOptions::FIT
    };
    let log = read(&[path], stage, &options).expect("sound");
    let model = Model::of(ModelKind::M31);
    let settings = FitSettings::new(ModelChoice::Named(model));
    let fitted = fit_log(&log, stage, &settings).expect("read again");
    fitted.expect("a fit")
}

#[test]
fn what_cannot_be_decoded_and_what_is_clipped_is_counted_in_all_rows() {
    let mut narrow = stage();
    narrow.search.delta_m.low = -1.5e-6;
    narrow.search.delta_m.high = 1.5e-6;
    let folder = tempfile::tempdir().expect("a folder");
    // A code at the end of the range in the last row of each movement.
    let path = log_file(&folder, |_, k, cells| {
        if k == 999 {
            "32767".clone_into(&mut cells[8]);
        }
    });
    let fit = fitted(path, &narrow, 50_000);
    assert!(fit.judgement.movements.len() < 57);
    let count = fit.all.zeros.iter().filter(|zero| zero.is_beyond).count();
    assert!((20..57).contains(&count), "{count}");
    let count_of = |code| fit.warnings.iter().find(|found| found.code == code)?.value;
    assert_eq!(count_of(Code::ZeroClipped), Some(count as f64));
    assert_eq!(count_of(Code::Saturated), Some(57.0));
}

#[test]
fn wild_rows_of_a_long_log_are_counted_and_decide_neither_over_the_fit_nor_over_its_range() {
    let folder = tempfile::tempdir().expect("a folder");
    let clean = fitted(log_file(&folder, |_, _, _| {}), &stage(), 50_000);
    let path = log_file(&folder, |movement, k, cells| {
        if movement % 7 == 3 && k == 700 {
            "5000000".clone_into(&mut cells[2]);
        }
    });
    let fit = fitted(path, &stage(), 50_000);
    assert_eq!((clean.left_out.rows, fit.left_out.rows), (0, 8));
    assert_eq!(fit.left_out.of, 57_000);
    assert!(fit.all.errors.axes[0].rms > 50e-6, "{:?}", fit.all.errors);
    let range = |fit: &Fit| fit.set.constants.calibrated_planar[0];
    assert!((range(&fit) / range(&clean) - 1.0).abs() < 0.01);
}

#[test]
fn a_fit_to_a_sample_is_as_good_as_one_to_all_rows_and_has_their_range() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = log_file(&folder, |_, _, _| {});
    let [all, sample] = [57_000, 50_000].map(|most| fitted(path.clone(), &stage(), most));
    assert_eq!((all.all.rows(), sample.set.fit.rows), (57_000, 57_000));
    assert!(sample.train_rows < 26_000);
    for (all, sample) in all.all.errors.axes.iter().zip(sample.all.errors.axes) {
        let ratio = sample.rms / all.rms;
        assert!((1.0..1.05).contains(&ratio), "{ratio}");
    }
    let ranges = |fit: &Fit| {
        let constants = &fit.set.constants;
        [constants.calibrated_planar, constants.calibrated_vertical].concat()
    };
    assert_eq!(ranges(&all), ranges(&sample));
}
