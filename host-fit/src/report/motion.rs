//! What a log shows of the probes in motion.

use super::figure::{Figure, Group, figure, group};
use hallstage_calibration::fit::Fit;
use hallstage_calibration::judge::in_motion::UpTo;
use serde_json::{Value, json};

/// The largest motion with good errors: rms, all axes at once, rotations at 0.25 m.
pub(super) fn valid_up_to(motion: UpTo) -> Value {
    json!({
        "acceleration_m_s2": motion.acceleration_m_s2,
        "speed_mm_s": motion.speed_m_s * 1e3,
    })
}

/// What the log shows of the probes in motion.
pub(super) fn probe_motion(fit: &Fit) -> Group {
    let motion = &fit.estimate.motion;
    let lags = motion
        .dynamics
        .probe_lag_s
        .into_iter()
        .zip(motion.probe_lag_errors_s());
    let lags = lags.map(|(value, error)| figure(value * 1e6, "us").with_error(Some(error * 1e6)));
    let added = motion.dynamics.m_per_m_s2.as_flattened().iter();
    let errors = motion.acceleration_errors();
    let added = added.zip(errors.as_flattened());
    let added =
        added.map(|(value, error)| figure(value * 1e6, "um/(m/s2)").with_error(Some(error * 1e6)));
    let correction = fit.set.motion_correction.map(|correction| {
        json!({ "acceleration_s2": correction.acceleration_s2, "velocity_s": correction.velocity_s })
    });
    group! {
        "lag" => Figure::List(lags.collect()),
        "by_acceleration" => motion.shows_acceleration.then(|| Figure::List(added.collect())),
        "correction" => json!(correction),
    }
}
