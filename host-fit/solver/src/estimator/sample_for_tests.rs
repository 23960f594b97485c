//! A stage and its logs for tests, made by the field model itself.

use super::parameters::FieldParameters;
use super::probe::probes;
use super::terms::{PER_PROBE, SHAPES, TERMS};
use hallstage_input::dataset::{Dataset, LoggedFrame, Movement, Row};
pub(super) use hallstage_input::shipped::stage;
use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};
use runtime::RawFrame;
use std::f64::consts::TAU;

/// The scale of the Hall codes of the shipped stage, m.
pub(super) const M_PER_CODE: f64 = 6.25e-8;

/// Parameters as a fit finds them: the terms of p a third of their priors' deviations.
pub(super) fn parameters() -> FieldParameters {
    let probe = |model_31: [f64; 6], e: [f64; 3], sign: f64| {
        let mut values = [0.0; PER_PROBE];
        values[..6].copy_from_slice(&model_31);
        values[6..9].copy_from_slice(&e);
        for (k, term) in TERMS.iter().enumerate().skip(SHAPES) {
            let sign = if k % 2 == 0 { sign } else { -sign };
            values[k] = sign * term.prior.expect("a prior") / 3.0;
        }
        values
    };
    FieldParameters {
        gain_per_k: [[0.0; 2]; 3],
        probes: [
            probe(
                [0.2, 0.01, 0.87, -190.0, -70.0, 30.0],
                [0.03, 0.02, -0.01],
                1.0,
            ),
            probe(
                [-0.2, -0.02, 0.7, -160.0, -57.0, -30.0],
                [-0.05, 0.01, 0.01],
                -1.0,
            ),
            probe(
                [-0.35, 0.03, 0.86, -180.0, -63.0, 33.0],
                [0.04, -0.02, 0.01],
                1.0,
            ),
        ],
        places: stage().places_m(),
    }
}

/// How a log is made.
#[derive(Clone, Copy, Debug)]
pub(super) struct Run {
    /// Movements, each with a reset of the reference.
    pub(super) movements: usize,
    /// Length of each, s.
    pub(super) seconds: f64,
    /// White noise of the probes, m.
    pub(super) white_m: f64,
    /// Walk of the reference in X, Y (m) and Rz (rad) in a second.
    pub(super) drift: [f64; 3],
    /// Lag of the reference, rows.
    pub(super) lag_rows: usize,
    /// Whether Z, Rx, Ry stand still in each movement, at other places in each.
    pub(super) still: bool,
    /// Seed of the noise.
    pub(super) seed: u64,
}

impl Run {
    /// The designed run of 8 s, with the noise of the simulated stages.
    pub(super) const EIGHT_SECONDS: Self = Self {
        movements: 1,
        seconds: 8.0,
        white_m: 0.5e-6,
        drift: [0.1e-6, 0.1e-6, 0.05e-6],
        lag_rows: 0,
        still: false,
        seed: 1,
    };

    /// The log.
    pub(super) fn dataset(&self, truth: &FieldParameters) -> Dataset {
        const PERIOD_S: f64 = 0.002;
        let mut random = ChaCha8Rng::seed_from_u64(self.seed);
        let probes = probes(truth);
        let count = (self.seconds / PERIOD_S).round() as usize;
        let mut dataset = Dataset::default();
        for movement in 0..self.movements {
            let mut error = [0; 3].map(|_| 5e-6 * normal(&mut random));
            let at = |row: usize| pose(row as f64 * PERIOD_S, self.seconds, movement);
            for row in 0..count {
                let (planar, mut vertical) = at(row);
                if self.still {
                    vertical = at(count / 7 * (movement % 7)).1;
                }
                let seen = at(row.saturating_sub(self.lag_rows)).0;
                let signal_m = [0, 1, 2].map(|k| {
                    let read = probes[k].signal_m(planar, vertical);
                    read + self.white_m * normal(&mut random)
                });
                for (error, drift) in error.iter_mut().zip(self.drift) {
                    *error += drift * PERIOD_S.sqrt() * normal(&mut random);
                }
                dataset.rows.push(Row {
                    movement,
                    t_us: (row as f64 * PERIOD_S * 1e6).round() as i64,
                    frame: LoggedFrame::from(RawFrame::new([0; 3], [0; 3], 0, 0)),
                    signal_m,
                    vertical,
                    reference: [0, 1, 2].map(|k| seen[k] + error[k]),
                });
            }
            dataset.movements.push(Movement {
                log: 0,
                index: movement as i64,
                rows: movement * count..(movement + 1) * count,
            });
        }
        dataset.end_log("made");
        dataset
    }
}

/// X, Y, Rz and Z, Rx, Ry of the designed run: six sines of different frequency with tapers of
/// half a second.
fn pose(t_s: f64, seconds: f64, movement: usize) -> ([f64; 3], [f64; 3]) {
    const AMPLITUDES: [f64; 6] = [500e-6, 500e-6, 300e-6, 250e-6, 500e-6, 500e-6];
    const CYCLES: [f64; 6] = [5.0, 8.0, 7.0, 6.0, 4.0, 7.5];
    let end = (t_s.min(seconds - t_s) / 0.5).clamp(0.0, 1.0);
    let taper = end * end * (3.0 - 2.0 * end);
    let q: [f64; 6] = std::array::from_fn(|k| {
        let phase = TAU * CYCLES[k] * t_s / 8.0 + 1.7 * (k + movement) as f64;
        AMPLITUDES[k] * taper * phase.sin()
    });
    ([q[0], q[1], q[2]], [q[3], q[4], q[5]])
}

/// Nearly a normal number of variance one.
fn normal(random: &mut ChaCha8Rng) -> f64 {
    (0..12).map(|_| random.random::<f64>()).sum::<f64>() - 6.0
}
