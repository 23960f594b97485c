//! Whether changes are on a line, and what it gives.

use super::*;
use proptest::prelude::*;
use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};

#[test]
fn two_calibrations_have_a_line_without_an_interval() {
    let found = trend(&[0.0; 2]);
    assert_eq!(found.drifts[0].interval, None);
    assert!(found.drifts[0].days[0].is_some());
    assert!(shown::answer(&found).contains("a line through two calibrations has no interval"));
}

#[test]
fn a_jump_is_named_with_its_dates_and_has_no_line() {
    let scatter = [0.0, 1e-6, -2e-6, 1e-6, -1e-6, 2e-6];
    let jumped = |size: f64| {
        let errors = (0..6).map(|k| scatter[k] + LOSS_PER_DAY * DAYS_APART * k as f64);
        let errors: Vec<f64> = errors
            .enumerate()
            .map(|(k, of)| of - size * f64::from(k > 3))
            .collect();
        trend(&errors)
    };
    let found = jumped(2e-3);
    let (first, size) = found.drifts[0].jump.expect("a jump");
    let expected = 2e-3 * 0.5 * shipped::stage().motion.axes[0].service;
    assert_eq!(first, 4);
    assert!((size / expected - 1.0).abs() < 0.02, "{size} {expected}");
    assert_eq!(found.drifts[0].days, [None; 3]);
    let said = shown::answer(&found);
    assert!(
        said.starts_with("X jumped by 0.50 µm (rms) between 2026-04-01 and 2026-05-01"),
        "{said}"
    );
    assert!(said.contains("a line does not describe this") && !said.contains("No limit"));
    // Neither scatter alone nor an even drift is a jump.
    assert_eq!(jumped(0.0).drifts[0].jump, None);
    assert_eq!(trend(&[0.0; 6]).drifts[0].jump, None);
}

#[test]
fn the_drift_is_the_slope_of_scattered_changes_with_its_interval() {
    let found = trend(&[0.0, 3e-3, 0.0, 3e-3]);
    // Of the losses, and 0.2 of the scatter for each month of 30 days.
    let slope = (2.0 * 3e-3 / 10.0 / DAYS_APART - LOSS_PER_DAY).abs();
    let expected = slope * 0.5 * shipped::stage().motion.axes[0].service;
    let drift = &found.drifts[0];
    assert!((drift.per_day / expected - 1.0).abs() < 0.02, "{drift:?}");
    let [low, high] = drift.interval.expect("an interval");
    assert!(low < drift.per_day && drift.per_day < high);
}

#[test]
fn changes_beyond_the_errors_are_not_on_a_line_and_have_no_date() {
    let stage = shipped::stage();
    // Two jumps.
    let gains = [0.0, 0.0, 2e-3, 2e-3, 4e-3, 4e-3, 4e-3];
    let found = |size: f64, error: f64| {
        let blobs = gains.iter().enumerate().map(|(k, gain)| {
            let gain = 1.0 - size * gain - LOSS_PER_DAY * DAYS_APART * k as f64;
            known(blob(DAYS_APART * k as f64, gain, "S"), error)
        });
        Trend::new(&blobs.collect::<Vec<_>>(), &stage).expect("a trend")
    };
    let jumped = found(1.0, 1e-5);
    let drift = &jumped.drifts[0];
    assert_eq!(
        (drift.jump, drift.is_line),
        (None, Some(false)),
        "{drift:?}"
    );
    assert_eq!(drift.days, [None; 3]);
    assert!(drift.per_day > 0.0 && drift.interval.is_some());
    let said = shown::answer(&jumped);
    assert!(said.contains("off its line, beyond the errors"), "{said}");
    let [even, within] = [found(0.0, 1e-5), found(1.0, 1e-2)];
    assert_eq!(
        [&even, &within].map(|of| of.drifts[0].is_line),
        [Some(true); 2]
    );
}

#[test]
fn a_blob_without_posterior_does_not_tell_whether_the_changes_are_on_a_line() {
    let blobs = [0.0, 2e-3, 0.0, 2e-3].iter().enumerate().map(|(k, gain)| {
        let blob = blob(DAYS_APART * k as f64, 1.0 - gain, "S");
        if k == 1 { blob } else { known(blob, 1e-5) }
    });
    let mut blobs: Vec<Blob> = blobs.collect();
    blobs[1].1.fit.rms = [1e-3; 3];
    let found = Trend::new(&blobs, &shipped::stage()).expect("a trend");
    assert_eq!(found.drifts.map(|drift| drift.is_line), [None; 3]);
    assert!(shown::warnings(&found)[0].starts_with("whether the changes are on a line"));
}

#[test]
fn the_quantile_of_student_is_that_of_tables() {
    for (freedom, table) in [(1, 12.706), (4, 2.776), (5, 2.571), (8, 2.306), (30, 2.042)] {
        assert!((student(freedom) / table - 1.0).abs() < 0.01, "{freedom}");
    }
}

#[test]
fn nineteen_of_twenty_intervals_hold_the_true_day_of_a_scattered_drift() {
    let mut random = ChaCha8Rng::seed_from_u64(5);
    // A third of the change between two calibrations, to both sides.
    let mut held = 0;
    for _ in 0..60 {
        let count = random.random_range(3..8);
        let errors: Vec<f64> = (0..count)
            .map(|_| random.random_range(-2e-5..2e-5))
            .collect();
        let [_, earliest, latest] = trend(&errors).drifts[0].days;
        let is_early = earliest.is_some_and(|day| day <= true_days());
        held += u32::from(is_early && latest.is_none_or(|day| day >= true_days()));
    }
    assert!((54..60).contains(&held), "{held} of 60");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    /// The errors in service grow by the drift alone: they are at the limit on the day that is named.
    #[test]
    fn on_the_day_that_is_named_the_errors_are_at_the_limit(
        errors in prop::collection::vec(-5e-5..5e-5, 2..7),
    ) {
        let found = trend(&errors);
        let (drift, own) = (&found.drifts[0], found.calibrations[errors.len() - 1].errors[0]);
        for (day, per_day) in drift.days.into_iter().zip([Some(drift.per_day), drift.interval.map(|ends| ends[1])]) {
            if let (Some(day), Some(per_day)) = (day, per_day) {
                let then = own.hypot(per_day * day);
                prop_assert!((then / 1e-6 - 1.0).abs() < 1e-9, "{then}");
            }
        }
        let [day, earliest, latest] = drift.days.map(|day| day.unwrap_or(f64::INFINITY));
        prop_assert!(earliest <= day && day <= latest, "{:?}", drift.days);
    }
}
