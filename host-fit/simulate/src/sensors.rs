//! From a pose to the codes of the converters and the counts of the interferometers.
//!
//! | quantity | value | source |
//! |---|---|---|
//! | Hall noise | 0.5 um rms at the designed scale | `README.md` of the given logs; residuals of fits 0.49-0.51 |
//! | capacitive noise | 12 nm rms | same; 12.8 with the converter's steps |
//! | noise of a beam | 5 nm rms | service logs against their truth |
//! | drift of X and of Y | random walk, 110 nm after 1 s, 0.31 um after 8 s | same |
//! | drift of Rz | random walk, 85 nrad after 1 s | same |
//! | error of a reset in X and Y / in Rz | 2.1 um / 1.6 urad rms | first rows of the 171 movements of three paper logs |

use super::dynamics::MotionEffects;
use super::pose::StagePose;
use super::random::Stream;
use hallstage_input::stage::{CodeScale, Stage};

/// Standard deviations of the errors of the sensors, and what motion does to the probes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SensorErrors {
    /// White noise of a Hall reading at the designed scale, m.
    pub hall_m: f64,
    /// White noise of a gap, m.
    pub gap_m: f64,
    /// White noise of a beam, m.
    pub beam_m: f64,
    /// Drift of X, Y (m) and Rz (rad) after 1 s; it grows with the square root of time.
    pub drift_per_root_s: [f64; 3],
    /// Error of a reset in X, Y (m) and Rz (rad).
    pub reset: [f64; 3],
    /// Lag, coils and arms of the probes.
    pub dynamics: MotionEffects,
}

impl SensorErrors {
    /// As in the given logs.
    pub const USUAL: Self = Self {
        hall_m: 0.5e-6,
        gap_m: 12e-9,
        beam_m: 5e-9,
        drift_per_root_s: [110e-9, 110e-9, 85e-9],
        reset: [2.1e-6, 2.1e-6, 1.6e-6],
        dynamics: MotionEffects::NONE,
    };
    /// No errors but the steps of the converters, as for a fit to an endless log.
    pub const NONE: Self = Self {
        hall_m: 0.0,
        gap_m: 0.0,
        beam_m: 0.0,
        drift_per_root_s: [0.0; 3],
        reset: [0.0; 3],
        dynamics: MotionEffects::NONE,
    };
}

/// The code of a value, limited to the converter's range.
pub fn code(value_m: f64, scale: &CodeScale) -> i32 {
    let (low, high) = (scale.window.low - 1, scale.window.high + 1);
    let code = (value_m / scale.m_per_count).round();
    // The cast saturates.
    (code as i32).clamp(low, high)
}

/// The changes of the gaps at the capacitive sensors on the framework, m: heights of the stage's plane
/// at their places.
pub fn gaps_m(stage: &Stage, pose: &StagePose) -> [f64; 3] {
    let (at, normal) = (pose.position_m(), pose.rotation().column(2).into_owned());
    stage
        .capacitive_probes_m
        .map(|[x, y]| at.z - (normal.x * (x - at.x) + normal.y * (y - at.y)) / normal.z)
}

/// The readings of the beams X, Y1, Y2 at a pose, m. Without places of the beams, the Y beams follow two points of the stage,
/// at plus and minus half their distance.
pub fn beams_m(stage: &Stage, pose: &StagePose) -> [f64; 3] {
    let interferometer = &stage.interferometer;
    if interferometer.has_places() {
        return interferometer.beams_m(pose.planar, pose.vertical);
    }
    let [x, y, rz] = pose.planar;
    let half = 0.5 * interferometer.y_baseline_m * libm::sin(rz);
    interferometer.readings_m([x, y + half, y - half])
}

/// The error of the interferometers: a random walk that starts at the error of the reset.
#[derive(Clone, Copy, Debug)]
pub struct ReferenceError {
    error: [f64; 3],
    step: [f64; 3],
}

impl ReferenceError {
    /// At the begin of a movement.
    pub fn reset(
        errors: &SensorErrors,
        is_zero_exact: bool,
        period_s: f64,
        random: &mut Stream,
    ) -> Self {
        let reset = errors.reset.map(|deviation| random.normal(deviation));
        let root = libm::sqrt(period_s);
        Self {
            error: if is_zero_exact { [0.0; 3] } else { reset },
            step: errors.drift_per_root_s.map(|drift| drift * root),
        }
    }

    /// The error in X, Y (m) and Rz (rad) now; the walk then advances by a servo period.
    pub fn next(&mut self, random: &mut Stream) -> [f64; 3] {
        let now = self.error;
        for (error, step) in self.error.iter_mut().zip(self.step) {
            *error += random.normal(step);
        }
        now
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Purpose;
    use hallstage_input::shipped::stage;

    #[test]
    fn codes_are_rounded_and_stop_at_the_rails() {
        let hall = stage().hall;
        let codes = [-1.0, -2.5e-8, 0.0, 3.2e-8, 6.25e-5, 1.0].map(|x| code(x, &hall));
        assert_eq!(codes, [-32768, 0, 0, 1, 1000, 32767]);
    }

    #[test]
    fn the_drift_after_a_movement_is_that_of_its_length() {
        let mut random = Stream::new(3, Purpose::Sensors, 0);
        let mut squares = [0.0; 3];
        let walks = 400;
        for _ in 0..walks {
            let mut walk = ReferenceError::reset(&SensorErrors::USUAL, true, 0.002, &mut random);
            assert_eq!(walk.next(&mut random), [0.0; 3]);
            let end = (1..2000).fold([0.0; 3], |_, _| walk.next(&mut random));
            (0..3).for_each(|i| squares[i] += end[i] * end[i]);
        }
        for (sum, per_root_s) in squares.iter().zip(SensorErrors::USUAL.drift_per_root_s) {
            let ratio = (sum / f64::from(walks)).sqrt() / (2.0 * per_root_s);
            assert!((0.9..1.1).contains(&ratio), "{ratio}");
        }
    }
}
