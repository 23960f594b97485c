//! How often the truth lies in the 95 % intervals of a fit of the field model, over simulated logs.
//!
//! `cargo bench -p host-fit --bench coverage [-- LOGS]`: about 200 logs by default, minutes.
//!
//! Parameters have a truth only in logs that the field model itself makes; poses have one in logs
//! of a stage made of physics as well, where the model is not exact.

mod common;

use common::{Coverage, Fallible, RUN_8, RUN_30, Twin};
use host_fit::calibration::plan::run::PlannedRun;
use host_fit::input::dataset::{Dataset, LoggedFrame, Movement, Row};
use host_fit::input::shipped;
use host_fit::input::stage::Stage;
use host_fit::simulate::pose::StagePose;
use host_fit::simulate::protocol::{Protocol, Run, Trajectory};
use host_fit::simulate::random::{Purpose, Stream};
use host_fit::simulate::sensors::SensorErrors;
use host_fit::solver::problem::Problem;
use host_fit::solver::problem::model::Model;
use host_fit::solver::problem::parameters::Parameters;
use host_fit::solver::solve::field::fit::{FieldFit, fit_field};
use host_fit::solver::solve::field::parameters::FieldParameters;
use host_fit::solver::solve::field::probe::probes;
use host_fit::solver::solve::field::terms::TERMS;
use host_fit::solver::solve::{Projection, Solver, SolverOptions};
use runtime::{ModelKind, RawFrame, VerticalPose};
use std::f64::consts::TAU;

const PERIOD_S: f64 = 0.002;
/// Every this many rows of a service log a pose is judged.
const POSE_STRIDE: usize = 40;

/// What is run to be fitted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Motion {
    EightSeconds,
    ThirtySeconds,
    Combined,
}

impl Motion {
    const fn name(self) -> &'static str {
        match self {
            Self::EightSeconds => "8 s",
            Self::ThirtySeconds => "30 s",
            Self::Combined => "combined",
        }
    }

    fn run(self, seed: u64) -> Run {
        match self {
            Self::EightSeconds => Run::planned(sines(&RUN_8)),
            Self::ThirtySeconds => Run::planned(sines(&RUN_30)),
            Self::Combined => Protocol::Combined.run(PERIOD_S, seed),
        }
    }
}

/// A run whose ends rise as 3 x^2 - 2 x^3: those of plans rise more smoothly.
fn sines(run: &PlannedRun) -> Trajectory {
    let pose = |row: u32| {
        let t_s = f64::from(row) * PERIOD_S;
        let end = (t_s.min(run.seconds - t_s) / run.taper_s).clamp(0.0, 1.0);
        let taper = end * end * (3.0 - 2.0 * end);
        let at = |k: usize| {
            let phase = TAU * run.cycles[k] * t_s / run.seconds + 1.7 * k as f64;
            run.amplitudes[k] * taper * libm::sin(phase)
        };
        StagePose {
            planar: [at(0), at(1), at(2)],
            vertical: [at(3), at(4), at(5)],
        }
    };
    let rows = (run.seconds / PERIOD_S).round() as u32;
    (0..rows).map(pose).collect()
}

/// Parameters drawn from the prior; those without one near what the stages at hand have.
fn drawn(stage: &Stage, random: &mut Stream) -> FieldParameters {
    let start = Parameters::designed(stage);
    let mut parameters = FieldParameters::of_model_31(&start, stage);
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

/// The log of a run as the field model has it: its signals, white noise at the probes, resets and
/// drift of the reference.
fn model_log(truth: &FieldParameters, run: &Run, random: &mut Stream) -> Dataset {
    let errors = SensorErrors::USUAL;
    let probes = probes(truth);
    let mut dataset = Dataset::default();
    for (movement, poses) in run.movements.iter().enumerate() {
        let start = dataset.rows.len();
        let mut error = errors.reset.map(|deviation| random.normal(deviation));
        for (row, pose) in poses.iter().enumerate() {
            let signal_m = probes.map(|probe| {
                let read = probe.signal_mm(pose.planar.map(|x| x * 1e3), pose.vertical) * 1e-3;
                read + random.normal(errors.hall_m)
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

/// The field model, from Model (31) by least squares: logs that the field model makes have no codes to judge.
fn field(dataset: &Dataset, stage: &Stage) -> Fallible<FieldFit> {
    let all: Vec<usize> = (0..dataset.rows.len()).collect();
    let problem = Problem::new(dataset, &all, stage, Model::of(ModelKind::M31));
    let options = SolverOptions::new(Projection::Linear, 1);
    let start = Solver::LeastSquares.solve(&problem, &options)?.parameters;
    Ok(fit_field(dataset, &all, stage, &start)?)
}

/// Logs that the field model makes: parameters.
fn of_the_model(stage: &Stage, motion: Motion, logs: u64) -> Fallible<Coverage> {
    let mut parameters = Coverage::default();
    for seed in 0..logs {
        let truth = drawn(stage, &mut Stream::new(seed, Purpose::Assembly, 1));
        let random = &mut Stream::new(seed, Purpose::Sensors, 9);
        let fit = field(&model_log(&truth, &motion.run(seed), random), stage)?;
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

/// Judges a pose: with the noise of the probes in its signals.
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

/// Logs of stages made of physics: poses.
fn of_physics(stage: &Stage, motion: Motion, logs: u64) -> Fallible<Coverage> {
    let mut poses = Coverage::default();
    for seed in 0..logs {
        let twin = Twin::new(stage, seed);
        let log = twin.record(motion.run(seed));
        let fit = field(&log.dataset(stage).ok_or("no plane")?, stage)?;
        let service = Protocol::Service.run(PERIOD_S, seed);
        let mut random = Stream::new(seed, Purpose::Sensors, 9);
        for pose in service
            .movements
            .iter()
            .flatten()
            .skip(POSE_STRIDE / 2)
            .step_by(POSE_STRIDE)
        {
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
    let shares = [
        (Motion::EightSeconds, logs / 2),
        (Motion::ThirtySeconds, logs * 3 / 10),
        (Motion::Combined, logs / 5),
    ];
    println!("truth within 95 % intervals (rms error over standard error)");
    println!("logs made by the field model");
    let mut parameters = Coverage::default();
    for (motion, logs) in shares {
        let of_parameters = of_the_model(&stage, motion, logs)?;
        let title = format!("{}, {logs} logs: parameters", motion.name());
        println!("  {title:<34}{}", of_parameters.words());
        parameters = parameters.and(of_parameters);
    }
    println!("  {:<34}{}", "all: parameters", parameters.words());
    println!("logs of stages made of physics");
    let mut poses = Coverage::default();
    for (motion, logs) in shares {
        let of_poses = of_physics(&stage, motion, logs)?;
        let title = format!("{}, {logs} logs: poses", motion.name());
        println!("  {title:<34}{}", of_poses.words());
        poses = poses.and(of_poses);
    }
    println!("  {:<34}{}", "all: poses", poses.words());

    Ok(())
}
