use super::*;
use crate::report::provenance::Provenance;
use hallstage_calibration::budget::Budget;
use hallstage_calibration::judge::predicted::{Predicted, declared_service};
use hallstage_calibration::recalibrate::Certificates;
use hallstage_input::shipped;
use hallstage_solver::estimator::parameters::FieldParameters;
use hallstage_solver::estimator::posterior::Posterior;
use hallstage_solver::estimator::terms::COUNT;
use hallstage_solver::estimator::whiten::Noise;
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
    set.logs_sha256[..8].copy_from_slice(&day.to_le_bytes());
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
    let days = [0.0, 1.0, 2.0, 3.0];
    let beyond = super::drift(
        &DMatrix::zeros(4, 4),
        &days,
        Some(0.0),
        (1e-6, Some(0.9e-6)),
    );
    assert_eq!(beyond.map(|of| of.days), Some([Some(0.0); 3]));
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
    let twice = new(vec![first.clone(), later.clone(), first.clone()]);
    assert!(matches!(twice, TrendError::SameLog { name, other } if name == other));
    let mut other_log = first.clone();
    other_log.1.logs_sha256[9] ^= 1;
    assert_eq!(new(vec![first.clone(), other_log]), TrendError::NoLine);
    let mut undated = later;
    undated.1.created = "yesterday".try_into().expect("short");
    let undated = new(vec![first, undated]);
    assert!(matches!(undated, TrendError::NoDate { created, .. } if created == "yesterday"));
}

#[test]
fn a_time_with_a_zone_is_an_instant() {
    let day = |created: &str| date(created).map(|date| date.date().to_string());
    assert_eq!(
        day("2026-01-01T01:00:00+02:00").as_deref(),
        Some("2025-12-31")
    );
    assert_eq!(day("2026-01-01T23:00:00").as_deref(), Some("2026-01-01"));
    let other_forms = [
        "today",
        "0000-01-01",
        "20261126",
        "2026-11-26T23:59:60",
        "2026-11-26T23:59:60Z",
    ];
    for created in other_forms {
        assert_eq!(day(created), None, "{created}");
    }
}

#[test]
fn a_time_with_a_zone_and_a_date_without_one_are_compared_by_their_days() {
    let before = |own, other| assert!(is_before(own, other) && !is_before(other, own));
    let even = |own, other| assert!(!is_before(own, other) && !is_before(other, own));
    even("2026-11-26T08:00:00+09:00", "2026-11-26");
    even("2026-11-26T08:00:00+09:00", "2026-11-26T23:00:00");
    even("2026-11-26T08:00:00+09:00", "2026-11-25T23:00:00Z");
    before("2026-11-26T08:00:00+09:00", "2026-11-25T23:30:00Z");
    before("2026-11-25T23:00:00-09:00", "2026-11-26");
    even("yesterday", "2026-11-26");
}

/// A blob with its posterior: a budget from a fit, and errors of the gains, of B twice and of C three times as large.
fn known(mut blob: Blob, gain_error: f64) -> Blob {
    let stage = shipped::stage();
    let parameters = FieldParameters::from_set(&blob.1, &stage).expect("of the field model");
    let noise = Noise {
        white_m: [0.5e-6; 3],
        drift: [0.0; 3],
    };
    let eta = Parameters::from_set(&blob.1).eta();
    let mut covariance = DMatrix::identity(COUNT, COUNT) * 1e-24;
    for (probe, eta) in eta.into_iter().enumerate() {
        let row = probe * PER_PROBE + ETA;
        covariance[(row, row)] = (gain_error * (1 + probe) as f64 * eta).powi(2);
    }
    let posterior = Posterior::from_covariance(covariance.clone(), &parameters, &noise);
    let service = declared_service(&stage, &parameters, noise.white_m).expect("a service");
    let predicted = Predicted::new(&service, &covariance, &[0.0; COUNT]);
    let temperature = blob.1.constants.temperature.rounded();
    let of = (&parameters, &posterior);
    blob.2 = Some(StoredPosterior {
        covariance,
        noise,
        misfit: 1.0,
        repaired: Vec::new(),
        budget: Budget::new(&stage, of, &temperature, &predicted, 100),
        up_to: None,
        marks: Vec::new(),
        certificates: Certificates::default(),
    });
    blob
}

#[test]
fn the_limit_is_the_smaller_of_the_certificates_less_its_guard_band_and_of_the_noise() {
    let blobs = [0.0, 30.0].map(|day| known(blob(day, 1.0, "S"), 1e-4));
    let mut stage = shipped::stage();
    let limit = |stage: &Stage| {
        let trend = Trend::new(&blobs, stage).expect("a trend");
        trend.drifts[0].limit.expect("a limit")
    };
    let budget = blobs[1].2.as_ref().and_then(|known| known.budget.as_ref());
    let of_noise = 1.30 * budget.expect("a budget").noise()[0];
    assert!((limit(&stage) / of_noise - 1.0).abs() < 1e-9);
    stage.certificate.limits = [Some(2.0 * of_noise); 3];
    assert!((limit(&stage) / of_noise - 1.0).abs() < 1e-9);
    stage.certificate.limits = [Some(0.9 * of_noise); 3];
    assert!((limit(&stage) / of_noise - 0.9).abs() < 1e-9);
    stage.certificate.is_guarded = true;
    let budget = budget.expect("a budget");
    let (predicted, declared) = (budget.predicted(), budget.declared()[0]);
    let guard = predicted.range[0][1].hypot(1.96 * declared) - predicted.rms[0];
    let guarded = 0.9 * of_noise - guard;
    assert!(
        (limit(&stage) / guarded - 1.0).abs() < 1e-9 && guard > 0.0,
        "{guard}"
    );
}

#[test]
fn a_change_of_a_gain_has_the_errors_of_both_calibrations() {
    let blobs = [
        known(blob(0.0, 1.0, "S"), 3e-4),
        known(blob(9.0, 0.99, "S"), 4e-4),
    ];
    let found = Trend::new(&blobs, &shipped::stage()).expect("a trend");
    for probe in 0..3 {
        assert_eq!(found.calibrations[0].gains[probe], (0.0, None));
        let error = found.calibrations[1].gains[probe].1.expect("an error");
        let both = 5e-4 * (1 + probe) as f64;
        assert!((error / both - 1.0).abs() < 0.02, "{error} {both}");
    }
    // The last calibration without its posterior is named.
    assert!(shown::warnings(&found).is_empty());
    let [first, (name, set, _)] = blobs;
    let found = Trend::new(&[first, (name, set, None)], &shipped::stage()).expect("a trend");
    assert!(shown::warnings(&found)[0].starts_with("day 9, the last blob"));
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
fn a_forced_blob_beyond_the_limit_of_the_noise_has_reached_it() {
    let mut blobs = [0.0, 30.0].map(|day| known(blob(day, 1.0, "S"), 0.05));
    let days = |blobs: &[Blob]| {
        let found = Trend::new(blobs, &shipped::stage()).expect("a trend");
        found.drifts[0].days
    };
    assert_eq!(days(&blobs), [None; 3]);
    blobs[1].1.fit.forced = true;
    assert_eq!(days(&blobs), [Some(0.0); 3]);
}

#[test]
fn a_forced_blob_is_named() {
    let mut blobs = [0.0, 30.0].map(|day| blob(day, 1.0, "S"));
    blobs[0].1.fit.forced = true;
    let found = Trend::new(&blobs, &shipped::stage()).expect("a trend");
    let warnings = shown::warnings(&found);
    assert!(
        warnings
            .iter()
            .any(|of| of.starts_with("day 0 was refused")),
        "{warnings:?}"
    );
    assert!(
        !warnings
            .iter()
            .any(|of| of.starts_with("day 30 was refused"))
    );
}

#[test]
fn a_figure_has_one_key_whatever_its_value() {
    let keys = |found: &Trend| -> Vec<Vec<String>> {
        let json = serde_json::to_value(shown::figures(found)).expect("JSON");
        let axes = json["axes"].as_array().expect("axes").iter();
        axes.map(|axis| axis.as_object().expect("an axis").keys().cloned().collect())
            .collect()
    };
    let all = [trend(&[0.0; 2]), trend(&[0.0; 6])];
    let jumped = trend(&[0.0, 0.0, 0.0, 0.0, 2e-3, 2e-3]);
    assert!(jumped.drifts[0].jump.is_some());
    let [x, y, rz] = &keys(&jumped)[..] else {
        panic!("three axes")
    };
    assert!(x.iter().any(|key| key == "drift_a_month_um") && x == y);
    assert!(rz.iter().any(|key| key == "jump_urad"));
    assert!(all.iter().all(|found| keys(found) == keys(&jumped)));
}

#[test]
fn an_interval_without_an_end_is_said_in_words() {
    let mut found = trend(&[0.0; 4]);
    let said = |found: &Trend, days: [Option<f64>; 3]| {
        let mut found = found.clone();
        found.drifts[0].days = days;
        let json = serde_json::to_string(&shown::figures(&found)).expect("JSON");
        assert!(!json.contains("no date"), "{json}");
        (shown::answer(&found), json)
    };
    let (answer, _) = said(&found, [Some(10.0), Some(5.0), Some(20.0)]);
    assert!(
        answer.ends_with("on 2026-04-11; between 2026-04-06 and 2026-04-21 (95 %)."),
        "{answer}"
    );
    let (answer, _) = said(&found, [Some(10.0), Some(5.0), None]);
    assert!(
        answer.ends_with("on 2026-04-11; not before 2026-04-06, or never (95 %)."),
        "{answer}"
    );
    let (answer, json) = said(&found, [None, Some(5.0), None]);
    let words =
        "may reach their limit of 1.00 µm from 2026-04-06 on (95 %); by the line they do not.";
    assert!(answer.ends_with(words), "{answer}");
    assert!(json.contains(r#""reached":null"#) && json.contains(r#""earliest":"2026-04-06""#));
    // The page is not marked as good, and the errors end at their limit in the chart.
    let page =
        |found: &Trend| shown::page(found, Vec::new(), Provenance::default()).expect("a page");
    found.drifts[0].days = [None, Some(5.0), None];
    assert!(page(&found).contains("verdict limited"));
    found.drifts[0].days = [None; 3];
    assert!(page(&found).contains("verdict good"));
}

#[test]
fn the_curve_of_the_errors_grows_with_the_drift_to_the_limit_and_beyond() {
    let found = trend(&[0.0; 4]);
    let day = found.drifts[0].days[0].expect("a date");
    let curve = shown::forecast(&found, 0, 90.0 + day);
    assert!(
        curve[0].0 == 90.0 && (curve[0].1 - 0.5).abs() < 1e-6,
        "{:?}",
        curve[0]
    );
    let (last, error) = curve[curve.len() - 1];
    assert!(
        (last - 90.0 - day).abs() < 1e-9 && (error - 1.0).abs() < 1e-9,
        "{last} {error}"
    );
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
