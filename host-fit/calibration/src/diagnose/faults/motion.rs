//! What errors of channels follow, in a log and in service.

use crate::diagnose::slopes::Slopes;
use crate::judge::predicted::service_range;
use hallstage_input::stage::Stage;
use hallstage_solver::estimator::dynamics::ARMS_M;
use hallstage_solver::estimator::parameters::FieldParameters;
use hallstage_solver::estimator::probe::{Probe, probes};
use hallstage_solver::estimator::rows::FieldRow;
use hallstage_solver::estimator::service::{Service, service_poses};
use nalgebra::Vector3;
use runtime::VerticalPose;
use runtime::capacitive::gaps_m;

/// A turning error changes its sign while the speed of the channel is below this part of its rms speed.
const KNEE: f64 = 0.05;

/// Time over which changes are taken, s.
const STEP: f64 = 1e-3;

/// Time between poses in service, s.
const SERVICE_STEP_S: f64 = 0.5;
/// Time over which heat goes, s.
const HEAT_S: f64 = 5.0;
/// Time over which creep goes, s.
const MEMORY_S: f64 = 3.0;

/// What an error of a channel follows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Follows {
    /// No motion: its zero is off by 1 um.
    Zero,
    /// Its value: its gain is off by 1 %.
    Gain,
    /// Its own speed: it is late by 1 ms.
    OwnSpeed,
    /// Its own acceleration: 1 um per m/s2, by a filter that is slow.
    OwnAcceleration,
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
    /// Its value times the acceleration along X and Y: its gain falls with the supply, by 1 % at 1 m/s2.
    Sag,
    /// The same by the mean power of the last [`HEAT_S`]: coils heat the magnets, by 1 % at 1 (m/s2)2.
    Heat,
    /// 1 % of its mean value of the last [`MEMORY_S`]: creep.
    Memory,
}

impl Follows {
    /// What an error of one of the nine channels may follow.
    pub(super) fn of_channel(channel: usize) -> impl Iterator<Item = Self> {
        let changes = [Self::Gain, Self::Zero, Self::OwnSpeed];
        let speeds = (0..6).map(Self::Speed).chain([Self::Turning]);
        let accelerations = (0..6).map(Self::Acceleration).filter(move |_| channel < 3);
        let forms = [Self::Power(2), Self::Power(3), Self::Side];
        let heights = (0..3).map(Self::Height);
        let (is_beam, is_gap) = ((3..6).contains(&channel), channel > 5);
        (changes.into_iter())
            .chain(speeds)
            .chain(accelerations)
            .chain(is_beam.then_some(Self::OwnAcceleration))
            .chain(forms.into_iter().filter(move |_| !is_beam))
            .chain(heights.filter(move |_| is_gap))
            .chain(is_gap.then_some(Self::Memory))
    }

    /// Whether it is the form of a sensor's characteristic, which does not change.
    pub(super) const fn is_form(self) -> bool {
        !matches!(
            self,
            Self::Speed(_) | Self::Acceleration(_) | Self::OwnAcceleration
        )
    }
}

/// What the channels show in some rows, and how their errors change the signals.
pub(super) struct Sensed {
    rows: Vec<FieldRow>,
    /// What each of the nine channels shows, m, by row, of the fitted signals: at rest a measured signal is all noise,
    /// which explains itself.
    values: Vec<[f64; 9]>,
    /// Their changes by time, m/s.
    rates: Vec<[f64; 9]>,
    /// The changes of the rates by time, m/s2.
    accelerations: Vec<[f64; 9]>,
    rms_rates: [f64; 9],
    /// Mean power of accelerations of the last time, (m/s2)2.
    heat: Vec<f64>,
    /// Mean values of the last time, m.
    memory: Vec<[f64; 9]>,
    /// Changes of the signals for a change of each of the nine channels, by row.
    pub(super) by_channel: Vec<[Vector3<f64>; 9]>,
}

impl Sensed {
    pub(super) fn new(
        rows: Vec<FieldRow>,
        stage: &Stage,
        parameters: &FieldParameters,
        lag_s: f64,
    ) -> Self {
        let probes = probes(parameters);
        let slopes = Slopes::new(stage, probes);
        let at = |row: &FieldRow| slopes.at(row.planar(lag_s, [0.0; 3]), row.vertical);
        let values = rows.iter().map(|row| shown(row, stage, &probes, lag_s));
        let values: Vec<[f64; 9]> = values.collect();
        // For small changes of X, Y, Rz, Z, Rx, Ry by time.
        let change = |row: &FieldRow, before: &[f64; 9], by: [f64; 6]| {
            let moved = FieldRow {
                reference: [0, 1, 2].map(|k| row.reference[k] + STEP * by[k]),
                vertical: [0, 1, 2].map(|k| row.vertical[k] + STEP * by[3 + k]),
                ..*row
            };
            let after = shown(&moved, stage, &probes, lag_s);
            std::array::from_fn(|k| (after[k] - before[k]) / STEP)
        };
        let rows_with_values = || rows.iter().zip(&values);
        let rates = rows_with_values().map(|(row, before)| change(row, before, row.rate));
        let rates: Vec<[f64; 9]> = rates.collect();
        let accelerations = rows_with_values().map(|(row, before)| {
            let by = std::array::from_fn(|k| row.acceleration_m_s2[k] / ARMS_M[k]);
            change(row, before, by)
        });
        let accelerations = accelerations.collect();
        let rms = |k: usize| {
            let squares: f64 = rates.iter().map(|rate| rate[k] * rate[k]).sum();
            (squares / rates.len().max(1) as f64).sqrt()
        };
        let powers = rows.iter().map(|row| [power(row)]);
        let heat = before(&rows, HEAT_S, powers).into_iter().map(|[heat]| heat);
        Self {
            heat: heat.collect(),
            memory: before(&rows, MEMORY_S, values.iter().copied()),
            rms_rates: std::array::from_fn(rms),
            by_channel: rows.iter().map(at).collect(),
            accelerations,
            values,
            rates,
            rows,
        }
    }

    /// A unit of an error of one of the nine channels, m.
    pub(super) fn error(&self, at: usize, channel: usize, follows: Follows) -> f64 {
        let row = &self.rows[at];
        let (value, rate) = (self.values[at][channel], self.rates[at][channel]);
        match follows {
            Follows::Zero => 1e-6,
            Follows::Gain => 1e-2 * value,
            Follows::OwnSpeed => -1e-3 * rate,
            Follows::OwnAcceleration => 1e-6 * self.accelerations[at][channel],
            Follows::Speed(axis) => 1e-3 * row.rate[axis],
            Follows::Acceleration(axis) => 1e-3 * row.acceleration_m_s2[axis],
            Follows::Turning => 1e-6 * rate / rate.hypot(KNEE * self.rms_rates[channel]).max(1e-12),
            Follows::Power(power) => 1e-3 * (1e3 * value).powi(power),
            Follows::Side => value.abs(),
            Follows::Height(axis) => 1e-3 * row.vertical[axis],
            Follows::Sag => 1e-2 * value * power(row).sqrt(),
            Follows::Heat => 1e-2 * value * self.heat[at],
            Follows::Memory => 1e-2 * self.memory[at][channel],
        }
    }
}

/// The square of the acceleration along X and Y, (m/s2)2.
fn power(row: &FieldRow) -> f64 {
    let [x, y, ..] = row.acceleration_m_s2;
    x * x + y * y
}

/// Means of values over a time before each row, s, which count less the older they are.
fn before<const N: usize>(
    rows: &[FieldRow],
    over_s: f64,
    values: impl Iterator<Item = [f64; N]>,
) -> Vec<[f64; N]> {
    let (mut mean, mut last_s) = ([0.0; N], rows.first().map_or(0.0, |row| row.time_s));
    let means = rows.iter().zip(values).map(|(row, values)| {
        let share = -libm::expm1(-(row.time_s - last_s).max(0.0) / over_s);
        last_s = row.time_s;
        (0..N).for_each(|k| mean[k] += share * (values[k] - mean[k]));
        mean
    });
    means.collect()
}

fn shown(row: &FieldRow, stage: &Stage, probes: &[Probe; 3], lag_s: f64) -> [f64; 9] {
    let planar = row.planar(lag_s, [0.0; 3]);
    let [a, b, c] = probes.map(|probe| probe.signal_m(planar, row.vertical));
    let [x, y1, y2] = stage.interferometer.beams_m(row.reference, row.vertical);
    let vertical = VerticalPose::from_array(row.vertical);
    let [one, two, three] = gaps_m(&stage.capacitive_probes_m, &vertical);
    [a, b, c, x, y1, y2, one, two, three]
}

/// Mean squares of the errors of X, Y, Rz (m2, m2, rad2) in the motion that `[motion]` declares for service, by an error of
/// the parameters and by errors of channels with their sizes. The stage is zeroed before service.
pub(super) fn squares_at_work(
    (stage, declared): (&Stage, &Service),
    parameters: &FieldParameters,
    off: &[f64],
    errors: &[(usize, Follows, f64)],
) -> [f64; 3] {
    let poses = service_poses(service_range(stage)).enumerate();
    let rows: Vec<FieldRow> = poses
        .map(|(at, pose)| service_row(stage, at, pose))
        .collect();
    let sensed = Sensed::new(rows, stage, parameters, 0.0);
    let pose_errors = declared.poses.iter().enumerate().map(|(at, pose)| {
        let error = |&(channel, follows, size): &(usize, Follows, f64)| {
            sensed.by_channel[at][channel] * (size * sensed.error(at, channel, follows))
        };
        let signals: Vector3<f64> = errors.iter().map(error).sum();
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
    let share = 1.0 / declared.poses.len() as f64;
    let mean = sum * share;
    (squares * share - mean.component_mul(&mean)).into()
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
        time_s: SERVICE_STEP_S * at as f64,
        signal_m: [0.0; 3],
        vertical,
        reference: planar,
        rate: speed,
        acceleration_m_s2: acceleration,
        temperature_k: [[0.0; 2]; 3],
        weight: 1.0,
    }
}
