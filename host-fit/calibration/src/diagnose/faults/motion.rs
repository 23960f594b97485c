//! Errors of channels that follow the motion, in a log and in service.

use super::effects::Sensed;
use crate::judge::predicted::service_range;
use hallstage_input::stage::Stage;
use hallstage_solver::estimator::dynamics::ARMS_M;
use hallstage_solver::estimator::parameters::FieldParameters;
use hallstage_solver::estimator::probe::probes;
use hallstage_solver::estimator::rows::FieldRow;
use hallstage_solver::estimator::service::{Service, service_poses};
use nalgebra::Vector3;

/// A turning error changes its sign while the speed of the channel is below this part of its rms speed.
const KNEE: f64 = 0.05;

/// What an error of a channel follows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Follows {
    /// Its own speed: the channel is late by 1 ms.
    OwnSpeed,
    /// The speed of an axis: 1 um per mm/s, at an arm of 1 m.
    Speed(usize),
    /// The acceleration of an axis: 1 mm per m/s2.
    Acceleration(usize),
    /// The sign of its own speed, 1 um: hysteresis.
    Turning,
    /// A power of its value, mm.
    Power(i32),
    /// The magnitude of its value: a gain that differs between the sides.
    Side,
    /// Z, Rx, Ry, 1 um per mm and mrad: a gain, or crosstalk between gaps.
    Height(usize),
}

impl Follows {
    /// The shapes of an error of one of the nine channels. The lag of a Hall probe and the effect of acceleration on it are
    /// unknowns of the fit; a slow beam has an error that follows acceleration, too.
    pub(super) fn of_channel(channel: usize) -> Vec<Self> {
        let form = [Self::Power(2), Self::Power(3), Self::Side].into_iter();
        let speeds = (0..6).map(Self::Speed).chain([Self::Turning]);
        match channel {
            0..3 => speeds.chain(form).collect(),
            3..6 => (speeds.chain([Self::OwnSpeed]))
                .chain((0..6).map(Self::Acceleration))
                .collect(),
            _ => (speeds.chain([Self::OwnSpeed]).chain(form))
                .chain((0..3).map(Self::Height))
                .collect(),
        }
    }

    /// Whether it is the form of a sensor's characteristic, which does not change.
    pub(super) const fn is_form(self) -> bool {
        matches!(
            self,
            Self::Turning | Self::Power(_) | Self::Side | Self::Height(_)
        )
    }
}

/// Rows with the values of the channels, their rates, and the effect of their errors on the signals.
pub(super) struct Moving<'a> {
    rows: &'a [FieldRow],
    pub(super) sensed: &'a Sensed,
    rates: Vec<[f64; 9]>,
    rms_rate: [f64; 9],
}

impl<'a> Moving<'a> {
    pub(super) fn new(
        rows: &'a [FieldRow],
        sensed: &'a Sensed,
        stage: &Stage,
        parameters: &FieldParameters,
        lag_s: f64,
    ) -> Self {
        const STEP_S: f64 = 1e-3;
        let moved = |row: &FieldRow| FieldRow {
            reference: [0, 1, 2].map(|k| row.reference[k] + STEP_S * row.rate[k]),
            vertical: [0, 1, 2].map(|k| row.vertical[k] + STEP_S * row.rate[3 + k]),
            ..*row
        };
        let later: Vec<FieldRow> = rows.iter().map(moved).collect();
        let later = Sensed::values(&later, stage, &probes(parameters), lag_s);
        let rate = |(after, before): (&[f64; 9], &[f64; 9])| {
            std::array::from_fn(|k| (after[k] - before[k]) / STEP_S)
        };
        let rates: Vec<[f64; 9]> = later.iter().zip(&sensed.values).map(rate).collect();
        let rms = |k: usize| {
            let squares: f64 = rates.iter().map(|rate| rate[k] * rate[k]).sum();
            (squares / rates.len().max(1) as f64).sqrt()
        };
        Self {
            rms_rate: std::array::from_fn(rms),
            rows,
            sensed,
            rates,
        }
    }

    /// The change of the signals by a unit of an error, m.
    pub(super) fn signals(&self, at: usize, channel: usize, follows: Follows) -> Vector3<f64> {
        let (row, value, rate) = (
            &self.rows[at],
            self.sensed.values[at][channel],
            self.rates[at][channel],
        );
        let error_m = match follows {
            Follows::OwnSpeed => -1e-3 * rate,
            Follows::Speed(axis) => 1e-3 * row.rate[axis],
            Follows::Acceleration(axis) => 1e-3 * row.acceleration_m_s2[axis],
            Follows::Turning => 1e-6 * rate / rate.hypot(KNEE * self.rms_rate[channel]).max(1e-12),
            Follows::Power(power) => 1e-3 * (1e3 * value).powi(power),
            Follows::Side => value.abs(),
            Follows::Height(axis) => 1e-3 * row.vertical[axis],
        };
        self.sensed.by_channel[at][channel] * error_m
    }
}

/// The motion that `[motion]` declares for service, as rows that do not follow each other.
pub(super) struct AtWork {
    rows: Vec<FieldRow>,
    sensed: Sensed,
}

impl AtWork {
    pub(super) fn new(stage: &Stage, parameters: &FieldParameters) -> Self {
        let rows: Vec<FieldRow> = service_poses(service_range(stage))
            .enumerate()
            .map(|(at, pose)| service_row(stage, at, pose))
            .collect();
        Self {
            sensed: Sensed::new(&rows, stage, &probes(parameters), 0.0),
            rows,
        }
    }

    /// Mean squares of the errors of X, Y, Rz (m2, m2, rad2) by an error of the parameters and by errors of channels that
    /// follow the motion. The stage is zeroed before service.
    pub(super) fn squares(
        &self,
        (stage, declared): (&Stage, &Service),
        parameters: &FieldParameters,
        off: &[f64],
        errors: &[(usize, Follows, f64)],
    ) -> [f64; 3] {
        let moving = Moving::new(&self.rows, &self.sensed, stage, parameters, 0.0);
        let pose_errors = declared.poses.iter().enumerate().map(|(at, pose)| {
            let signals = errors
                .iter()
                .map(|&(channel, follows, size)| moving.signals(at, channel, follows) * size)
                .sum::<Vector3<f64>>();
            Vector3::from_fn(|axis, _| {
                let by_parameters = pose.by_parameter[axis].iter().zip(off);
                let by_signals = pose.by_signal[axis].iter().zip(&signals);
                by_parameters.chain(by_signals).map(|(by, x)| by * x).sum()
            })
        });
        let (mut sum, mut squares) = (Vector3::zeros(), Vector3::zeros());
        for error in pose_errors {
            sum += error;
            squares += error.component_mul(&error);
        }
        let share = 1.0 / self.rows.len() as f64;
        let mean = sum * share;
        (squares * share - mean.component_mul(&mean)).into()
    }
}

/// A pose (m, rad) with a speed and an acceleration. The acceleration of a motion about a middle goes against the pose.
fn service_row(stage: &Stage, at: usize, (planar, vertical): ([f64; 3], [f64; 3])) -> FieldRow {
    let pose: [f64; 6] = std::array::from_fn(|k| if k < 3 { planar[k] } else { vertical[k - 3] });
    // Evenly spread in as many dimensions as there are square roots of primes, with a variance of one.
    let spread = |dimension: usize| {
        const PRIMES: [f64; 12] = [2., 3., 5., 7., 11., 13., 17., 19., 23., 29., 31., 37.];
        let place = ((at + 1) as f64 * PRIMES[dimension].sqrt()).fract();
        12f64.sqrt() * (place - 0.5)
    };
    let axes = &stage.motion.axes;
    let speed: [f64; 6] = std::array::from_fn(|k| axes[k].service_speed_rms * spread(k));
    let acceleration: [f64; 6] = std::array::from_fn(|k| {
        let rms = 0.5 * axes[k].service;
        let against = (axes[k].service_speed_rms / rms).powi(2);
        let rest = axes[k].service_acceleration_rms.powi(2) - (against * rms).powi(2);
        ARMS_M[k] * (rest.max(0.0).sqrt() * spread(6 + k) - against * pose[k])
    });
    FieldRow {
        time_s: 0.0,
        signal_m: [0.0; 3],
        vertical,
        reference: planar,
        rate: speed,
        acceleration_m_s2: acceleration,
        temperature_k: [[0.0; 2]; 3],
        weight: 1.0,
    }
}
