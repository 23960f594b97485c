//! What a planned run of 20 s leads to on stages of unknown assembly: 20 simulated stages run it,
//! are fitted, and are judged by their service against the truth, beside the forecast.
//!
//! The floor of a stage is what parameters fitted to its own service truth leave. Prints a table
//! and `RESULT key=value` lines.

use host_fit::input::dataset::Dataset;
use host_fit::input::shipped::STAGE_TOML;
use host_fit::input::stage::Stage;
use host_fit::plan::plan;
use host_fit::problem::Problem;
use host_fit::problem::model::Model;
use host_fit::simulate::assembly::Assembly;
use host_fit::simulate::protocol::{Protocol, Run};
use host_fit::simulate::recording::{Recording, record};
use host_fit::simulate::sensors::SensorErrors;
use host_fit::solve::field::fit::fit_field;
use host_fit::solve::field::parameters::FieldParameters;
use host_fit::solve::{Projection, Solver, SolverOptions};
use runtime::{ModelKind, VerticalPose};
use std::path::Path;
use std::time::Instant;

const SECONDS: f64 = 20.0;
const SEEDS: u64 = 20;

fn main() {
    let stage = Stage::from_toml(STAGE_TOML, Path::new("stage.toml")).expect("a sound stage");
    let started = Instant::now();
    let plan = plan(&stage, SECONDS).expect("a plan");
    println!(
        "RESULT plan_ms={:.1}",
        started.elapsed().as_secs_f64() * 1e3
    );
    let trajectory = plan.run.trajectory(stage.servo_period_s);
    let predicted = plan.forecast.service.ratios();

    println!("seed  rms in service (um, um, urad)   floor                  rms over floor");
    let mut worst = [0.0f64; 3];
    let mut sum = [0.0; 3];
    for seed in 1..=SEEDS {
        let assembly = Assembly::draw(&stage, seed);
        let run = |run: Run| {
            let recording = record(&stage, &assembly, run, &SensorErrors::USUAL, seed);
            let recording = recording.expect("no probe hits its magnet");
            let dataset = recording.dataset(&stage).expect("a plane");
            (recording, dataset)
        };
        let (_, log) = run(Run::planned(trajectory.clone()));
        let (service, decoded) = run(Protocol::Service.run(stage.servo_period_s, seed));
        let found = rms(&fitted(&log, &stage), &service, &decoded);
        let floor = rms(
            &fitted(&with_truth(&service, &decoded), &stage),
            &service,
            &decoded,
        );
        let ratio = [0, 1, 2].map(|k| found[k] / floor[k]);
        let words = |[x, y, rz]: [f64; 3], digits: usize| {
            format!("{x:7.digits$} {y:7.digits$} {rz:7.digits$}")
        };
        println!(
            "{seed:4}  {}        {}  {}",
            words(found, 4),
            words(floor, 4),
            words(ratio, 4)
        );
        for k in 0..3 {
            worst[k] = worst[k].max(ratio[k]);
            sum[k] += ratio[k];
        }
    }
    for (k, axis) in ["x", "y", "rz"].into_iter().enumerate() {
        println!(
            "RESULT service_over_floor_{axis}_predicted={:.4}",
            predicted[k]
        );
        println!(
            "RESULT service_over_floor_{axis}_mean={:.4}",
            sum[k] / SEEDS as f64
        );
        println!("RESULT service_over_floor_{axis}_worst={:.4}", worst[k]);
    }
}

/// The field model of a log.
fn fitted(log: &Dataset, stage: &Stage) -> FieldParameters {
    let all: Vec<usize> = (0..log.rows.len()).collect();
    let problem = Problem::new(log, &all, stage, Model::of(ModelKind::M31));
    let options = SolverOptions::new(Projection::Linear, 1);
    let start = Solver::LeastSquares.solve(&problem, &options);
    let start = start.expect("Model (31)").parameters;
    fit_field(log, &all, stage, &start)
        .expect("the field model")
        .parameters
}

/// A log whose reference is the truth.
fn with_truth(recording: &Recording, log: &Dataset) -> Dataset {
    let mut log = log.clone();
    for (row, truth) in log.rows.iter_mut().zip(recording.truth.iter().flatten()) {
        row.reference = truth.planar;
    }
    log
}

/// rms error of X, Y, Rz against the truth, um, um, urad.
fn rms(parameters: &FieldParameters, recording: &Recording, log: &Dataset) -> [f64; 3] {
    let constants = parameters.constants(1.0).expect("a regular PM");
    let mut squares = [0.0; 3];
    for (row, truth) in log.rows.iter().zip(recording.truth.iter().flatten()) {
        let vertical = VerticalPose::from_array(row.vertical);
        let pose = constants.decode(row.signal_m, &vertical).to_array();
        for (axis, sum) in squares.iter_mut().enumerate() {
            let error = (pose[axis] - truth.planar[axis]) * 1e6;
            *sum += error * error;
        }
    }
    squares.map(|sum: f64| (sum / log.rows.len() as f64).sqrt())
}
