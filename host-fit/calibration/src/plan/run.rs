//! A planned run: one movement, a sine for each axis between smooth ends.
//!
//! q_k = A_k w(t) sin(2 pi n_k t / T + 1.7 k), k = 0 .. 5 for X, Y, Rz, Z, Rx, Ry. The taper w rises as
//! 10 x^3 - 15 x^4 + 6 x^5 and falls likewise. Pose, speed and acceleration are zero at both ends and
//! never jump.

use hallstage_simulate::pose::StagePose;
use hallstage_simulate::protocol::Trajectory;
use std::f64::consts::TAU;

/// Phase from one axis to the next, rad.
const PHASE_STEP_RAD: f64 = 1.7;
/// Samples of speed and acceleration in each taper.
const SAMPLES: usize = 50;

/// A run of six axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlannedRun {
    /// Length T, s.
    pub seconds: f64,
    /// Length of each end, s.
    pub taper_s: f64,
    /// Amplitudes A, m or rad.
    pub amplitudes: [f64; 6],
    /// Cycles n in the length T.
    pub cycles: [f64; 6],
}

impl PlannedRun {
    /// Frequency of an axis, Hz.
    pub fn frequency_hz(&self, axis: usize) -> f64 {
        self.cycles[axis] / self.seconds
    }

    /// Position, speed and acceleration of an axis at a time in s: m or rad, per s, per s2. All are zero
    /// before and after the run.
    pub fn axis_at(&self, axis: usize, t_s: f64) -> [f64; 3] {
        let rate = TAU * self.frequency_hz(axis);
        let (sin, cos) = libm::sincos(rate * t_s + PHASE_STEP_RAD * axis as f64);
        let to_end_s = self.seconds - t_s;
        let (from_end_s, direction) = if t_s <= to_end_s {
            (t_s, 1.0)
        } else {
            (to_end_s, -1.0)
        };
        let x = (from_end_s / self.taper_s).clamp(0.0, 1.0);
        let slope = direction / self.taper_s;
        let w = x * x * x * (10.0 - x * (15.0 - 6.0 * x));
        // Derivatives of w by x, then by time.
        let (dw, d2w) = (
            30.0 * (x * (1.0 - x)) * (x * (1.0 - x)),
            60.0 * x * (1.0 - x) * (1.0 - 2.0 * x),
        );
        let (w1, w2) = (dw * slope, d2w * slope * slope);
        let unit = [
            w * sin,
            w1 * sin + w * rate * cos,
            (w2 - w * rate * rate) * sin + 2.0 * w1 * rate * cos,
        ];
        unit.map(|value| self.amplitudes[axis] * value)
    }

    /// Largest speed and acceleration of an axis: m or rad, per s, per s2.
    pub fn peaks(&self, axis: usize) -> [f64; 2] {
        let rate = TAU * self.frequency_hz(axis);
        let speed = self.amplitudes[axis] * rate;
        let mut peaks = [speed, speed * rate];
        for k in 0..=SAMPLES {
            let from_end_s = self.taper_s * k as f64 / SAMPLES as f64;
            for t_s in [from_end_s, self.seconds - from_end_s] {
                let [_, speed, acceleration] = self.axis_at(axis, t_s);
                peaks = [peaks[0].max(speed.abs()), peaks[1].max(acceleration.abs())];
            }
        }
        peaks
    }

    /// Number of rows at a period in s, from rest to rest, both included.
    pub fn rows(&self, period_s: f64) -> usize {
        (self.seconds / period_s).ceil() as usize + 1
    }

    /// The pose at a time in s.
    pub fn pose_at(&self, t_s: f64) -> StagePose {
        StagePose::from_array(std::array::from_fn(|axis| self.axis_at(axis, t_s)[0]))
    }

    /// The pose of every period, from rest to rest.
    pub fn trajectory(&self, period_s: f64) -> Trajectory {
        let times = (0..self.rows(period_s)).map(|k| k as f64 * period_s);
        times.map(|t_s| self.pose_at(t_s)).collect()
    }
}
