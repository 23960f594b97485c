//! Stages with probes or beams that stand or point elsewhere than in the paper: from `stage.toml` to a
//! calibration at the noise floor.

use crate::fit::{FitSettings, ModelChoice, fit};
use crate::service_for_tests::worst_ratio;
use hallstage_input::shipped::STAGE_TOML;
use hallstage_input::stage::Stage;
use hallstage_simulate::assembly::Assembly;
use hallstage_simulate::protocol::Protocol;
use hallstage_simulate::recording::record;
use hallstage_simulate::sensors::SensorErrors;
use hallstage_solver::estimator::model::Model;
use hallstage_solver::estimator::parameters::FieldParameters;
use runtime::{ModelKind, ParameterSet};

const SEED: u64 = 2;

/// The shipped stage with `changes` of its text.
fn stage(changes: &[(&str, &str)]) -> Stage {
    let text = changes
        .iter()
        .fold(STAGE_TOML.to_owned(), |text, (old, new)| {
            assert_eq!(text.matches(old).count(), 1, "{old}");
            text.replace(old, new)
        });
    Stage::from_toml(&text, "stage.toml".as_ref()).expect("sound")
}

/// Fits the field model to a log of a simulated stage that `declared` describes, reads its blob, and gives the rms error
/// in service, the noise of the probes included, over that noise alone: of the worst axis.
fn ratio_in_service(stage: &Stage, declared: &Stage) -> f64 {
    let assembly = Assembly::draw(stage, SEED);
    let run = Protocol::Combined.run(stage.servo_period_s, SEED);
    let log = record(stage, &assembly, run, &SensorErrors::USUAL, SEED).expect("clear");
    let dataset = log.dataset(declared).expect("a triangle");
    let settings = FitSettings::new(ModelChoice::Named(Model::from_kind(ModelKind::Field)));
    let fit = fit(&dataset, declared, &settings).expect("a fit");
    let mut buffer = [0; runtime::blob::MAX_BYTES];
    let blob = fit.set.to_bytes(&mut buffer).expect("room");
    let set = ParameterSet::from_bytes(blob).expect("a sound blob");
    let parameters = FieldParameters::from_set(&set, declared).expect("a field model");
    let constants = parameters.constants(1.0).expect("regular");
    let floor = [0, 1, 2].map(|axis| {
        let noise = |k: usize| {
            let eta = constants.probes[k].sensitivity.eta;
            (constants.pose_rows[axis][k] * SensorErrors::USUAL.hall_m / eta).powi(2)
        };
        (noise(0) + noise(1) + noise(2)).sqrt()
    });
    worst_ratio(&constants, &assembly, SEED, floor)
}

#[test]
fn a_stage_is_calibrated_to_the_noise_floor_wherever_its_probes_stand_and_point() {
    let code_max = "code_max = 32767\n\n[cap";
    let directions = |degrees| format!("code_max = 32767\ndirection_deg = {degrees}\n\n[cap");
    let all = directions("[-90, 100, 150]");
    let b_at_positive_x = [
        ("h2x_m = 0.1975", "h2x_m = -0.05"),
        ("h2x_m = [0.1475, 0.2475]", "h2x_m = [-0.10, 0.0]"),
        (
            "c_per_rad = [[0.0, 5000.0], [-5000.0, 0.0]",
            "c_per_rad = [[0.0, 5000.0], [0.0, 5000.0]",
        ),
    ];
    let stages: [(&str, &[(&str, &str)]); 2] = [
        ("B at positive x", &b_at_positive_x),
        ("all three turned", &[(code_max, &all)]),
    ];
    for (name, changes) in stages {
        let stage = stage(changes);
        let ratio = ratio_in_service(&stage, &stage);
        assert!(ratio < 1.02, "{name}: {ratio}");
    }
}

/// Beams that meet their mirrors 10 mm beside and above the tool point.
#[test]
fn arms_of_the_beams_cost_nothing_in_service_if_they_are_declared() {
    let baseline = "y_baseline_m = 0.10 ";
    let arms = |arm_m: f64| {
        let keys = format!(
            "x = {{ y_m = {arm_m}, z_m = {arm_m} }}\ny1 = {{ x_m = {}, z_m = {arm_m} }}\ny2 = {{ z_m = {arm_m} }}\n{baseline}",
            arm_m + 0.05
        );
        stage(&[(baseline, &keys)])
    };
    let simulated = arms(0.010);
    let declared = [simulated.clone(), arms(0.0102), stage(&[])];
    let [exact, near, none] = declared.map(|declared| ratio_in_service(&simulated, &declared));
    assert!(
        exact < 1.02 && near < 1.03 && none > 2.5,
        "{exact} {near} {none}"
    );
}
