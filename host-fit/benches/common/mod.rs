//! Shared by the benchmarks: simulated stages, fits to their logs, and errors against the truth.
#![allow(dead_code, reason = "each benchmark uses a part of it")]

use host_fit::calibration::fit::{Fit, FitSettings, ModelChoice, fit};
use host_fit::calibration::judge::{Decoded, Zeros};
use host_fit::calibration::plan::run::PlannedRun;
use host_fit::input::dataset::Dataset;
use host_fit::input::log::{ReadOptions, read_bytes};
use host_fit::input::stage::Stage;
use host_fit::simulate::assembly::Assembly;
use host_fit::simulate::protocol::Run;
use host_fit::simulate::recording::{Recording, record, record_in};
use host_fit::simulate::sensors::SensorErrors;
use host_fit::simulate::thermal::{Climate, Thermal};
use host_fit::solver::estimator::field::{FieldFit, fit_field};
use host_fit::solver::estimator::model::Model;
use host_fit::solver::estimator::problem::Problem;
use host_fit::solver::solve::{Projection, Solver, SolverOptions};
use runtime::{ModelKind, ParameterSet};
use std::error::Error;
use std::time::Instant;

pub type Fallible<T> = Result<T, Box<dyn Error>>;
/// X, Y, Rz.
pub type Axes = [f64; 3];

/// 95 % of normal numbers are within this many standard deviations.
const WITHIN: f64 = 1.959_964;

/// Runs of 30 s and 8 s.
pub const RUN_30: PlannedRun = run(30.0, [13.0, 17.0, 14.0, 19.0, 16.0, 11.0]);
pub const RUN_8: PlannedRun = run(8.0, [5.0, 8.0, 7.0, 6.0, 4.0, 7.5]);

const fn run(seconds: f64, cycles: [f64; 6]) -> PlannedRun {
    PlannedRun {
        tones: [0.0; 6],
        seconds,
        taper_s: 0.5,
        amplitudes: [500e-6, 800e-6, 500e-6, 240e-6, 480e-6, 480e-6],
        cycles,
    }
}

/// The rows of a log in memory.
pub fn read(log: &[u8], stage: &Stage) -> Fallible<Dataset> {
    Ok(read_bytes(log, "log".as_ref(), stage, &ReadOptions::default())?.dataset)
}

/// A simulated stage.
pub struct Twin<'a> {
    pub stage: &'a Stage,
    pub seed: u64,
    pub assembly: Assembly,
    pub thermal: Thermal,
}

impl<'a> Twin<'a> {
    pub fn new(stage: &'a Stage, seed: u64) -> Self {
        Self {
            stage,
            seed,
            assembly: Assembly::draw(stage, seed),
            thermal: Thermal::draw(seed),
        }
    }

    /// The recording of a run at the temperature of assembly.
    pub fn record(&self, run: Run) -> Recording {
        let errors = &SensorErrors::USUAL;
        let recording = record(self.stage, &self.assembly, run, errors, self.seed);
        recording.expect("no probe hits its magnet")
    }

    /// The log of a run at the temperature of assembly.
    pub fn log(&self, run: Run) -> Dataset {
        dataset(&self.record(run), self.stage)
    }

    /// The recording of a run in a climate.
    pub fn record_in(&self, run: Run, climate: Climate) -> Recording {
        let (parts, errors) = ((&self.assembly, &self.thermal), &SensorErrors::USUAL);
        let recording = record_in(self.stage, parts, climate, run, errors, self.seed);
        recording.expect("no probe hits its magnet")
    }
}

pub fn dataset(recording: &Recording, stage: &Stage) -> Dataset {
    let dataset = recording.dataset(stage);
    dataset.expect("a checked stage has no capacitive sensors in a line")
}

pub fn fitted(dataset: &Dataset, stage: &Stage, kind: ModelKind) -> Fallible<Fit> {
    let model = ModelChoice::Named(Model::from_kind(kind));
    Ok(fit(dataset, stage, &FitSettings::new(model))?)
}

/// The field model, started from Model (31). (Logs made by the field model have no codes to judge.)
pub fn field(dataset: &Dataset, stage: &Stage) -> Fallible<FieldFit> {
    let all: Vec<usize> = (0..dataset.rows.len()).collect();
    let problem = Problem::new(dataset, &all, stage, Model::from_kind(ModelKind::M31));
    let options = SolverOptions::new(Projection::Linear, 1);
    let start = Solver::LeastSquares.solve(&problem, &options)?.parameters;
    Ok(fit_field(dataset, &all, stage, &start)?)
}

/// rms errors of the decoded poses of a log, m, m, rad; the reference of the log is the truth.
pub fn rms(set: &ParameterSet, truth: &Dataset, stage: &Stage) -> Axes {
    let judged = Decoded::new(set, truth).judge(truth, stage, Zeros::None);
    judged.errors.axes.map(|axis| axis.rms)
}

/// Errors over their standard errors, and the number within 95 % intervals.
#[derive(Clone, Copy, Debug, Default)]
pub struct Coverage {
    within: u64,
    pub count: u64,
    squares: f64,
    scaled: f64,
}

impl Coverage {
    pub fn add(&mut self, error: f64, variance: f64) {
        let scaled = error * error / variance;
        self.within += u64::from(scaled <= WITHIN * WITHIN);
        self.count += 1;
        self.squares += error * error;
        self.scaled += scaled;
    }

    fn mean_root(&self, sum: f64) -> f64 {
        (sum / self.count.max(1) as f64).sqrt()
    }

    pub fn rms(&self) -> f64 {
        self.mean_root(self.squares)
    }

    /// Per cent within the intervals, and the rms error over the standard error.
    pub fn words(&self) -> String {
        let percent = 100.0 * self.within as f64 / self.count.max(1) as f64;
        format!("{percent:5.1} % ({:.2})", self.mean_root(self.scaled))
    }
}

pub fn median(mut numbers: Vec<f64>) -> f64 {
    numbers.sort_by(f64::total_cmp);
    let middle = numbers.len() / 2;
    match numbers.len() % 2 {
        0 => 0.5 * (numbers[middle - 1] + numbers[middle]),
        _ => numbers[middle],
    }
}

/// The mean and the worst of some stages.
pub fn mean_and_worst(stages: &[Axes]) -> [Axes; 2] {
    let axis = |axis: usize| stages.iter().map(move |values| values[axis]);
    [
        [0, 1, 2].map(|k| axis(k).sum::<f64>() / stages.len() as f64),
        [0, 1, 2].map(|k| axis(k).fold(0.0, f64::max)),
    ]
}

/// X, Y and Rz of a table.
pub fn words(axes: Axes) -> String {
    axes.map(|x| format!("{x:7.4}")).join(" ")
}

/// Median time of some calls, s.
pub fn median_s(calls: usize, mut call: impl FnMut()) -> f64 {
    let time = |_| {
        let started = Instant::now();
        call();
        started.elapsed().as_secs_f64()
    };
    median((0..calls).map(time).collect())
}
