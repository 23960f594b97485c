use super::*;
use hallstage_input::shipped;
use proptest::prelude::*;
use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};

const DAYS_APART: f64 = 30.0;
/// Gains lose this in a day, a part.
const LOSS_PER_DAY: f64 = 2e-6;

/// The example of a field model with other gains of all probes, made on a day of 2026.
fn blob(day: f64, gain: f64, serial: &str) -> Blob {
    let bytes = include_bytes!("../../../runtime/examples/field.bin");
    let mut set = ParameterSet::from_bytes(bytes).expect("sound");
    // A weaker signal reads as less of the pose: a blob that knows it gives more.
    let per_code = set.constants.planar_per_code.as_flattened_mut();
    per_code.iter_mut().for_each(|x| *x /= gain as f32);
    let first = DateTime::constant(2026, 1, 1, 0, 0, 0, 0);
    let date = first + SignedDuration::from_secs((day * DAY_S) as i64);
    set.created = date.to_string().as_str().try_into().expect("short");
    set.serial = serial.try_into().expect("short");
    set.fit.rms = [0.5e-6; 3];
    (format!("day {day}"), set, None)
}

/// The trend of gains that fall evenly, with these errors of each calibration.
fn trend(errors: &[f64]) -> Trend {
    let mut stage = shipped::stage();
    stage.certificate.limits = [Some(1e-6), None, None];
    let blobs = errors.iter().enumerate().map(|(k, error)| {
        let day = DAYS_APART * k as f64;
        blob(day, 1.0 - LOSS_PER_DAY * day + error, "S")
    });
    // The order of the files does not count.
    Trend::new(&blobs.rev().collect::<Vec<_>>(), &stage).expect("a trend")
}

/// Days until X, with half the range of service as its rms, has the limit.
fn true_days() -> f64 {
    let service_m = shipped::stage().motion.axes[0].service;
    (1.0f64 - 0.25).sqrt() * 1e-6 / (LOSS_PER_DAY * 0.5 * service_m)
}

#[test]
fn an_even_drift_reaches_the_limit_on_its_day() {
    let found = trend(&[0.0; 4]);
    let drift = &found.drifts[0];
    let [day, earliest, latest] = drift.days.map(|days| days.expect("a date"));
    let expected = true_days();
    assert!((day / expected - 1.0).abs() < 0.02, "{day} {expected}");
    assert!(earliest <= day && day <= latest, "{:?}", drift.days);
    assert!(latest - earliest < 0.05 * day, "{:?}", drift.days);
    let date = found.date_after(day).expect("a date");
    let last = found.calibrations.last().expect("four");
    assert_eq!(last.day, 90.0);
    assert!((f64::from((date - last.date.date()).get_days()) - day).abs() <= 1.0);
    // Errors beyond the limit need no drift.
    let beyond = super::drift([0.0; 2], 2, 1e-6, Some(0.9e-6));
    assert_eq!(beyond.days, [Some(0.0); 3]);
    // No limit, no date.
    assert_eq!(found.drifts[1].days, [None; 3]);
}

#[test]
fn two_calibrations_have_a_line_without_an_interval() {
    let found = trend(&[0.0; 2]);
    assert_eq!(found.drifts[0].interval, None);
    assert!(found.drifts[0].days[0].is_some());
    assert!(shown::answer(&found).contains("a line through two calibrations has no interval"));
}

#[test]
fn no_trend_of_other_stages_of_one_time_or_without_a_date() {
    let stage = shipped::stage();
    let new = |blobs: Vec<Blob>| Trend::new(&blobs, &stage).expect_err("no trend");
    let (first, later) = (blob(0.0, 1.0, "S"), blob(9.0, 1.0, "S"));
    let other = new(vec![first.clone(), blob(9.0, 1.0, "T")]);
    assert!(matches!(other, TrendError::OtherStage { serial, .. } if serial == "T"));
    assert_eq!(new(vec![first.clone(), first.clone()]), TrendError::NoLine);
    let mut undated = later;
    undated.1.created = "yesterday".try_into().expect("short");
    let undated = new(vec![first, undated]);
    assert!(matches!(undated, TrendError::NoDate { created, .. } if created == "yesterday"));
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
