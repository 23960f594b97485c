//! The errors that speed and acceleration add in service, and the largest motion with good errors.

use super::predicted::Predicted;
use super::verdict::GOOD_MAX;
use hallstage_input::finding::{Finding, Kind};
use hallstage_input::stage::Stage;
use hallstage_solver::estimator::dynamics::{ARM_M, MotionFit, ServiceMotion};
use hallstage_solver::estimator::parameters::FieldParameters;
use nalgebra::Matrix3;
use serde::{Deserialize, Serialize};

/// The errors in the motion that `[motion]` declares for service, and the largest motion with good errors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InMotion {
    /// Variances that motion adds to X, Y, Rz, by the effects that the log determines: m2, m2, rad2.
    pub added: [f64; 3],
    /// The worst axis over the noise floor, with what the log does not show as large as is usual.
    pub ratio: f64,
    /// The worst axis over the noise floor with the correction by commanded speed and acceleration.
    pub corrected_ratio: f64,
    /// The largest motion with good errors.
    pub up_to: UpTo,
    /// What the log shows.
    pub fit: MotionFit,
}

/// The largest motion with good errors, rms, all axes at once, with rotations at [`ARM_M`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct UpTo {
    /// Acceleration, m/s2.
    pub acceleration_m_s2: f64,
    /// Speed, m/s.
    pub speed_m_s: f64,
    /// Whether the log shows the effect of acceleration.
    pub shows_acceleration: bool,
}

/// The motion that `[motion]` declares for service.
fn declared(stage: &Stage) -> ServiceMotion {
    let [x, y, rz, ..] = stage.motion.axes;
    ServiceMotion {
        speed: [x, y, rz].map(|axis| axis.service_speed_rms),
        acceleration: stage.motion.axes.map(|axis| axis.service_acceleration_rms),
    }
}

/// Variances that these lags of A, B, C add to X, Y, Rz in service: m2, m2, rad2.
pub fn by_lags(lags_s: [f64; 3], parameters: &FieldParameters, stage: &Stage) -> Option<[f64; 3]> {
    let exact = MotionFit {
        probe_lag_covariance: Matrix3::zeros(),
        ..MotionFit::unknown().without_prior()
    };
    let late = exact.with_other_lags(lags_s);
    late.variance(parameters, &declared(stage), false)
}

impl InMotion {
    /// For a fit with these errors at rest; `None` where the probes do not determine a pose.
    pub fn new(
        fit: &MotionFit,
        parameters: &FieldParameters,
        stage: &Stage,
        at_rest: &Predicted,
    ) -> Option<Self> {
        let declared = declared(stage);
        let per_arm = 1.0 / ARM_M;
        let all = [1.0, 1.0, per_arm, 1.0, per_arm, per_arm];
        let variance = |speed, acceleration| {
            let motion = ServiceMotion {
                speed,
                acceleration,
            };
            fit.variance(parameters, &motion, false)
        };
        let corrected = fit.variance(parameters, &declared, true)?;
        // The variance grows with the square of the motion.
        let good_up_to = |per_unit: [f64; 3]| {
            let axis = |k: usize| {
                let noise = at_rest.noise(k);
                let room = GOOD_MAX * GOOD_MAX - at_rest.ratio[k] * at_rest.ratio[k];
                (room.max(0.0) * noise * noise / per_unit[k]).sqrt()
            };
            axis(0).min(axis(1)).min(axis(2))
        };
        Some(Self {
            added: (fit.without_prior()).variance(parameters, &declared, false)?,
            ratio: (at_rest.with_added(fit.variance(parameters, &declared, false)?)).worst_ratio(),
            corrected_ratio: at_rest.with_added(corrected).worst_ratio(),
            up_to: UpTo {
                acceleration_m_s2: good_up_to(variance([0.0; 3], all)?),
                speed_m_s: good_up_to(variance([1.0, 1.0, per_arm], [0.0; 6])?),
                shows_acceleration: fit.shows_acceleration,
            },
            fit: *fit,
        })
    }

    /// Where motion makes a good calibration one that is not: the finding.
    pub fn finding(&self, at_rest: &Predicted) -> Option<Finding> {
        let ratio = self.ratio;
        let is_felt = ratio > GOOD_MAX && ratio > 1.01 * at_rest.worst_ratio();
        let kind = Kind::InMotion {
            ratio,
            corrected_ratio: self.corrected_ratio,
            acceleration_m_s2: self.up_to.acceleration_m_s2,
            speed_mm_s: self.up_to.speed_m_s * 1e3,
            shows_acceleration: self.up_to.shows_acceleration,
            lag_us: self.fit.lags_behind_middle_s().map(|lag_s| lag_s * 1e6),
        };
        is_felt.then(|| Finding::new(kind).with_cost(ratio))
    }
}

#[cfg(test)]
#[path = "in_motion_tests.rs"]
mod tests;
