//! Findings about each channel alone, and their cost in service over the noise floor of probes without a fault.

use super::limits::severity_of_share;
use super::slopes::Slopes;
use crate::judge::predicted::{Predicted, service_range};
use crate::judge::verdict::severity;
use hallstage_input::channel::Channel;
use hallstage_input::channels::{Column, columns};
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

const PROBES: [Channel; 3] = [Channel::HallA, Channel::HallB, Channel::HallC];

/// The noise of a beam is that of its reading, and no motion, below this part of the noise of a probe.
const QUIET: f64 = 1.0 / 200.0;

/// A fault of a channel.
struct Fault {
    kind: Kind,
    size: Size,
}

/// What a fault does.
enum Size {
    /// A probe or a gap has this error in service, m2.
    Variance(f64),
    /// A calibration is bent by this error of the reference, m.
    Bent(f64),
    /// Nothing tells.
    Unknown,
}

/// The faults of the channels of all logs, and their variances over the noise floor of X, Y, Rz in service, all
/// together.
pub(super) struct ColumnFaults {
    pub(super) columns: Vec<Column>,
    pub(super) findings: Vec<Finding>,
    /// The variances of X, Y, Rz without these faults and the variances that the faults add: m2, m2, rad2.
    floor: [f64; 3],
    added: [f64; 3],
}

impl ColumnFaults {
    /// `parameters`: for the effect of an error of a channel on the pose.
    pub(super) fn new(dataset: &Dataset, stage: &Stage, parameters: &FieldParameters) -> Self {
        let columns = columns(dataset, stage);
        let is_probe = |column: &&Column| PROBES.contains(&column.channel);
        let noise = columns.iter().filter(is_probe).filter_map(noise_m);
        let noise_m = median(&mut noise.collect::<Vec<f64>>()).unwrap_or(0.0);
        let by_channel = variances(stage, parameters);
        let floor = [0, 1, 2].map(|axis| {
            let by_probe = by_channel[..3].iter().map(|by| by[axis]).sum::<f64>();
            by_probe * noise_m * noise_m
        });
        let mut out = Self {
            columns: Vec::new(),
            findings: Vec::new(),
            floor,
            added: [0.0; 3],
        };
        for column in &columns {
            let mut all = Channel::SINGLE.iter().zip(by_channel);
            let own = all.find(|(channel, _)| **channel == column.channel);
            let by = own.map_or([0.0; 3], |(_, by)| by);
            let mut most = [0.0; 3];
            let log = &dataset.logs[column.log];
            for Fault { kind, size } in faults(column, noise_m, log.rows.len()) {
                let mut found = Finding::new(kind).with_channel(column.channel);
                found.log = (dataset.logs.len() > 1).then(|| log.name());
                let added = match size {
                    Size::Variance(m2) => Some(by.map(|by| by * m2)),
                    Size::Bent(error_m) => {
                        Some(floor.map(|floor| floor * (BENDS * error_m / noise_m).powi(2)))
                    }
                    Size::Unknown => None,
                };
                if let Some(added) = added.filter(|_| noise_m > 0.0) {
                    let ratios = added
                        .iter()
                        .zip(&floor)
                        .map(|(added, floor)| (1.0 + added / floor).sqrt());
                    let cost = ratios.fold(1.0, f64::max);
                    found = found.with_severity(severity(cost)).with_cost(cost);
                    // Steps and missing bits are in the noise, too.
                    most = [0, 1, 2].map(|axis| f64::max(most[axis], added[axis]));
                }
                // Harmless properties are in the table of channels.
                if found.severity > Severity::Note {
                    out.findings.push(found);
                }
            }
            let is_beam = column.channel.is_beam();
            for (all, most) in out.added.iter_mut().zip(most) {
                // The beams are slow together.
                *all = if is_beam { all.max(most) } else { *all + most };
            }
        }
        Self { columns, ..out }
    }

    /// The errors to expect in service with these faults over the noise floor without them. A prediction has some of
    /// them as noise of the probes.
    pub(super) fn on_top_of(&self, predicted: Predicted) -> Predicted {
        match self.added {
            [0.0, 0.0, 0.0] => predicted,
            added => {
                let noise = [0, 1, 2].map(|axis| predicted.noise(axis).powi(2));
                let change = [0, 1, 2].map(|axis| added[axis] + self.floor[axis] - noise[axis]);
                predicted.with_added(change).over(self.floor)
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

/// The faults of a channel of a log with `rows` rows; the Hall probes have this noise.
fn faults(column: &Column, probe_noise_m: f64, rows: usize) -> Vec<Fault> {
    let is_beam = column.channel.is_beam();
    let is_probe = PROBES.contains(&column.channel);
    let is_stuck = !column.stuck_bits.is_empty();
    let noise_m = column.white_noise_m.unwrap_or(0.0);
    let mut faults = Vec::new();
    let is_coarse = column.step_m > 1.5 * column.unit_m;
    let mut add = |kind: Kind, size: Size| faults.push(Fault { kind, size });
    if let Some((bits, times)) = column.overflows {
        add(Kind::Overflows { bits, times }, Size::Unknown);
    }
    let rounding_m2 = column.step_m * column.step_m / 12.0;
    let coarse = Kind::CoarseSteps {
        step_um: 1e6 * column.step_m,
        noise_um: 1e6 * probe_noise_m,
    };
    match is_beam {
        true if rounding_m2 > probe_noise_m * probe_noise_m => add(coarse, Size::Unknown),
        false if is_coarse => add(coarse, Size::Variance(rounding_m2)),
        _ => {}
    }
    if is_stuck {
        let steps_m = (column.stuck_bits.iter()).map(|bit| f64::from(1 << bit) * column.unit_m);
        let kind = Kind::StuckBits {
            bits: column.stuck_bits.clone(),
            step_um: 1e6 * steps_m.clone().sum::<f64>(),
        };
        // Half of the values are off by the bit.
        let variance_m2 = steps_m.map(|step_m| 0.25 * step_m * step_m).sum();
        add(kind, Size::Variance(variance_m2));
    }
    if let Some(ratio) = column.to_siblings
        && ratio > NOISY
        && !is_beam
        && !is_stuck
        && !column.is_rounded()
    {
        let kind = Kind::Noisy {
            noise_um: 1e6 * noise_m,
            ratio,
        };
        let usual_m2 = (noise_m / ratio).powi(2);
        add(kind, Size::Variance(noise_m * noise_m - usual_m2));
    }
    let [low, high] = column.falls.unwrap_or_default();
    let falls = low > FALLS_OF_BEAM[0] && high > FALLS_OF_BEAM[1];
    let is_filtered = match is_beam {
        true => falls && noise_m < QUIET * probe_noise_m,
        // Stuck bits, overflows and coarse steps fall, too.
        false => {
            let has_other = is_coarse || is_stuck || column.overflows.is_some();
            is_probe && !has_other && high > FALL_OF_PROBE
        }
    };
    if let Some(slow) = column.slow {
        let kind = Kind::SlowRate {
            rows: slow.every,
            is_held: slow.is_held,
            error_um: 1e6 * slow.error_m,
        };
        let size = match is_beam {
            true => Size::Bent(slow.error_m),
            false => Size::Unknown,
        };
        add(kind, size);
    } else if is_filtered {
        add(Kind::LowPass {}, Size::Unknown);
    }
    if let Some(straight) = &column.straight
        && severity_of_share(straight.len() as f64 / rows as f64) > Severity::Note
    {
        let rows = straight.len();
        add(Kind::Filled { rows }, Size::Unknown);
    }
    faults
}

#[cfg(test)]
mod tests {
    use super::*;
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
        ColumnFaults::new(&dataset, &stage, &parameters)
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
        let noise = [0, 1, 2].map(|axis| (faults.floor[axis] + 0.5 * faults.added[axis]).sqrt());
        let range = noise.map(|noise| [noise; 2]);
        let with_half = Predicted {
            rms: noise,
            ratio: [1.0; 3],
            range,
        };
        let ratio = faults.on_top_of(with_half).worst_ratio();
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
