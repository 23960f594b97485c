//! A planned run: one movement, a slow and a fast sine for each axis between smooth ends.
//!
//! q_k = w(t) [(A_k - B_k) sin(2 pi n_k t / T + 1.7 k) + B_k sin(2 pi f_k t + 1.7 (5 - k))], k = 0 .. 5 for X, Y,
//! Rz, Z, Rx, Ry. The taper w rises as 10 x^3 - 15 x^4 + 6 x^5 and falls likewise. Pose, speed and acceleration
//! are zero at both ends and never jump.
//!
//! With one sine the acceleration is proportional to the position, and errors that follow it hide in the
//! gains. The fast tones separate them; their frequencies f differ, so that the axes do not hide in each other.

use hallstage_input::stage::Motion;
use hallstage_simulate::pose::StagePose;
use hallstage_simulate::protocol::Trajectory;
use std::f64::consts::TAU;

/// Phase from one axis to the next, rad.
const PHASE_STEP_RAD: f64 = 1.7;
/// Samples of speed and acceleration in each taper.
const SAMPLES: usize = 100;
/// Frequencies f of the fast tones, Hz.
pub const TONES_HZ: [f64; 6] = [7.3, 8.1, 9.2, 6.1, 7.7, 8.7];
/// Amplitudes of the fast tones over the amplitudes, in a run of [`TONES_AT_S`].
const TONES: [f64; 6] = [0.08, 0.05, 0.24, 0.125, 0.21, 0.21];
const TONES_AT_S: f64 = 30.0;
/// Most that the tones of a shorter run are enlarged by, so that it determines as much.
const TONES_MAX: f64 = 2.0;

/// A run of six axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlannedRun {
    /// Length T, s.
    pub seconds: f64,
    /// Length of each end, s.
    pub taper_s: f64,
    /// Amplitudes A, m or rad.
    pub amplitudes: [f64; 6],
    /// Cycles n of the slow sines in the length T.
    pub cycles: [f64; 6],
    /// Amplitudes B of the fast tones, m or rad: a part of A.
    pub tones: [f64; 6],
}

/// A sine of amplitude 1.
#[derive(Clone, Copy, Debug)]
struct Sine {
    rate: f64,
    phase_rad: f64,
}

impl PlannedRun {
    /// Frequency of the slow sine of an axis, Hz.
    pub fn frequency_hz(&self, axis: usize) -> f64 {
        self.cycles[axis] / self.seconds
    }

    /// The run with the largest fast tones, up to the usual ones, that keep speed and acceleration within the limits.
    #[must_use]
    pub fn with_tones(mut self, motion: &Motion) -> Self {
        let longer = (TONES_AT_S / self.seconds).sqrt().min(TONES_MAX);
        for (axis, limits) in motion.axes.iter().enumerate() {
            let amplitude = self.amplitudes[axis];
            let [slow, fast] = self.sines(axis).map(|(_, sine)| self.unit_peaks(sine));
            let limits = [limits.speed, limits.acceleration];
            let room = |k: usize| (limits[k] - amplitude * slow[k]) / (fast[k] - slow[k]);
            let most = TONES[axis] * longer * amplitude;
            self.tones[axis] = most.min(room(0)).min(room(1)).max(0.0);
        }
        self
    }

    /// The slow and the fast sine of an axis, with their amplitudes.
    fn sines(&self, axis: usize) -> [(f64, Sine); 2] {
        let sine = |hz: f64, step: usize| Sine {
            rate: TAU * hz,
            phase_rad: PHASE_STEP_RAD * step as f64,
        };
        let tone = self.tones[axis];
        [
            (
                self.amplitudes[axis] - tone,
                sine(self.frequency_hz(axis), axis),
            ),
            (tone, sine(TONES_HZ[axis], 5 - axis)),
        ]
    }

    /// Position, speed and acceleration of an axis at a time in s: m or rad, per s, per s2. All are zero
    /// before and after the run.
    pub fn axis_at(&self, axis: usize, t_s: f64) -> [f64; 3] {
        let [(slow, a), (fast, b)] = self.sines(axis);
        let (a, b) = (self.unit_at(a, t_s), self.unit_at(b, t_s));
        std::array::from_fn(|k| slow * a[k] + fast * b[k])
    }

    /// The same of one sine.
    fn unit_at(&self, Sine { rate, phase_rad }: Sine, t_s: f64) -> [f64; 3] {
        let (sin, cos) = libm::sincos(rate * t_s + phase_rad);
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
        [
            w * sin,
            w1 * sin + w * rate * cos,
            (w2 - w * rate * rate) * sin + 2.0 * w1 * rate * cos,
        ]
    }

    /// Largest speed and acceleration of an axis: m or rad, per s, per s2.
    pub fn peaks(&self, axis: usize) -> [f64; 2] {
        let [(slow, a), (fast, b)] = self.sines(axis);
        let (slow, fast) = (slow * a.rate, fast * b.rate);
        let between = [slow + fast, slow * a.rate + fast * b.rate];
        self.with_ends(between, |t_s| self.axis_at(axis, t_s))
    }

    fn unit_peaks(&self, sine: Sine) -> [f64; 2] {
        self.with_ends([sine.rate, sine.rate * sine.rate], |t_s| {
            self.unit_at(sine, t_s)
        })
    }

    /// Largest speed and acceleration, from those between the ends and the motion.
    fn with_ends(&self, mut peaks: [f64; 2], at: impl Fn(f64) -> [f64; 3]) -> [f64; 2] {
        for k in 0..=SAMPLES {
            let from_end_s = self.taper_s * k as f64 / SAMPLES as f64;
            for t_s in [from_end_s, self.seconds - from_end_s] {
                let [_, speed, acceleration] = at(t_s);
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
