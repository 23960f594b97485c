//! The share of 95 % intervals of the field model that hold the truth, over simulated logs.
//!
//! `cargo bench -p host-fit --bench coverage [-- LOGS]`: 200 logs by default, minutes.
//!
//! Parameters have a true value only in logs made by the field model. Poses have one also in logs of
//! simulated stages, where the model is not exact.

mod common;

use common::{Coverage, Fallible, RUN_8, RUN_30, Twin, field};
use host_fit::calibration::plan::run::PlannedRun;
use host_fit::input::dataset::{Dataset, LoggedFrame, Movement, Row};
use host_fit::input::shipped;
use host_fit::input::stage::Stage;
use host_fit::simulate::pose::StagePose;
use host_fit::simulate::protocol::{Protocol, Run};
use host_fit::simulate::random::{Purpose, Stream};
use host_fit::simulate::sensors::SensorErrors;
use host_fit::solver::estimator::field::FieldFit;
use host_fit::solver::estimator::paper::Parameters;
use host_fit::solver::estimator::parameters::FieldParameters;
use host_fit::solver::estimator::probe::probes;
use host_fit::solver::estimator::terms::TERMS;
use runtime::{RawFrame, VerticalPose};

const PERIOD_S: f64 = 0.002;
/// One pose in this number of rows of a service log is judged.
const POSE_STRIDE: usize = 40;

/// The runs of a share of the logs.
fn runs(logs: u64) -> impl Iterator<Item = (u64, Run)> {
    let planned = |run: &PlannedRun| Run::planned(run.trajectory(PERIOD_S));
    let run = move |seed: u64| match seed % 10 {
        0..5 => planned(&RUN_8),
        5..8 => planned(&RUN_30),
        _ => Protocol::Combined.run(PERIOD_S, seed),
    };
    (0..logs).map(move |seed| (seed, run(seed)))
}

/// Parameters drawn from the prior. Parameters without a prior are drawn near the values of usual stages.
fn drawn(stage: &Stage, random: &mut Stream) -> FieldParameters {
    let start = Parameters::designed(stage);
    let mut parameters = FieldParameters::from_model_31(&start, stage);
    // x, y of the probes.
    for (values, [x, y]) in parameters.probes.iter_mut().zip(stage.places_m()) {
        let eta = random.between(0.67, 0.93);
        let a = eta * random.between(-240.0, -210.0);
        values[0] += random.normal(2e-3);
        values[1] = random.normal(5e-3);
        values[2..6].copy_from_slice(&[eta, a, a * y, -a * x]);
        for (value, term) in values.iter_mut().zip(TERMS) {
            if let Some(prior) = term.prior {
                *value = random.normal(prior);
            }
        }
    }
    parameters
}

/// The log of a run by the field model, with white noise of the probes, resets and drift of the reference.
fn model_log(truth: &FieldParameters, run: &Run, random: &mut Stream) -> Dataset {
    let errors = SensorErrors::USUAL;
    let probes = probes(truth);
    let mut dataset = Dataset::default();
    for (movement, poses) in run.movements.iter().enumerate() {
        let start = dataset.rows.len();
        let mut error = errors.reset.map(|deviation| random.normal(deviation));
        for (row, pose) in poses.iter().enumerate() {
            let signal_m = probes.map(|probe| {
                let signal = probe.signal_m(pose.planar, pose.vertical);
                signal + random.normal(errors.hall_m)
            });
            dataset.rows.push(Row {
                movement,
                t_us: (row as f64 * PERIOD_S * 1e6).round() as i64,
                frame: LoggedFrame::from(RawFrame::new([0; 3], [0; 3], 0, 0)),
                signal_m,
                vertical: pose.vertical,
                reference: [0, 1, 2].map(|k| pose.planar[k] + error[k]),
            });
            for (error, drift) in error.iter_mut().zip(errors.drift_per_root_s) {
                *error += random.normal(drift * PERIOD_S.sqrt());
            }
        }
        dataset.movements.push(Movement {
            log: 0,
            index: movement as i64,
            rows: start..dataset.rows.len(),
        });
    }
    dataset.end_log("made");
    dataset
}

/// Parameters fitted to logs made by the field model.
fn parameters(stage: &Stage, logs: u64) -> Fallible<Coverage> {
    let mut parameters = Coverage::default();
    for (seed, run) in runs(logs) {
        let truth = drawn(stage, &mut Stream::new(seed, Purpose::Assembly, 1));
        let random = &mut Stream::new(seed, Purpose::Sensors, 9);
        let fit = field(&model_log(&truth, &run, random), stage)?;
        let errors = fit.posterior.standard_errors();
        let (found, known) = (
            fit.parameters.probes.as_flattened(),
            truth.probes.as_flattened(),
        );
        for ((found, known), error) in found.iter().zip(known).zip(errors) {
            parameters.add(found - known, error * error);
        }
    }
    Ok(parameters)
}

/// Judges a pose; its signals have the noise of the probes.
fn add_pose(
    poses: &mut Coverage,
    fit: &FieldFit,
    pose: &StagePose,
    signals_m: [f64; 3],
) -> Option<()> {
    let constants = fit.parameters.constants(1.0)?;
    let expected = fit.posterior.at_pose(pose.planar, pose.vertical)?;
    let vertical = VerticalPose::from_array(pose.vertical);
    let found = constants.decode(signals_m, &vertical).to_array();
    for (axis, found) in found.into_iter().enumerate() {
        let variance = expected.systematic[(axis, axis)] + expected.noise[(axis, axis)];
        poses.add(found - pose.planar[axis], variance);
    }
    Some(())
}

/// Poses by fits to logs of simulated stages.
fn poses(stage: &Stage, logs: u64) -> Fallible<Coverage> {
    let mut poses = Coverage::default();
    for (seed, run) in runs(logs) {
        let twin = Twin::new(stage, seed);
        let fit = field(&twin.log(run), stage)?;
        let service = Protocol::Service.run(PERIOD_S, seed).movements.concat();
        let mut random = Stream::new(seed, Purpose::Sensors, 9);
        for pose in service.iter().skip(POSE_STRIDE / 2).step_by(POSE_STRIDE) {
            let exact = twin.assembly.probes.map(|probe| probe.signal_m(pose));
            let noisy = exact.map(|s| s + random.normal(SensorErrors::USUAL.hall_m));
            add_pose(&mut poses, &fit, pose, noisy);
        }
    }
    Ok(poses)
}

fn main() -> Fallible<()> {
    // Cargo passes `--bench`.
    let logs = std::env::args().skip(1).find_map(|a| a.parse().ok());
    let logs: u64 = logs.unwrap_or(200);
    let stage = shipped::stage();
    println!("truth within 95 % intervals (rms error over standard error), {logs} logs");
    println!(
        "parameters, logs made by the field model: {}",
        parameters(&stage, logs)?.words()
    );
    println!(
        "poses, logs of simulated stages: {}",
        poses(&stage, logs)?.words()
    );
    Ok(())
}
