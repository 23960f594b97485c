//! Findings about each channel alone, and their cost in service over the noise floor of probes without a fault.

use super::limits::{CLEAR, severity_of_share};
use super::slopes::Slopes;
use crate::judge::predicted::{cost, declared_service, service_range};
use crate::judge::verdict::severity;
use hallstage_input::channel::Channel;
use hallstage_input::channels::{
    Column, Line, NOISY, PROBES, SlowRate, USUAL_NOISE_M, probe_noise_m,
};
use hallstage_input::dataset::Dataset;
use hallstage_input::finding::{Code, Finding, Kind, Severity};
use hallstage_input::stage::Stage;
use hallstage_input::statistics::median;
use hallstage_solver::estimator::parameters::FieldParameters;
use hallstage_solver::estimator::probe::probes;
use hallstage_solver::estimator::service::{Service, service_poses};
use nalgebra::Vector3;

/// Beams that are held lose this part of what interpolated beams lose, once their lag is off: 0.1 to 0.24 on six logs.
const HELD: f64 = 0.2;

/// The effect of a fault.
enum Effect {
    /// A probe or a gap has an error in service: its variance, m2, and the part of it that is in the covariance of the
    /// channels already.
    Stays(f64, f64),
    /// The reference has an error that follows the motion.
    Bent,
    /// Its size is not known, or there is none in service.
    Unknown,
}

/// The faults of the channels of all logs, one for each channel.
pub(super) struct ColumnFaults {
    pub(super) findings: Vec<Finding>,
    /// Variances of X, Y, Rz in service, m2, m2, rad2, because sensors have these faults there, too.
    pub(super) stays: [f64; 3],
}

impl ColumnFaults {
    /// `parameters`: for the effect of an error of a channel on the pose. Slow beams bend the calibration by the variances
    /// `bent`.
    pub(super) fn new(
        columns: &[Column],
        dataset: &Dataset,
        stage: &Stage,
        parameters: &FieldParameters,
        bent: [f64; 3],
    ) -> Self {
        let probes_m = probe_noise_m(columns).unwrap_or([USUAL_NOISE_M; 3]);
        let noise_m = median(&mut probes_m.clone()).unwrap_or(0.0);
        let service = declared_service(stage, parameters, probes_m);
        let effects = service.map(|service| PoseEffects::new(&service, stage, parameters));
        let effects = effects.unwrap_or_default();
        let floor = effects.variances(&PROBES, |i, j| match i == j {
            true => probes_m[i] * probes_m[i],
            false => 0.0,
        });
        let cost = |own: [f64; 3]| cost(own, floor);
        let none = [0.0; 3];
        let mut out = Self {
            findings: Vec::new(),
            stays: none,
        };
        // A finding, and the variances of its sensor in service.
        let with_effect = |column: &Column, (kind, effect): (Kind, Effect)| {
            let found = Finding::new(kind).with_channel(column.channel);
            let (own, part, worst) = match effect {
                // A calibration is right though a sensor is not.
                Effect::Stays(m2, counted_m2) => {
                    let own = effects.variances(&[column.channel], |_, _| m2);
                    (own, 1.0 - counted_m2 / m2, Severity::Warn)
                }
                Effect::Bent => (bent, 0.0, Severity::Refuse),
                Effect::Unknown => return (found, none),
            };
            let found = found.with_severity(severity(cost(own)).min(worst));
            (found.with_cost(cost(own)), own.map(|of| of * part))
        };
        for (log, source) in dataset.logs.iter().enumerate() {
            let own: Vec<&Column> = columns.iter().filter(|column| column.log == log).collect();
            let mut stays = none;
            for kind in own.chunks(3) {
                let before = out.findings.len();
                for column in kind {
                    let faults = faults(column, noise_m, source.rows.len());
                    // Harmless properties are in the table of channels only.
                    let mut felt = faults.map(|fault| with_effect(column, fault));
                    let felt = felt.find(|(found, _)| found.severity > Severity::Note);
                    let Some((mut found, own)) = felt else {
                        continue;
                    };
                    let first = column.outliers.first();
                    if let Some((row, _)) = first.filter(|_| found.code() == Code::Outliers) {
                        let row = &dataset.rows[source.rows.start + row];
                        let movement = &dataset.movements[row.movement];
                        found = found.with_place(dataset.movement_name(movement), row.t_us);
                    }
                    out.findings.push(found);
                    stays = both(stays, own, |a, b| a + b);
                }
                let channels: Vec<Channel> = kind.iter().map(|column| column.channel).collect();
                let beyond = effects.variances(&channels, |i, j| kind[i].beyond_m2[j]);
                stays = both(stays, beyond, |a, b| a + b);
                let shared = kind.iter().map(|column| column.shared).fold(0.0, f64::max);
                let is_new = shared > 0.0 || out.findings.len() == before;
                let is_felt = |variances| severity(cost(variances)) > Severity::Note;
                if is_felt(beyond) && is_new {
                    let percent = 100.0 * shared;
                    let found = Finding::new(Kind::GroupNoise { percent }).with_cost(cost(beyond));
                    let own_m2 = |k: usize| kind[k].beyond_m2[k];
                    let own = |k: usize| effects.variances(&[channels[k]], |_, _| own_m2(k));
                    let of = (0..3).filter(|k| shared == 0.0 && is_felt(own(*k)));
                    let of: Vec<Channel> = of.map(|k| channels[k]).collect();
                    let group = vec![Channel::GROUPS[channels[0] as usize / 3]];
                    let channels = if of.is_empty() { group } else { of };
                    out.findings.push(Finding { channels, ..found });
                }
                for found in &mut out.findings[before..] {
                    found.log = (dataset.logs.len() > 1).then(|| source.name());
                }
            }
            // Service has the sensors of one log.
            out.stays = both(out.stays, stays, f64::max);
        }
        out
    }
}

/// What their rate takes off X, Y1, Y2: m per m/s2 of their own acceleration. A chord over a time T is off by T2 / 12 on
/// average.
pub(super) fn slow_beams_s2(columns: &[Column], dataset: &Dataset, stage: &Stage) -> [f64; 3] {
    let mut sizes_s2 = [0.0; 3];
    for column in columns.iter().filter(|column| column.channel.is_beam()) {
        let Some(slow) = column.slow else { continue };
        let period_s = dataset.period_s(dataset.logs[column.log].rows.clone());
        let time_s = slow.every as f64 * period_s.unwrap_or(stage.servo_period_s);
        let part = if slow.is_held { HELD } else { 1.0 };
        let size_s2 = &mut sizes_s2[column.channel as usize - 3];
        *size_s2 = f64::max(*size_s2, part * time_s * time_s / 12.0);
    }
    sizes_s2
}

fn both(a: [f64; 3], b: [f64; 3], of: fn(f64, f64) -> f64) -> [f64; 3] {
    [0, 1, 2].map(|axis| of(a[axis], b[axis]))
}

/// By pose of service and channel: the errors of X, Y, Rz by an error of the channel; none for beams, which service does not
/// have.
#[derive(Default)]
struct PoseEffects(Vec<[Vector3<f64>; 9]>);

impl PoseEffects {
    fn new(service: &Service, stage: &Stage, parameters: &FieldParameters) -> Self {
        let slopes = Slopes::new(stage, probes(parameters));
        let poses = service_poses(service_range(stage)).zip(&service.poses);
        let effects = poses.map(|((planar, vertical), pose)| {
            let by_channel = slopes.at(planar, vertical);
            let by_signal = pose.by_signal.map(Vector3::from);
            let by_error =
                |signals: Vector3<f64>| Vector3::from(by_signal.map(|by| by.dot(&signals)));
            let mut by_channel = by_channel.map(by_error);
            by_channel[3..6].fill(Vector3::zeros());
            by_channel
        });
        Self(effects.collect())
    }

    /// The mean variances of X, Y, Rz by errors of channels with this covariance.
    fn variances(
        &self,
        channels: &[Channel],
        covariance: impl Fn(usize, usize) -> f64,
    ) -> [f64; 3] {
        let share = 1.0 / self.0.len().max(1) as f64;
        let mut sums = Vector3::zeros();
        for (i, a) in channels.iter().enumerate() {
            for (j, b) in channels.iter().enumerate() {
                let products =
                    (self.0.iter()).map(|by| by[*a as usize].component_mul(&by[*b as usize]));
                sums += products.sum::<Vector3<f64>>() * (share * covariance(i, j));
            }
        }
        sums.into()
    }
}

/// The faults of a channel of a log with `rows` rows, causes before their consequences; the Hall probes have this noise.
fn faults(
    column: &Column,
    probe_noise_m: f64,
    rows: usize,
) -> impl Iterator<Item = (Kind, Effect)> + use<> {
    let is_beam = column.channel.is_beam();
    let noise_m = column.white_noise_m.unwrap_or(0.0);
    let overflow = |(bits, times)| (Kind::Overflows { bits, times }, Effect::Unknown);
    let rounding_m2 = column.step_m * column.step_m / 12.0;
    let is_coarse = match is_beam {
        true => rounding_m2 > probe_noise_m * probe_noise_m,
        false => column.step_m > 1.5 * column.unit_m,
    };
    let (step_um, noise_um) = (1e6 * column.step_m, 1e6 * probe_noise_m);
    let steps = Kind::CoarseSteps { step_um, noise_um };
    let bits_m = (column.stuck_bits.iter()).map(|bit| f64::from(1 << bit) * column.unit_m);
    let stuck = Kind::StuckBits {
        bits: column.stuck_bits.clone(),
        step_um: 1e6 * bits_m.clone().sum::<f64>(),
    };
    let is_stuck = !column.stuck_bits.is_empty();
    // Half of the values are off by the bit.
    let stuck_m2: f64 = bits_m.map(|bit_m| 0.25 * bit_m * bit_m).sum();
    let slow = |slow: SlowRate| Kind::SlowRate {
        rows: slow.every,
        is_held: slow.is_held,
    };
    // At lower rates motion is in the differences.
    let shows_noise = column.falls.is_some() && !column.is_rounded();
    let is_noisy = |ratio: &f64| *ratio > NOISY && !is_beam && shows_noise;
    let noisy = |ratio: f64| {
        let noise_um = 1e6 * noise_m;
        let beyond_m2 = noise_m * noise_m * (1.0 - 1.0 / (ratio * ratio));
        let kind = Kind::Noisy { noise_um, ratio };
        (kind, Effect::Stays(beyond_m2, 0.0))
    };
    let own_m2 = column.beyond_m2[column.channel as usize % 3];
    let line_m2 = |line: Line| 0.5 * line.amplitude_m * line.amplitude_m;
    let line_m2 = column.line.map_or(0.0, line_m2);
    // The steps of a bit are fast noise, too.
    let of_bits = Effect::Stays(stuck_m2, own_m2.clamp(0.0, stuck_m2));
    let in_service = |m2: f64| match is_beam {
        true => Effect::Unknown,
        false => Effect::Stays(m2.max(f64::MIN_POSITIVE), m2.max(f64::MIN_POSITIVE)),
    };
    let hum = column.line.map(|line| Kind::Hum {
        frequency_hz: line.frequency_hz,
        amplitude_um: 1e6 * line.amplitude_m,
    });
    // Smaller errors of a beam are below the noise of the probes.
    let least_m = if is_beam { CLEAR * probe_noise_m } else { 0.0 };
    let errors_m = column.outliers.iter().map(|(_, error_m)| error_m.abs());
    let errors_m: Vec<f64> = errors_m.filter(|error_m| *error_m > least_m).collect();
    let outliers = Kind::OutlierRows {
        rows: errors_m.len(),
        largest_um: 1e6 * errors_m.iter().copied().fold(0.0, f64::max),
    };
    let filled = column.straight.as_ref().map(ExactSizeIterator::len);
    let share = |filled: usize| severity_of_share(filled as f64 / rows as f64);
    let filled = filled.filter(|&filled| share(filled) > Severity::Note);
    let of_steps = match is_beam {
        true => Effect::Unknown,
        false => Effect::Stays(rounding_m2, 0.0),
    };
    let of_rate = match is_beam {
        true => Effect::Bent,
        false => Effect::Unknown,
    };
    let faults = [
        column.overflows.map(overflow),
        is_coarse.then_some((steps, of_steps)),
        is_stuck.then_some((stuck, of_bits)),
        column.slow.map(|rate| (slow(rate), of_rate)),
        (column.is_low_passed && column.slow.is_none())
            .then_some((Kind::LowPass {}, Effect::Unknown)),
        hum.map(|hum| (hum, in_service(line_m2))),
        (!errors_m.is_empty()).then(|| (outliers, in_service(own_m2 - line_m2))),
        column.to_siblings.filter(is_noisy).map(noisy),
        filled.map(|rows| (Kind::Filled { rows }, Effect::Unknown)),
    ];
    faults.into_iter().flatten()
}

#[cfg(test)]
mod tests;
