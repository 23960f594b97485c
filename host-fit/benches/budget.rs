//! The uncertainty budget against the errors of simulated stages. Their reference, gaps and gains are drawn from the declared
//! uncertainties.
//!
//! `cargo bench -p host-fit --bench budget [-- STAGES]`: 200 by default, two minutes.
//!
//! The declared uncertainties are larger than usual, so that they are most of the errors. Prints by axis the share of 95 %
//! intervals that hold the truth, and the combined uncertainty over the errors, rms.

mod common;

use common::{Coverage, Fallible, RUN_8, field};
use host_fit::calibration::budget::Budget;
use host_fit::calibration::judge::predicted::{Predicted, declared_service};
use host_fit::input::axis::PLANAR;
use host_fit::input::shipped::STAGE_TOML;
use host_fit::input::stage::{Input, Stage};
use host_fit::simulate::assembly::Assembly;
use host_fit::simulate::protocol::{Protocol, Run};
use host_fit::simulate::random::{Purpose, Stream};
use host_fit::simulate::recording::record;
use host_fit::simulate::sensors::SensorErrors;
use host_fit::solver::estimator::terms::COUNT;
use nalgebra::Vector3;
use runtime::capacitive::{gaps_m, vertical_per_gap};
use runtime::{Temperature, VerticalPose};

const PERIOD_S: f64 = 0.002;
/// One pose in this number of rows of a service log is judged.
const POSE_STRIDE: usize = 40;
const BASELINE: &str = "y_baseline_m = 0.10 ";
const PLACES: &str = "probes_m = [[0.12, 0.0], [-0.12, 0.0], [0.0, -0.12]]";
const GAP_SCALE: f64 = 1.5625e-8;
/// Standard uncertainties in place of the lines of the shipped file.
const DECLARED: [(Input, f64); 7] = [
    (Input::GapPlaces, 0.5e-3),
    (Input::GapScale, 5e-3),
    (Input::BeamScale, 1000.0),
    (Input::Baseline, 1e-3),
    (Input::BeamPlaces, 2e-3),
    (Input::BeamAngles, 1.5e-3),
    (Input::Drift, 1e-3),
];

fn stage(text: &str) -> Fallible<Stage> {
    Ok(Stage::from_toml(text, "stage.toml".as_ref())?)
}

/// The shipped stage file with the declared uncertainties.
fn declared() -> String {
    let (head, tail) = STAGE_TOML
        .split_once("[uncertainty]")
        .unwrap_or((STAGE_TOML, ""));
    let (_, tail) = tail.split_once("[search]").unwrap_or(("", tail));
    let keys = DECLARED.map(|(input, u)| format!("{} = {u}\n", input.key()));
    format!("{head}[uncertainty]\n{}\n[search]{tail}", keys.concat())
}

/// A stage file with errors that are drawn from the uncertainties.
fn drawn(declared: &str, random: &mut Stream) -> String {
    let mut draw = |input: Input| {
        let (_, u) = DECLARED[DECLARED
            .iter()
            .position(|(of, _)| *of == input)
            .unwrap_or(0)];
        random.normal(u)
    };
    let baseline_m = 0.1 + draw(Input::Baseline);
    let [x, both, apart] = [0; 3].map(|_| 1e-6 * draw(Input::BeamScale));
    let apart = 0.5f64.sqrt() * apart;
    let [x, y1, y2] = [x, both + apart, both - apart].map(|part| 1.0 + part);
    let x1_m = 0.5 * baseline_m + draw(Input::BeamPlaces);
    let [x_y, x_z, y1_z, y2_z] = [0; 4].map(|_| draw(Input::BeamPlaces));
    let [a, b, c, d, e, f] = [0; 6].map(|_| draw(Input::BeamAngles));
    let beams = format!(
        "x = {{ y_m = {x_y}, z_m = {x_z}, towards_y_rad = {a}, towards_z_rad = {b} }}\n\
         y1 = {{ x_m = {x1_m}, z_m = {y1_z}, towards_x_rad = {c}, towards_z_rad = {d} }}\n\
         y2 = {{ z_m = {y2_z}, towards_x_rad = {e}, towards_z_rad = {f} }}\n\
         scale = [{x}, {y1}, {y2}]\ny_baseline_m = {baseline_m} "
    );
    let places = [0.12, 0.0, -0.12, 0.0, 0.0, -0.12].map(|m| m + draw(Input::GapPlaces));
    let [p, q, r] = [0, 2, 4].map(|k| [places[k], places[k + 1]]);
    let gaps = GAP_SCALE * (1.0 + draw(Input::GapScale));
    declared
        .replace(BASELINE, &beams)
        .replace(PLACES, &format!("probes_m = [{p:?}, {q:?}, {r:?}]"))
        .replace(
            "m_per_count = 1.5625e-8 ",
            &format!("m_per_count = {gaps:e} "),
        )
}

fn main() -> Fallible<()> {
    // Cargo passes `--bench`.
    let stages = std::env::args().skip(1).find_map(|a| a.parse().ok());
    let stages: u64 = stages.unwrap_or(200);
    let text = declared();
    let declared = stage(&text)?;
    let to_vertical = vertical_per_gap(&declared.capacitive_probes_m).ok_or("no plane")?;
    let mut coverage = [Coverage::default(); 3];
    let mut variances = [0.0; 3];
    for seed in 0..stages {
        let mut random = Stream::new(seed, Purpose::Sensors, 11);
        let actual = stage(&drawn(&text, &mut random))?;
        let gains = [0; 3].map(|_| 1.0 + random.normal(1e-3));
        let assembly = Assembly::draw(&declared, seed);
        let run = Run::planned(RUN_8.trajectory(PERIOD_S));
        let log = record(&actual, &assembly, run, &SensorErrors::USUAL, seed)?;
        let fit = field(&log.dataset(&declared).ok_or("no plane")?, &declared)?;
        let (parameters, posterior) = (&fit.parameters, &fit.posterior);
        let service =
            declared_service(&declared, parameters, posterior.white_m).ok_or("no pose")?;
        let predicted = Predicted::new(&service, &posterior.covariance, &[0.0; COUNT]);
        let known = (parameters, posterior);
        let budget = Budget::new(&declared, known, &Temperature::NONE, &predicted, 1);
        let budget = budget.ok_or("no budget")?;
        let constants = parameters.constants(1.0).ok_or("singular")?;
        let gap_scale = declared.capacitive.m_per_count / actual.capacitive.m_per_count;
        let poses = Protocol::Service.run(PERIOD_S, seed).movements.concat();
        for pose in poses.iter().skip(POSE_STRIDE / 2).step_by(POSE_STRIDE) {
            let signal = |k: usize| assembly.probes[k].signal_m(pose) * gains[k];
            let signals = [0, 1, 2].map(signal);
            let noisy = signals.map(|s| s + random.normal(SensorErrors::USUAL.hall_m));
            let vertical = VerticalPose::from_array(pose.vertical);
            let gaps = gaps_m(&actual.capacitive_probes_m, &vertical);
            let measured: [f64; 3] = (to_vertical * Vector3::from(gaps) * gap_scale).into();
            let vertical = VerticalPose::from_array(measured);
            let found = constants.decode(noisy, &vertical).to_array();
            let own = posterior.at_pose(found, measured).ok_or("no pose")?;
            let other = budget.variance_at(found, measured);
            for axis in 0..3 {
                let variance = own.systematic[(axis, axis)] + own.noise[(axis, axis)] + other[axis];
                coverage[axis].add(found[axis] - pose.planar[axis], variance);
                variances[axis] += variance;
            }
        }
    }
    println!(
        "truth within 95 % intervals (rms error over standard error); combined uncertainty over errors, {stages} stages"
    );
    for (axis, (coverage, variance)) in PLANAR.iter().zip(coverage.iter().zip(variances)) {
        let combined = (variance / coverage.count.max(1) as f64).sqrt();
        println!(
            "{}: {}; {:.3}",
            axis.name,
            coverage.words(),
            combined / coverage.rms()
        );
    }
    Ok(())
}
