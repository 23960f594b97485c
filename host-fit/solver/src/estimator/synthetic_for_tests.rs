//! Logs made from Model (31) itself, by the paper's protocol: for tests, where the true parameters must
//! be known.

use crate::estimator::paper::Parameters;
use hallstage_input::dataset::{Dataset, LoggedFrame, Movement, Row};
use hallstage_input::stage::Stage;
use hallstage_simulate::protocol::TABLE_6;
use rand::rngs::ChaCha8Rng;
use rand::{Rng, RngExt, SeedableRng};
use runtime::capacitive::gaps_m;
use runtime::model::probe_displacement_m;
use runtime::{PlanarPose, RawFrame, VerticalPose};
use std::f64::consts::TAU;

/// Amplitudes of the sines along X (m), Y (m), Rz (rad), made in the order Y, X, Rz.
const AMPLITUDES: [f64; 3] = [300e-6, 500e-6, 300e-6];

/// How a log is made.
#[derive(Clone, Debug, PartialEq)]
pub struct Protocol {
    /// The true parameters.
    pub truth: Parameters,
    /// Vertical settings: um, urad, urad.
    pub settings: Vec<[f64; 3]>,
    /// Rows of each movement; a movement is one period of a sine along one axis.
    pub rows_per_movement: usize,
    /// Standard deviation of the noise of each Hall reading, m.
    pub hall_noise_m: f64,
    /// Zero deviations are drawn evenly within plus and minus this, m at each probe.
    pub zero_deviation_m: f64,
    /// Seed of noise and zero deviations.
    pub seed: u64,
}

impl Protocol {
    /// The paper's protocol without noise and zero deviations.
    pub fn exact(truth: Parameters, rows_per_movement: usize) -> Self {
        Self {
            truth,
            settings: TABLE_6.to_vec(),
            rows_per_movement,
            hall_noise_m: 0.0,
            zero_deviation_m: 0.0,
            seed: 1,
        }
    }

    /// The log, as the fit sees it: signals are not rounded to codes, while the frames are.
    pub fn dataset(&self, stage: &Stage) -> Dataset {
        let mut random = ChaCha8Rng::seed_from_u64(self.seed);
        let plane = self.truth.geometry().plane();
        let mut dataset = Dataset::default();
        for (setting, axis) in self
            .settings
            .iter()
            .flat_map(|s| [1, 0, 2].map(|axis| (s, axis)))
        {
            let vertical = VerticalPose::from_array(setting.map(|x| x * 1e-6));
            let delta =
                [(); 3].map(|()| (random.random::<f64>() * 2.0 - 1.0) * self.zero_deviation_m);
            let start = dataset.rows.len();
            for k in 0..self.rows_per_movement {
                let mut reference = [0.0; 3];
                let phase = TAU * k as f64 / self.rows_per_movement as f64;
                reference[axis] = AMPLITUDES[axis] * phase.sin();
                let mut signal_m = probe_displacement_m(
                    &plane,
                    &self.truth.sensitivity(),
                    &PlanarPose::from_array(reference),
                    &vertical,
                    delta,
                );
                for s in &mut signal_m {
                    *s += self.hall_noise_m * normal(&mut random);
                }
                let gaps = gaps_m(&stage.capacitive_probes_m, &vertical);
                let code = |x: f64, m_per_count: f64| (x / m_per_count).round() as i32;
                dataset.rows.push(Row {
                    movement: dataset.movements.len(),
                    t_us: (k as f64 * stage.servo_period_s * 1e6).round() as i64,
                    frame: LoggedFrame::from(RawFrame::new(
                        signal_m.map(|s| code(s, stage.hall.m_per_count)),
                        gaps.map(|g| code(g, stage.capacitive.m_per_count)),
                        k as u32,
                        (k as f64 * stage.servo_period_s * 1e6).round() as u32,
                    )),
                    signal_m,
                    vertical: vertical.to_array(),
                    reference,
                });
            }
            let index = dataset.movements.len() as i64;
            dataset.movements.push(Movement {
                log: 0,
                index,
                rows: start..dataset.rows.len(),
            });
        }
        dataset.end_log("synthetic");
        dataset
    }
}

/// A normal number of variance one (Box and Muller).
fn normal(random: &mut impl Rng) -> f64 {
    let radius = (-2.0 * (1.0 - random.random::<f64>()).ln()).sqrt();
    radius * (TAU * random.random::<f64>()).cos()
}
