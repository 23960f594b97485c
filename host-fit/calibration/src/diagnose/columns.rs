//! Findings about each channel alone, and their cost in service over the noise floor of probes without a fault.

use super::limits::severity_of_share;
use super::slopes::Slopes;
use crate::judge::predicted::{declared_service, service_range};
use crate::judge::verdict::severity;
use hallstage_input::channel::Channel;
use hallstage_input::channels::{Column, NOISY, PROBES, SlowRate, probe_noise_m};
use hallstage_input::dataset::Dataset;
use hallstage_input::finding::{Finding, Kind, Severity};
use hallstage_input::stage::Stage;
use hallstage_input::statistics::median;
use hallstage_solver::estimator::parameters::FieldParameters;
use hallstage_solver::estimator::probe::probes;
use hallstage_solver::estimator::service::{Service, service_poses};
use nalgebra::Vector3;

/// The noise of a probe is white, with 0.21 of the fall of a random walk. A filter is there from this fall.
const FALL_OF_PROBE: f64 = 0.45;
/// The noise of a beam is drift and white noise. A filter is there if it falls by more than a random walk from 75 to
/// 200 Hz, and this many times as much from 20 to 75 Hz. A low pass of 30 Hz has 2.7 and is harmless.
const FALLS_OF_BEAM: [f64; 2] = [3.0, 1.0];
/// An error of the reference that follows the motion bends a calibration by this part of it: measured on references that
/// are held for 5 and 10 rows or interpolated over 5 to 25.
const BENDS: f64 = 0.75;

/// The noise of a beam is the noise of its reading, and no motion, below this part of the noise of a probe.
const QUIET: f64 = 1.0 / 200.0;

/// The effect of a fault.
enum Effect {
    /// A probe or a gap has an error with this variance in service, m2.
    Variance(f64),
    /// The reference has an error that follows the motion, rms m.
    Bent(f64),
    /// Its size is not known.
    Unknown,
}

/// The faults of the channels of all logs, one for each channel.
pub(super) struct ColumnFaults {
    pub(super) findings: Vec<Finding>,
    /// Variances that they add to X, Y, Rz in service: m2, m2, rad2.
    pub(super) added: [f64; 3],
}

impl ColumnFaults {
    /// `parameters`: for the effect of an error of a channel on the pose.
    pub(super) fn new(
        columns: &[Column],
        dataset: &Dataset,
        stage: &Stage,
        parameters: &FieldParameters,
    ) -> Self {
        let probes_m = probe_noise_m(columns).unwrap_or([stage.hall.m_per_count; 3]);
        let noise_m = median(&mut probes_m.clone()).unwrap_or(0.0);
        let service = declared_service(stage, parameters, probes_m);
        let service = service.map(|service| {
            let floor = service.by_signals(probes_m.map(|m| m * m));
            (floor, variances(&service, stage, parameters))
        });
        let (floor, by_channel) = service.unwrap_or_default();
        let (mut findings, mut added) = (Vec::new(), [0.0; 3]);
        for column in columns {
            let log = &dataset.logs[column.log];
            let mut all = Channel::SINGLE.iter().zip(by_channel);
            let by = all.find(|(channel, _)| **channel == column.channel);
            let in_service = |effect: Effect| match effect {
                Effect::Variance(m2) => Some(by?.1.map(|by| by * m2)),
                Effect::Bent(m) => Some(floor.map(|floor| floor * (BENDS * m / noise_m).powi(2))),
                Effect::Unknown => None,
            };
            let with_cost = |(kind, effect): (Kind, Effect)| {
                let mut found = Finding::new(kind).with_channel(column.channel);
                found.log = (dataset.logs.len() > 1).then(|| log.name());
                let Some(own) = in_service(effect) else {
                    return (found, [0.0; 3]);
                };
                let ratio = |axis: usize| (1.0 + own[axis] / floor[axis]).sqrt();
                let cost = [0, 1, 2].map(ratio).into_iter().fold(1.0, f64::max);
                (found.with_severity(severity(cost)).with_cost(cost), own)
            };
            // Harmless properties are in the table of channels only.
            let faults = faults(column, noise_m, log.rows.len()).map(with_cost);
            let worst = faults.filter(|(found, _)| found.severity > Severity::Note);
            for (found, own) in worst.take(1) {
                findings.push(found);
                for (all, own) in added.iter_mut().zip(own) {
                    // The beams are slow together.
                    let is_beam = column.channel.is_beam();
                    *all = if is_beam { own.max(*all) } else { own + *all };
                }
            }
        }
        Self { findings, added }
    }
}

/// By channel, mean over the poses of service: the variances of X, Y, Rz by a variance of the channel; zeros for
/// beams, which service does not have.
fn variances(service: &Service, stage: &Stage, parameters: &FieldParameters) -> [[f64; 3]; 9] {
    let slopes = Slopes::new(stage, probes(parameters));
    let share = 1.0 / service.poses.len() as f64;
    let mut sums = [[0.0; 3]; 9];
    for ((planar, vertical), pose) in service_poses(service_range(stage)).zip(&service.poses) {
        let by_channel = slopes.at(planar, vertical);
        for (sums, signals) in sums.iter_mut().zip(by_channel) {
            for (sum, by_signal) in sums.iter_mut().zip(&pose.by_signal) {
                *sum += share * signals.dot(&Vector3::from(*by_signal)).powi(2);
            }
        }
    }
    sums[3..6].fill([0.0; 3]);
    sums
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
    let stuck_m2 = bits_m.map(|bit_m| 0.25 * bit_m * bit_m).sum();
    let slow = |slow: SlowRate| Kind::SlowRate {
        rows: slow.every,
        is_held: slow.is_held,
        error_um: 1e6 * slow.error_m,
    };
    let [low, high] = column.falls.unwrap_or_default();
    let is_quiet = noise_m < QUIET * probe_noise_m;
    let is_filtered = match is_beam {
        true => is_quiet && low > FALLS_OF_BEAM[0] && high > FALLS_OF_BEAM[1],
        false => PROBES.contains(&column.channel) && high > FALL_OF_PROBE,
    };
    // At lower rates motion is in the differences.
    let shows_noise = column.falls.is_some() && !column.is_rounded();
    let is_noisy = |ratio: &f64| *ratio > NOISY && !is_beam && shows_noise;
    let noisy = |ratio: f64| {
        let noise_um = 1e6 * noise_m;
        let beyond_m2 = noise_m * noise_m * (1.0 - 1.0 / (ratio * ratio));
        (Kind::Noisy { noise_um, ratio }, Effect::Variance(beyond_m2))
    };
    let filled = column.straight.as_ref().map(ExactSizeIterator::len);
    let share = |filled: usize| severity_of_share(filled as f64 / rows as f64);
    let filled = filled.filter(|&filled| share(filled) > Severity::Note);
    let of_steps = match is_beam {
        true => Effect::Unknown,
        false => Effect::Variance(rounding_m2),
    };
    let of_rate = |slow: SlowRate| match is_beam {
        true => Effect::Bent(slow.error_m),
        false => Effect::Unknown,
    };
    let faults = [
        column.overflows.map(overflow),
        is_coarse.then_some((steps, of_steps)),
        is_stuck.then_some((stuck, Effect::Variance(stuck_m2))),
        column.slow.map(|rate| (slow(rate), of_rate(rate))),
        (is_filtered && column.slow.is_none()).then_some((Kind::LowPass {}, Effect::Unknown)),
        column.to_siblings.filter(is_noisy).map(noisy),
        filled.map(|rows| (Kind::Filled { rows }, Effect::Unknown)),
    ];
    faults.into_iter().flatten()
}

#[cfg(test)]
mod tests {
    use super::*;
    use hallstage_input::channels::columns;
    use hallstage_input::dataset::Row;
    use hallstage_input::finding::Code;
    use hallstage_input::log::{self, ReadOptions};
    use hallstage_input::shipped::{RUN_GZ, stage};
    use hallstage_solver::estimator::paper::Parameters;

    /// The faults of the shipped run with a fault in each row.
    fn faults_of(fault: impl Fn(usize, &mut Row)) -> ColumnFaults {
        let stage = stage();
        let reading = log::read_bytes(RUN_GZ, "run.csv.gz".as_ref(), &stage, &ReadOptions::FIT);
        let mut dataset = reading.expect("a log").dataset;
        let rows = dataset.rows.iter_mut().enumerate();
        rows.for_each(|(k, row)| fault(k, row));
        let parameters = FieldParameters::from_model_31(&Parameters::designed(&stage), &stage);
        ColumnFaults::new(&columns(&dataset, &stage), &dataset, &stage, &parameters)
    }

    /// The only finding: its code, channel and cost.
    fn only(fault: impl Fn(usize, &mut Row)) -> (Code, Channel, Option<f64>) {
        let findings = faults_of(fault).findings;
        let [found] = &findings[..] else {
            panic!("{findings:#?}");
        };
        (found.code(), found.channels[0], found.cost)
    }

    #[test]
    fn a_sound_log_has_no_finding() {
        let none = faults_of(|_, _| ());
        assert_eq!(none.findings, []);
        let short = faults_of(|k, row| row.movement = k / 5);
        assert_eq!(short.findings, []);
    }

    /// The noise of the probes is 8 codes. A bit of 32 codes adds a variance of 256, and one probe of three has it.
    #[test]
    fn a_missing_bit_costs_its_variance() {
        let stuck = |bit: u32| move |_: usize, row: &mut Row| row.frame.codes.hall[0] |= 1 << bit;
        let (code, channel, cost) = only(stuck(5));
        assert_eq!((code, channel), (Code::StuckBit, Channel::HallA));
        let cost = cost.expect("a cost");
        assert!(
            cost > 1.4 && cost < (1.0f64 + 256.0 / 64.0).sqrt(),
            "{cost}"
        );
        assert_eq!(
            faults_of(stuck(1)).findings,
            [],
            "two codes are below the noise"
        );
    }

    #[test]
    fn steps_cost_the_variance_of_rounding_and_steps_of_a_beam_cast_doubt() {
        let coarse = |codes: i32| {
            move |_: usize, row: &mut Row| {
                row.frame
                    .codes
                    .hall
                    .iter_mut()
                    .for_each(|code| *code -= code.rem_euclid(codes));
            }
        };
        assert_eq!(faults_of(coarse(4)).findings, []);
        for found in faults_of(coarse(40)).findings {
            let want = (1.0f64 + 40.0 * 40.0 / 12.0 / 64.0).sqrt();
            let cost = found.cost.expect("a cost");
            // Each probe alone makes a part of it.
            assert!(
                found.code() == Code::Coarse && cost > 1.2 && cost < want,
                "{found:?}"
            );
        }
        let rounded = |step_m: f64| {
            move |_: usize, row: &mut Row| {
                row.reference[0] = (row.reference[0] / step_m).round() * step_m
            }
        };
        assert_eq!(faults_of(rounded(1e-6)).findings, []);
        assert_eq!(only(rounded(10e-6)), (Code::Coarse, Channel::BeamX, None));
    }

    #[test]
    fn a_noisy_probe_costs_its_excess_over_its_siblings() {
        let noisy = |k: usize, row: &mut Row| {
            row.frame.codes.hall[1] += [40, -40, 0, 37, -31, 5, -26][k * k % 7]
        };
        let (code, channel, cost) = only(noisy);
        assert_eq!((code, channel), (Code::Noisy, Channel::HallB));
        assert!(cost > Some(2.0), "{cost:?}");
    }
}
