//! Findings about each channel alone, and their cost in service over the noise floor of probes without a fault.

use super::limits::severity_of_share;
use super::slopes::Slopes;
use crate::judge::predicted::{Predicted, service_range};
use crate::judge::verdict::severity;
use hallstage_input::channel::Channel;
use hallstage_input::channels::{Column, SlowRate};
use hallstage_input::dataset::Dataset;
use hallstage_input::finding::{Finding, Kind, Severity};
use hallstage_input::stage::Stage;
use hallstage_input::statistics::median;
use hallstage_solver::estimator::parameters::FieldParameters;
use hallstage_solver::estimator::probe::probes;
use hallstage_solver::estimator::service::service_poses;

/// A probe or a gap is noisy from this many times the noise of its siblings.
const NOISY: f64 = 1.3;
/// The noise of a probe is white, with 0.21 of the fall of a random walk. A filter is there from this fall.
const FALL_OF_PROBE: f64 = 0.45;
/// The noise of a beam is drift and white noise. A filter is there if it falls by more than a random walk from 75 to
/// 200 Hz, and this many times as much from 20 to 75 Hz. A low pass of 30 Hz has 2.7 and is harmless.
const FALLS_OF_BEAM: [f64; 2] = [3.0, 1.0];
/// An error of the reference that follows the motion bends a calibration by this part of it: measured on references that
/// are held for 5 and 10 rows or interpolated over 5 to 25.
const BENDS: f64 = 0.75;

/// The noise of a beam is that of its reading, and no motion, below this part of the noise of a probe.
const QUIET: f64 = 1.0 / 200.0;

const PROBES: [Channel; 3] = [Channel::HallA, Channel::HallB, Channel::HallC];

/// The effect of a fault.
enum Effect {
    /// A probe or a gap has an error with this variance in service, m2.
    Variance(f64),
    /// The reference has an error that follows the motion, rms m.
    Bent(f64),
    /// Nothing shows its size.
    Unknown,
}

/// The faults of the channels of all logs, one for each channel.
pub(super) struct ColumnFaults {
    pub(super) findings: Vec<Finding>,
    /// The variances of X, Y, Rz in service without these faults and the variances that the faults add: m2, m2, rad2.
    floor: [f64; 3],
    added: [f64; 3],
    /// The variances of the noise of probes that are noisier than their siblings: other predictions have them.
    beyond: [f64; 3],
}

impl ColumnFaults {
    /// `parameters`: for the effect of an error of a channel on the pose.
    pub(super) fn new(
        columns: &[Column],
        dataset: &Dataset,
        stage: &Stage,
        parameters: &FieldParameters,
    ) -> Self {
        let is_probe = |column: &&Column| PROBES.contains(&column.channel);
        let noise = columns.iter().filter(is_probe).filter_map(noise_m);
        let noise_m = median(&mut noise.collect::<Vec<f64>>()).unwrap_or(0.0);
        let by_channel = variances(stage, parameters);
        let by_probes = |axis: usize| by_channel[..3].iter().map(|by| by[axis]).sum::<f64>();
        let floor = [0, 1, 2].map(|axis| by_probes(axis) * noise_m * noise_m);
        let (mut findings, mut added, mut beyond) = (Vec::new(), [0.0; 3], [0.0; 3]);
        for column in columns {
            let log = &dataset.logs[column.log];
            let mut all = Channel::SINGLE.iter().zip(by_channel);
            let by = all.find(|(channel, _)| **channel == column.channel);
            if let (Some((_, by)), true) = (by, is_probe(&column)) {
                let more_m2 = beyond_m2(column);
                (0..3).for_each(|axis| beyond[axis] += by[axis] * more_m2);
            }
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
            // Movements that are too short show no noise to compare with.
            let faults = faults.filter(|_| noise_m > 0.0);
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
        Self {
            findings,
            floor,
            added,
            beyond,
        }
    }

    /// The errors to expect in service with these faults over the noise floor without them. A prediction has the noise of
    /// the probes already.
    pub(super) fn on_top_of(&self, predicted: Predicted) -> Predicted {
        match self.added {
            [0.0, 0.0, 0.0] => predicted,
            added => {
                let noise = [0, 1, 2].map(|axis| predicted.noise(axis).powi(2));
                let change = |axis: usize| {
                    let change = added[axis] + self.floor[axis] - noise[axis] - self.beyond[axis];
                    change.max(added[axis] + self.floor[axis] - predicted.rms[axis].powi(2))
                };
                predicted.with_added([0, 1, 2].map(change)).over(self.floor)
            }
        }
    }
}

/// By channel, mean over the poses of service: the variances of X, Y, Rz by a variance of the channel; zeros for
/// beams, which service does not have.
fn variances(stage: &Stage, parameters: &FieldParameters) -> [[f64; 3]; 9] {
    let slopes = Slopes::new(stage, probes(parameters));
    let places = service_poses(service_range(stage));
    let share = 1.0 / places.len() as f64;
    let mut sums = [[0.0; 3]; 9];
    for (planar, vertical) in places {
        let errors = slopes.of_pose(planar.map(|x| x * 1e3), vertical);
        for (sums, errors) in sums.iter_mut().zip(errors.into_iter().flatten()) {
            (0..3).for_each(|axis| sums[axis] += share * errors[axis] * errors[axis]);
        }
    }
    sums[3..6].fill([0.0; 3]);
    sums
}

/// The noise of a channel before its rounding, m.
fn noise_m(column: &Column) -> Option<f64> {
    let rounding_m2 = column.step_m * column.step_m / 12.0;
    let noise_m2 = column.white_noise_m?.powi(2) - rounding_m2;
    // A step of more than six times the noise hides it.
    Some(noise_m2.max(rounding_m2 / 3.0).sqrt())
}

/// The variance of the noise of a channel beyond the noise of its siblings, m2; 0 unless it is noisy.
fn beyond_m2(column: &Column) -> f64 {
    match (column.white_noise_m, column.to_siblings) {
        (Some(noise_m), Some(ratio)) if ratio > NOISY => {
            noise_m * noise_m * (1.0 - 1.0 / (ratio * ratio))
        }
        _ => 0.0,
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
        (
            Kind::Noisy { noise_um, ratio },
            Effect::Variance(beyond_m2(column)),
        )
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
    fn a_sound_log_has_no_finding_and_keeps_its_prediction() {
        let none = faults_of(|_, _| ());
        assert_eq!(none.findings, []);
        let short = faults_of(|k, row| row.movement = k / 5);
        assert_eq!(short.findings, []);
        let predicted = Predicted {
            rms: [1e-6; 3],
            ratio: [1.02; 3],
            range: [[1e-6, 2e-6]; 3],
        };
        assert_eq!(none.on_top_of(predicted), predicted);
    }

    /// The noise of the probes is 8 codes. A bit of 32 codes adds a variance of 256, and one probe of three has it.
    #[test]
    fn a_missing_bit_costs_its_variance_and_the_prediction_counts_it_once() {
        let stuck = |bit: u32| move |_: usize, row: &mut Row| row.frame.codes.hall[0] |= 1 << bit;
        let (code, channel, cost) = only(stuck(5));
        assert_eq!((code, channel), (Code::StuckBit, Channel::HallA));
        let cost = cost.expect("a cost");
        assert!(
            cost > 1.4 && cost < (1.0f64 + 256.0 / 64.0).sqrt(),
            "{cost}"
        );
        let faults = faults_of(stuck(5));
        assert!(
            faults.beyond[0] > 0.1 * faults.added[0],
            "{:?}",
            faults.beyond
        );
        let rms = [0, 1, 2].map(|axis| (faults.floor[axis] + faults.beyond[axis]).sqrt());
        let with_noise = Predicted {
            rms,
            ratio: [0, 1, 2].map(|axis| rms[axis] / faults.floor[axis].sqrt()),
            range: rms.map(|rms| [rms; 2]),
        };
        let ratio = faults.on_top_of(with_noise).worst_ratio();
        assert!((ratio - cost).abs() < 1e-9, "{ratio} {cost}");
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
