//! Stages with probes that stand or point elsewhere than in the paper: from `stage.toml` to a
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

/// Fits the field model to a simulated log, reads its blob, and gives the rms error in service, the
/// noise of the probes included, over that noise alone: of the worst axis.
fn ratio_in_service(stage: &Stage) -> f64 {
    let assembly = Assembly::draw(stage, SEED);
    let run = Protocol::Combined.run(stage.servo_period_s, SEED);
    let log = record(stage, &assembly, run, &SensorErrors::USUAL, SEED).expect("clear");
    let dataset = log.dataset(stage).expect("a triangle");
    let settings = FitSettings::new(ModelChoice::Named(Model::from_kind(ModelKind::Field)));
    let fit = fit(&dataset, stage, &settings).expect("a fit");
    let mut buffer = [0; runtime::blob::MAX_BYTES];
    let blob = fit.set.to_bytes(&mut buffer).expect("room");
    let set = ParameterSet::from_bytes(blob).expect("a sound blob");
    let parameters = FieldParameters::from_set(&set, stage).expect("a field model");
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
        let ratio = ratio_in_service(&stage(changes));
        assert!(ratio < 1.02, "{name}: {ratio}");
    }
}
