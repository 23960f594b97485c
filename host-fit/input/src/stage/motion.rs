//! Reads the optional table `[motion]`: how far the stage moves in service, and how a calibration
//! run may move it. An axis or key that it leaves out has its default.
//!
//! ```toml
//! [motion]
//! x = { service_m = 500e-6, amplitude_m = 450e-6, speed_m_per_s = 2e-3, acceleration_m_per_s2 = 0.03 }
//! y = { service_m = 800e-6, service_rms_m_per_s = 5e-3, service_rms_m_per_s2 = 0.2 }
//! rx = { service_rad = 300e-6, speed_rad_per_s = 1e-3 }
//! ```

use super::document::Document;
use super::error::StageError;
use crate::axis::{AXES, Axis};

/// How one axis moves, SI: m or rad, per s, per s2.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisMotion {
    /// Largest magnitude in service.
    pub service: f64,
    /// Speed in service, rms; by default of a sine over half the range of service at 0.3 to 2 Hz.
    pub service_speed_rms: f64,
    /// Acceleration in service, rms; by default of the same sines.
    pub service_acceleration_rms: f64,
    /// Largest magnitude in a calibration run; by default equal to `service`.
    pub amplitude: f64,
    /// Largest speed in a calibration run; infinite without a limit.
    pub speed: f64,
    /// Largest acceleration in a calibration run; infinite without a limit.
    pub acceleration: f64,
}

/// How the stage moves along X, Y, Rz, Z, Rx, Ry.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    /// The axes.
    pub axes: [AxisMotion; 6],
}

/// Default range in service by axis, m or rad: the range of the given logs.
const SERVICE: [f64; 6] = [500e-6, 800e-6, 500e-6, 240e-6, 480e-6, 480e-6];

/// Default rms speed (1/s) and rms acceleration (1/s2) over range of service, of sines over half the
/// range, all frequencies f from 0.3 to 2 Hz equally likely, 2 pi f / sqrt(8) and (2 pi f)^2 / sqrt(8). The
/// given logs of service have 2.73 and 26.6.
const SERVICE_RMS: [f64; 2] = [2.8, 27.0];
/// Ranges that make sense, m or rad: beyond the larger one no small angle is small.
const RANGES: (f64, f64) = (1e-7, 1e-2);
/// Speeds and accelerations that make sense, SI.
const RATES: (f64, f64) = (1e-7, 1e3);

impl AxisMotion {
    /// The defaults of an axis that moves this far in service.
    const fn within(service: f64) -> Self {
        Self {
            service,
            service_speed_rms: SERVICE_RMS[0] * service,
            service_acceleration_rms: SERVICE_RMS[1] * service,
            amplitude: service,
            speed: f64::INFINITY,
            acceleration: f64::INFINITY,
        }
    }
}

impl Default for Motion {
    fn default() -> Self {
        Self {
            axes: SERVICE.map(AxisMotion::within),
        }
    }
}

/// The motion that the table describes.
pub(super) fn motion(document: &Document<'_>) -> Result<Motion, StageError> {
    let mut motion = Motion::default();
    for (motion, Axis { key, unit, .. }) in motion.axes.iter_mut().zip(AXES) {
        let table = format!("motion.{key}");
        let or = |key: &str, derivative: usize, default: f64, range| -> Result<f64, StageError> {
            let name = format!("{key}_{unit}{}", ["", "_per_s", "_per_s2"][derivative]);
            let unit = format!("{unit}{}", ["", "/s", "/s2"][derivative]);
            let given = document.number(&table, &name, range, &unit)?;
            Ok(given.unwrap_or(default))
        };
        *motion = AxisMotion::within(or("service", 0, motion.service, RANGES)?);
        let rms = (0.0, RATES.1);
        motion.service_speed_rms = or("service_rms", 1, motion.service_speed_rms, rms)?;
        motion.service_acceleration_rms =
            or("service_rms", 2, motion.service_acceleration_rms, rms)?;
        // An axis may stand still in a run; the plan predicts what that costs.
        motion.amplitude = or("amplitude", 0, motion.amplitude, (0.0, RANGES.1))?;
        motion.speed = or("speed", 1, motion.speed, RATES)?;
        motion.acceleration = or("acceleration", 2, motion.acceleration, RATES)?;
    }
    Ok(motion)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stage::Stage;
    use crate::stage::tests::SOUND;

    fn parse(motion: &str) -> Result<Motion, String> {
        let text = format!("{SOUND}[motion]\n{motion}");
        let stage = Stage::from_toml(&text, "stage.toml".as_ref());
        stage.map(|s| s.motion).map_err(|e| e.to_string())
    }

    #[test]
    fn what_the_table_leaves_out_has_its_default() {
        let without = Stage::from_toml(SOUND, "stage.toml".as_ref()).expect("sound");
        assert_eq!(without.motion, Motion::default());
        let motion = parse(
            "x = { service_m = 1e-3, acceleration_m_per_s2 = 0.5 }\n\
             ry = { amplitude_rad = 0.0, service_rms_rad_per_s2 = 0.7 }\n",
        )
        .expect("sound");
        let default = Motion::default();
        assert_eq!(motion.axes[1..5], default.axes[1..5]);
        let x = &motion.axes[0];
        assert_eq!((x.amplitude, x.acceleration), (1e-3, 0.5));
        assert_eq!(x.speed, f64::INFINITY);
        assert!((x.service_speed_rms - 2.0 * default.axes[0].service_speed_rms).abs() < 1e-12);
        let ry = &motion.axes[5];
        assert_eq!((ry.service, ry.amplitude), (480e-6, 0.0));
        let speed_rms = default.axes[5].service_speed_rms;
        let rms = (ry.service_speed_rms, ry.service_acceleration_rms);
        assert_eq!(rms, (speed_rms, 0.7));
    }

    #[test]
    fn what_is_wrong_with_it_is_named_with_its_place() {
        #[rustfmt::skip]
        let cases = [
            ("rotation = 3", 1, "rotation", "expected one of rx, ry"),
            ("z = 3", 5, "z", ""),
            ("z = { amplitude_rad = 1e-4 }", 7, "z.amplitude_rad", "did you mean `amplitude_m`?"),
            ("rx = { speed_rad_per_s = \"fast\" }", 26, "rx.speed_rad_per_s", ""),
            ("y = { service_m = 0.8 }", 19, "y.service_m", "0.8 m is outside"),
            ("y = { service_m = 0.0 }", 19, "y.service_m", "0 m is outside"),
            ("y = { amplitude_m = -1e-4 }", 21, "y.amplitude_m", "-0.0001 m is outside"),
            ("y = { speed_m_per_s = nan }", 23, "y.speed_m_per_s", "NaN m/s is outside"),
        ];
        for (motion, column, key, says) in cases {
            let place = format!("41:{column}: `motion.{key}`: ");
            let message = parse(motion).expect_err(motion);
            assert!(
                message.contains(&place) && message.contains(says),
                "{message}"
            );
        }
    }
}
