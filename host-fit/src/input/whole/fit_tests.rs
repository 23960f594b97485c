//! Fits to an excerpt, and the judgement of all rows.

use super::tests::{shipped, stage, whole_of};
use crate::fit::{Fit, FitSettings, FitWarning, ModelChoice, fit};
use crate::input::dataset::{Dataset, LoggedFrame, Row};
use crate::input::stage::Stage;
use crate::judge::of_rows::{NO_LIMIT, OfRows};
use crate::judge::whole::LogJudgement;
use crate::judge::{Decoded, Zeros};
use crate::problem::model::Model;
use runtime::ModelKind;

#[test]
fn a_whole_log_is_judged_as_its_rows_are() {
    let (dataset, _) = shipped(None);
    let stage = stage();
    let model = Model::of(ModelKind::M31);
    let settings = FitSettings::new(ModelChoice::Named(model));
    let fit = fit(&dataset, &stage, &settings).expect("a fit");
    for zeros in [Zeros::Refit, Zeros::None] {
        let decoded = Decoded::new(&fit.set, &dataset);
        let want = decoded.judge(&dataset, &stage, zeros).errors;
        let whole = whole_of(&dataset);
        let rows = OfRows::new(&fit.set, &whole, NO_LIMIT);
        let [have, kept] = rows.judgements(&fit.set, &whole, &stage, zeros);
        assert_eq!((rows.left_out.rows, &kept), (0, &have));
        assert_eq!(have.errors.rows, want.rows);
        let rows = dataset.rows.len();
        let errors = have.errors;
        assert_eq!(have.logs, [LogJudgement { rows, errors }]);
        let zeros = decoded.judge(&dataset, &stage, zeros).zeros;
        for (have, want) in have.zeros.iter().zip(&zeros) {
            for (have, want) in have.delta_m.iter().zip(want.delta_m) {
                assert!((have - want).abs() < 1e-12);
            }
        }
        assert_eq!(have.zeros.len(), zeros.len());
        for (have, want) in have.errors.axes.iter().zip(want.axes) {
            assert!((have.rms / want.rms - 1.0).abs() < 1e-9);
            assert!((have.peak / want.peak - 1.0).abs() < 1e-9);
        }
    }
}

/// A fit to an excerpt of the shipped log with some rows changed: by movement and row of the movement.
fn fitted_excerpt(stage: &Stage, change: impl Fn(usize, usize, &mut Row)) -> (Dataset, Fit) {
    let (mut dataset, _) = shipped(None);
    for (number, movement) in dataset.movements.iter().enumerate() {
        for (k, row) in dataset.rows[movement.rows.clone()].iter_mut().enumerate() {
            change(number, k, row);
        }
    }
    let excerpt = whole_of(&dataset).excerpt(12_500, [0; 32]);
    let model = Model::of(ModelKind::M31);
    let settings = FitSettings::new(ModelChoice::Named(model));
    let fit = fit(&excerpt, stage, &settings).expect("a fit");
    (excerpt, fit)
}

#[test]
fn a_fit_to_an_excerpt_counts_what_cannot_be_decoded_and_what_is_clipped_in_the_whole_log() {
    let mut narrow = stage();
    narrow.search.delta_m.low = -1.5e-6;
    narrow.search.delta_m.high = 1.5e-6;
    // A code at the end of the range in the last row of each movement.
    let (excerpt, fit) = fitted_excerpt(&narrow, |_, k, row| {
        if let (999, LoggedFrame::Codes(frame)) = (k, &mut row.frame) {
            frame.hall[0] = 32_767;
        }
    });
    assert!(excerpt.movements.len() < 57);
    let judged = fit.whole.as_ref().expect("an excerpt");
    let count = judged.zeros.iter().filter(|zero| zero.clipped).count();
    assert!((20..57).contains(&count), "{count}");
    let counts: Vec<_> = fit.warnings.iter().filter(|told| told.is_count()).collect();
    let want = [
        FitWarning::ZeroDeviationClipped { count, of: 57 },
        FitWarning::Undecoded { rows: 57 },
    ];
    assert_eq!(counts, want.each_ref());
}

#[test]
fn wild_rows_of_a_long_log_are_counted_and_decide_neither_over_the_fit_nor_over_its_range() {
    let (_, clean) = fitted_excerpt(&stage(), |_, _, _| {});
    let (_, fit) = fitted_excerpt(&stage(), |movement, k, row| {
        if movement % 7 == 3 && k == 700 {
            row.reference[0] += 5e-3;
        }
    });
    assert_eq!((clean.left_out.rows, fit.left_out.rows), (0, 8));
    assert_eq!(fit.left_out.of, 57_000);
    assert!(fit.errors().axes[0].rms > 50e-6, "{:?}", fit.errors());
    let range = |fit: &Fit| fit.set.constants.calibrated_planar[0];
    assert!((range(&fit) / range(&clean) - 1.0).abs() < 0.01);
}

#[test]
fn the_range_of_all_rows_is_that_of_a_log_held_as_rows() {
    let (dataset, _) = shipped(None);
    let (_, fit) = fitted_excerpt(&stage(), |_, _, _| {});
    let rows = OfRows::new(&fit.set, &whole_of(&dataset), NO_LIMIT);
    for axis in 0..3 {
        let farthest = |of: fn(&Row) -> [f64; 3]| {
            let all = dataset.rows.iter().map(|row| of(row)[axis].abs());
            all.fold(0.0, f64::max)
        };
        let planar = rows.planar[axis] / farthest(|row| row.reference);
        let vertical = rows.vertical[axis] / farthest(|row| row.vertical);
        assert!((0.98..=1.0).contains(&planar), "{axis}: {planar}");
        assert!((0.98..=1.0).contains(&vertical), "{axis}: {vertical}");
    }
}

#[test]
fn a_fit_to_an_excerpt_is_as_good_as_one_to_all_rows() {
    let stage = stage();
    let model = Model::of(ModelKind::M31);
    let settings = FitSettings::new(ModelChoice::Named(model));
    let fitted = |rows_max| {
        let (dataset, _) = shipped(rows_max);
        fit(&dataset, &stage, &settings).expect("a fit")
    };
    let (all, excerpt) = (fitted(None), fitted(Some(50_000)));
    assert_eq!(excerpt.set.fit.rows, 57_000);
    assert!(excerpt.train_rows < 13_000);
    for (all, excerpt) in all.errors().axes.iter().zip(excerpt.errors().axes) {
        let ratio = excerpt.rms / all.rms;
        // By 25 runs of 114; an excerpt in service has 125 at least.
        assert!((1.0..1.05).contains(&ratio), "{ratio}");
    }
}
