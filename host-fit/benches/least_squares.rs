//! What the main job costs, and why the least-squares solver is our own: the same problem by the
//! `levenberg-marquardt` crate, which keeps the Jacobian of every row in memory.
//!
//! Prints `RESULT key=value` lines, medians of several runs.

use host_fit::fit::{FitSettings, ModelChoice, fit};
use host_fit::input::log;
use host_fit::input::shipped::RUN_GZ;
use host_fit::input::stage::Stage;
use host_fit::problem::Problem;
use host_fit::problem::draw::{Draw, draw_rows};
use host_fit::problem::model::{Model, SLOPES_MAX};
use host_fit::simulate::assembly::Assembly;
use host_fit::simulate::log_text::log_csv;
use host_fit::simulate::protocol::Protocol;
use host_fit::simulate::recording::record;
use host_fit::simulate::sensors::SensorErrors;
use host_fit::solve::least_squares::normal::{Point, best_gain};
use host_fit::solve::least_squares::scatter::{Offset, Q, Ratios, U, mean, regressors, scatter};
use host_fit::solve::{Projection, Solver, SolverOptions};
use levenberg_marquardt::{LeastSquaresProblem, LevenbergMarquardt};
use nalgebra::{DVector, Dyn, Matrix3, OVector, Owned, U18};
use runtime::ModelKind;
use std::path::Path;
use std::time::Instant;

/// Median time of `runs` calls, ms.
fn median_ms(runs: usize, mut call: impl FnMut()) -> f64 {
    let mut times: Vec<f64> = (0..runs)
        .map(|_| {
            let started = Instant::now();
            call();
            started.elapsed().as_secs_f64() * 1e3
        })
        .collect();
    times.sort_by(f64::total_cmp);
    times[runs / 2]
}

/// The residuals with the offsets projected out, for the crate: 18 unknowns (G, r).
struct Crate<'p> {
    problem: &'p Problem<'p>,
    x: OVector<f64, U18>,
}

impl Crate<'_> {
    fn point(&self) -> Point {
        let mut ratios = [[0.0; SLOPES_MAX]; 3];
        for (probe, ratios) in ratios.iter_mut().enumerate() {
            ratios[..3].copy_from_slice(&self.x.as_slice()[9 + 3 * probe..][..3]);
        }
        Point {
            gain: Matrix3::from_fn(|i, j| self.x[3 * i + j]),
            ratios,
        }
    }

    /// The centred regressors of every row.
    fn each(&self, ratios: &Ratios, mut take: impl FnMut(usize, &[f64])) {
        for group in &self.problem.groups {
            let rows = &self.problem.rows[group.rows.clone()];
            let mean = mean(rows, ratios).expect("no pole");
            for (k, row) in rows.iter().enumerate() {
                let mut z = regressors(row, ratios).expect("no pole");
                z.iter_mut().zip(mean).for_each(|(z, mean)| *z -= mean);
                take(group.rows.start + k, &z);
            }
        }
    }
}

impl LeastSquaresProblem<f64, Dyn, U18> for Crate<'_> {
    type ParameterStorage = Owned<f64, U18>;
    type ResidualStorage = Owned<f64, Dyn>;
    type JacobianStorage = Owned<f64, Dyn, U18>;

    fn set_params(&mut self, x: &OVector<f64, U18>) {
        self.x = *x;
    }
    fn params(&self) -> OVector<f64, U18> {
        self.x
    }
    fn residuals(&self) -> Option<DVector<f64>> {
        let point = self.point();
        let mut out = DVector::zeros(3 * self.problem.rows.len());
        self.each(&point.ratios, |row, z| {
            for axis in 0..3 {
                let decoded: f64 = (0..3).map(|k| point.gain[(axis, k)] * z[k]).sum();
                out[3 * row + axis] = decoded - z[Q + axis];
            }
        });
        Some(out)
    }
    fn jacobian(&self) -> Option<nalgebra::OMatrix<f64, Dyn, U18>> {
        let point = self.point();
        let mut out = nalgebra::OMatrix::<f64, Dyn, U18>::zeros(3 * self.problem.rows.len());
        self.each(&point.ratios, |row, z| {
            for axis in 0..3 {
                for k in 0..3 {
                    out[(3 * row + axis, 3 * axis + k)] = z[k];
                }
                for k in 0..9 {
                    out[(3 * row + axis, 9 + k)] =
                        point.gain[(axis, k / 3)] * z[U + k / 3 * SLOPES_MAX + k % 3];
                }
            }
        });
        Some(out)
    }
}

fn compare(name: &str, problem: &Problem, runs: usize) {
    let options = SolverOptions::new(Projection::Linear, 1);
    let mut cost = 0.0;
    let ours = median_ms(runs, || {
        cost = Solver::LeastSquares
            .solve(problem, &options)
            .expect("a solution")
            .cost;
    });
    println!("RESULT least_squares_{name}_ms={ours:.3}");
    let ratios = [[0.0; SLOPES_MAX]; 3];
    let offsets = vec![Offset::Free; problem.groups.len()];
    let sums = scatter(problem, &ratios, &offsets).expect("no pole");
    let gain = best_gain(&sums).expect("a gain");
    // No slopes to begin with.
    let x = OVector::<f64, U18>::from_fn(|k, _| if k < 9 { gain[(k / 3, k % 3)] } else { 0.0 });
    let mut theirs_cost = 0.0;
    let theirs = median_ms(runs.min(5), || {
        let (_, report) = LevenbergMarquardt::new().minimize(Crate { problem, x });
        theirs_cost = 2.0 * report.objective_function;
    });
    println!("RESULT levenberg_marquardt_crate_{name}_ms={theirs:.3}");
    println!(
        "RESULT cost_difference_{name}={:.1e}",
        (cost / theirs_cost - 1.0).abs()
    );
}

fn main() {
    let stage = Stage::from_toml(host_fit::input::shipped::STAGE_TOML, "stage.toml".as_ref())
        .expect("the shipped stage");
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("log.csv.gz");
    std::fs::write(&path, host_fit::input::shipped::LOG_GZ).expect("written");
    let read = || {
        log::read(
            std::slice::from_ref(&path),
            &stage,
            &log::ReadOptions::default(),
        )
        .expect("read")
    };
    println!(
        "RESULT read_57000_rows_ms={:.1}",
        median_ms(9, || drop(read()))
    );
    let dataset = read().dataset;
    let settings = FitSettings::new(ModelChoice::Named(Model::of(ModelKind::M31)));
    let whole = median_ms(9, || {
        fit(&dataset, &stage, &settings).expect("a fit");
    });
    println!("RESULT fit_and_judge_57000_rows_ms={whole:.1}");
    let all: Vec<usize> = (0..dataset.rows.len()).collect();
    compare(
        "57000_rows",
        &Problem::new(&dataset, &all, &stage, Model::of(ModelKind::M31)),
        9,
    );
    let some = draw_rows(&dataset, 200, Draw::Stratified, 1);
    compare(
        "200_rows",
        &Problem::new(&dataset, &some, &stage, Model::of(ModelKind::M31)),
        51,
    );
    field_model(&stage, folder.path(), &settings);
}

/// The field model with its covariance, fitted and judged: to the run that ships, and to the paper's
/// protocol and the combined one of a simulated stage together.
fn field_model(stage: &Stage, folder: &Path, settings: &FitSettings) {
    let settings = FitSettings {
        model: ModelChoice::Named(Model::of(ModelKind::Field)),
        ..settings.clone()
    };
    let run = folder.join("run30.csv.gz");
    std::fs::write(&run, RUN_GZ).expect("written");
    let assembly = Assembly::draw(stage, 1);
    let both = [Protocol::Paper, Protocol::Combined].map(|protocol| {
        let run = protocol.run(stage.servo_period_s, 1);
        let recording = record(stage, &assembly, run, &SensorErrors::USUAL, 1).expect("clear");
        let path = folder.join(format!("{protocol:?}.csv"));
        std::fs::write(&path, log_csv(&recording, stage)).expect("written");
        path
    });
    for paths in [&[run][..], &both] {
        let log = log::read(paths, stage, &log::ReadOptions::default()).expect("read");
        let ms = median_ms(9, || {
            fit(&log.dataset, stage, &settings).expect("a fit");
        });
        println!(
            "RESULT fit_field_model_{}_rows_ms={ms:.1}",
            log.dataset.rows.len()
        );
    }
}
