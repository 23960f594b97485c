//! Properties of a plan, and its forecast against simulated stages.

use super::forecast::acceleration_error;
use super::run::PlannedRun;
use super::*;
use hallstage_input::dataset::Dataset;
use hallstage_input::shipped::STAGE_TOML;
use hallstage_simulate::assembly::Assembly;
use hallstage_simulate::pose::StagePose;
use hallstage_simulate::protocol;
use hallstage_simulate::recording::record;
use hallstage_simulate::sensors::SensorErrors;
use hallstage_solver::estimator::dynamics::ARMS_M;
use hallstage_solver::estimator::field::{FieldFit, fit_field};
use hallstage_solver::estimator::model::Model;
use hallstage_solver::estimator::problem::Problem;
use hallstage_solver::solve::{Projection, Solver, SolverOptions};
use runtime::{ModelKind, VerticalPose};
use std::sync::LazyLock;

const SECONDS: f64 = 8.0;

static STAGE: LazyLock<Stage> =
    LazyLock::new(|| Stage::from_toml(STAGE_TOML, "stage.toml".as_ref()).expect("sound"));
static FORECASTER: LazyLock<Forecaster> = LazyLock::new(|| forecaster(&STAGE).expect("poses"));
static PLAN: LazyLock<Plan> = LazyLock::new(|| plan(&STAGE, SECONDS).expect("a plan"));

/// Differences of neighbouring rows against the limits, ends and rest before and after included.
#[track_caller]
fn assert_within_limits(run: &PlannedRun, stage: &Stage) {
    let period_s = stage.servo_period_s;
    let mut poses = run.trajectory(period_s);
    assert_eq!(poses.first(), Some(&StagePose::default()));
    assert_eq!(poses[poses.len() - 1].to_array(), [0.0; 6]);
    poses.insert(0, StagePose::default());
    poses.push(StagePose::default());
    let (mut jerk, mut largest) = ([0.0f64; 6], [0.0f64; 6]);
    let mut before = [0.0; 6];
    for three in poses.windows(3) {
        let [a, b, c] = [&three[0], &three[1], &three[2]].map(StagePose::to_array);
        for (axis, limits) in stage.motion.axes.iter().enumerate() {
            assert!(b[axis].abs() <= limits.amplitude);
            let speed = (c[axis] - b[axis]) / period_s;
            assert!(speed.abs() <= limits.speed, "{axis}: {speed}");
            let acceleration = (c[axis] - 2.0 * b[axis] + a[axis]) / (period_s * period_s);
            assert!(
                acceleration.abs() <= 1.0001 * limits.acceleration,
                "{axis}: {acceleration}"
            );
            largest[axis] = largest[axis].max(acceleration.abs());
            jerk[axis] = jerk[axis].max((acceleration - before[axis]).abs());
            before[axis] = acceleration;
        }
    }
    // The acceleration does not jump: it takes many periods to rise.
    for (axis, (jerk, largest)) in jerk.iter().zip(largest).enumerate() {
        assert!(*jerk < 0.13 * largest, "{axis}: {jerk} {largest}");
        assert!(largest <= 1.01 * run.peaks(axis)[1], "{axis}: {largest}");
    }
}

#[test]
fn a_run_moves_every_axis_fully_within_its_limits_from_rest_to_rest() {
    let run = &PLAN.run;
    assert_within_limits(run, &STAGE);
    let poses = run.trajectory(STAGE.servo_period_s);
    assert_eq!(poses.len(), 4001);
    for (axis, limits) in STAGE.motion.axes.iter().enumerate() {
        let largest = poses
            .iter()
            .map(|pose| pose.to_array()[axis].abs())
            .fold(0.0, f64::max);
        assert!(largest > 0.99 * limits.service, "{axis}: {largest}");
    }
}

#[test]
fn the_frequencies_are_distinct() {
    let cycles = PLAN.run.cycles;
    let tones = run::TONES_HZ;
    assert!((1..6).all(|k| tones[..k].iter().all(|hz| (hz - tones[k]).abs() > 0.3)));
    for (k, a) in cycles.iter().enumerate() {
        assert!(
            cycles[..k].iter().all(|b| (a - b).abs() >= 0.5),
            "{cycles:?}"
        );
    }
}

/// The fastest run of a stage that must move gently needs longer ends.
#[test]
fn low_limits_make_slow_runs_with_long_ends() {
    let mut stage = STAGE.clone();
    for axis in &mut stage.motion.axes {
        (axis.speed, axis.acceleration) = (0.8 * axis.service, 2.0 * axis.service);
    }
    let (seconds, taper_s) = (60.0, 4.0);
    let fastest = |taper_s: f64| -> [Option<f64>; 6] {
        let motion = |axis: usize| &stage.motion.axes[axis];
        let allowed = |axis| search::allowed_cycles(motion(axis), axis, seconds, taper_s);
        std::array::from_fn(|axis| allowed(axis).last().copied())
    };
    assert_eq!(fastest(0.5)[1], None);
    let run = PlannedRun {
        seconds,
        taper_s,
        amplitudes: stage.motion.axes.map(|axis| axis.amplitude),
        cycles: fastest(taper_s).map(|cycles| cycles.expect("slow enough")),
        tones: [0.0; 6],
    };
    assert!(
        run.cycles.iter().all(|cycles| *cycles >= 5.0),
        "{:?}",
        run.cycles
    );
    assert_within_limits(&run, &stage);
}

/// The run `x2` of 30 s: the closed form of the standard errors is that of a fit with all other parameters.
#[test]
fn the_tones_of_a_usual_run_determine_what_acceleration_adds() {
    let run = PlannedRun {
        seconds: 30.0,
        taper_s: 0.5,
        amplitudes: STAGE.motion.axes.map(|axis| axis.amplitude),
        cycles: [13.0, 17.0, 14.0, 19.0, 16.0, 11.0],
        tones: [0.0; 6],
    }
    .with_tones(&STAGE.motion);
    let expected = [
        (40e-6, 0.07e-6),
        (40e-6, 0.06e-6),
        (120e-6, 0.06e-6),
        (30e-6, 0.14e-6),
        (100e-6, 0.10e-6),
        (100e-6, 0.08e-6),
    ];
    let mut peak = 0.0f64;
    for (axis, (tone, error)) in expected.into_iter().enumerate() {
        assert!((run.tones[axis] / tone - 1.0).abs() < 0.01, "{axis}");
        let found = acceleration_error(&run, axis, STAGE.servo_period_s);
        assert!((found - error).abs() < 0.01e-6, "{axis}: {found}");
        peak = peak.max(ARMS_M[axis] * run.peaks(axis)[1]);
    }
    assert!((0.105..0.115).contains(&peak), "{peak}");
    assert_within_limits(&run, &STAGE);
    let service = judged(&STAGE, &FORECASTER, run)
        .expect("a plan")
        .forecast
        .service;
    assert!(
        service.ratios().iter().all(|ratio| *ratio < 1.004),
        "{service:?}"
    );
}

#[test]
fn a_low_limit_reduces_the_tone_and_a_lower_one_removes_it() {
    let tone = |acceleration: f64| {
        let mut stage = STAGE.clone();
        stage.motion.axes[1].acceleration = acceleration;
        let run = plan(&stage, SECONDS).expect("a plan").run;
        assert_within_limits(&run, &stage);
        assert!(run.peaks(1)[1] <= acceleration * (1.0 + 1e-12));
        run.tones[1]
    };
    let unlimited = PLAN.run.tones[1];
    let low = tone(0.1);
    assert!((0.1..0.9).contains(&(low / unlimited)), "{low} {unlimited}");
    assert!(tone(0.02) < 0.2 * low);
    let run = PlannedRun {
        tones: [0.0; 6],
        ..PLAN.run
    };
    let error = acceleration_error(&run, 1, STAGE.servo_period_s);
    assert_eq!(error, f64::INFINITY);
}

#[test]
fn the_choice_does_not_depend_on_the_threads() {
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build();
    let again = one
        .expect("a thread")
        .install(|| plan(&STAGE, SECONDS).expect("a plan"));
    assert_eq!(again.run, PLAN.run);
    assert_eq!(again.forecast.service, PLAN.forecast.service);
}

#[test]
fn two_axes_at_one_frequency_are_refused() {
    let mut run = PLAN.run;
    (run.cycles[3], run.tones) = (run.cycles[1], [0.0; 6]);
    let error = judged(&STAGE, &FORECASTER, run).expect_err("refused");
    let PlanError::NotDetermined { ratios, .. } = error else {
        panic!("{error}");
    };
    let excess = |ratios: [f64; 3]| ratios.map(|r| r - 1.0).into_iter().fold(0.0, f64::max);
    let planned = excess(PLAN.forecast.service.ratios());
    assert!(excess(ratios) > 4.0 * planned, "{ratios:?} {planned}");
}

#[test]
fn what_cannot_identify_the_model_is_refused_with_a_remedy() {
    let says = |run: &PlannedRun, parts: &[&str]| {
        let message = judged(&STAGE, &FORECASTER, *run)
            .expect_err("refused")
            .to_string();
        for part in parts {
            assert!(message.contains(part), "{message}");
        }
    };
    let mut still = PLAN.run;
    (still.amplitudes[3], still.tones[3]) = (0.0, 0.0);
    says(
        &still,
        &["move z over their whole", "times the noise floor"],
    );
    let mut small = PLAN.run;
    small.amplitudes = small.amplitudes.map(|amplitude| 0.5 * amplitude);
    says(&small, &["move x, y, rz, z, rx, ry over their whole"]);
    let short = PlannedRun {
        seconds: 4.0,
        cycles: [2.5, 4.0, 3.0, 3.5, 2.0, 1.5],
        ..PLAN.run
    };
    says(
        &short,
        &["a run of 4 s does not determine", "make the run longer"],
    );
    let error = plan(&STAGE, 2.0).expect_err("refused");
    assert_eq!(error, PlanError::TooFewFrequencies { seconds: 2.0 });
    let mut stiff = STAGE.clone();
    stiff.motion.axes[4].speed = 1e-6;
    let message = plan(&stiff, SECONDS).expect_err("refused").to_string();
    assert!(
        message.contains("cannot move rx by 480.0 µrad"),
        "{message}"
    );
}

fn fitted(dataset: &Dataset) -> FieldFit {
    let all: Vec<usize> = (0..dataset.rows.len()).collect();
    let problem = Problem::new(dataset, &all, &STAGE, Model::from_kind(ModelKind::M31));
    let options = SolverOptions::new(Projection::Linear, 1);
    let start = Solver::LeastSquares
        .solve(&problem, &options)
        .expect("a fit");
    fit_field(dataset, &all, &STAGE, &start.parameters).expect("a fit")
}

/// The run on simulated stages: the predicted errors of the fits, and their true errors at poses all over
/// the range, agree with the forecast.
#[test]
fn the_forecast_is_what_fits_to_simulated_logs_give() {
    let forecast = &PLAN.forecast.service;
    let places: Vec<StagePose> = (0..400)
        .map(|k| {
            StagePose::from_array(std::array::from_fn(|axis| {
                let phase = f64::from(k) * (0.9 + 0.37 * axis as f64);
                STAGE.motion.axes[axis].service * 0.8 * libm::sin(phase)
            }))
        })
        .collect();
    let seeds = 2..=4;
    let mut found = [0.0; 3];
    for seed in seeds.clone() {
        let assembly = Assembly::draw(&STAGE, seed);
        let recorded = |poses: Vec<StagePose>, errors: &SensorErrors| {
            let run = protocol::Run::planned(poses);
            let recording = record(&STAGE, &assembly, run, errors, seed).expect("clear");
            recording.dataset(&STAGE).expect("a plane")
        };
        let trajectory = PLAN.run.trajectory(STAGE.servo_period_s);
        let fit = fitted(&recorded(trajectory, &SensorErrors::USUAL));
        let own = &fit.figures.comparison.service;
        for axis in 0..3 {
            let ratio = (own.systematic[axis] / own.noise[axis])
                / (forecast.systematic[axis] / forecast.noise[axis]);
            assert!((0.6..1.7).contains(&ratio), "seed {seed}, {axis}: {ratio}");
        }
        let constants = fit.parameters.constants(1.0).expect("sound");
        for (row, truth) in recorded(places.clone(), &SensorErrors::NONE)
            .rows
            .iter()
            .zip(&places)
        {
            let pose = constants.decode(row.signal_m, &VerticalPose::from_array(row.vertical));
            for (sum, (x, truth)) in found
                .iter_mut()
                .zip(pose.to_array().iter().zip(truth.planar))
            {
                *sum += (x - truth) * (x - truth);
            }
        }
    }
    let count = (places.len() * seeds.count()) as f64;
    for (axis, (found, forecast)) in found.iter().zip(forecast.systematic).enumerate() {
        let ratio = (found / count / forecast).sqrt();
        assert!((0.6..1.7).contains(&ratio), "{axis}: {ratio}");
    }
}
