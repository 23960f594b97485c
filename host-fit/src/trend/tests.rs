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

mod line;
mod words;

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
