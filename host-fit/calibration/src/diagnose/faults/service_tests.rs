//! What is predicted of service, against service.

use super::tests::recording;
use crate::diagnose::{Diagnosis, diagnose_log};
use crate::fit::{Fit, FitSettings, ModelChoice, fit};
use crate::judge::verdict::Verdict;
use crate::judge::{Decoded, Zeros};
use crate::service_for_tests::worst_ratio;
use hallstage_input::dataset::Dataset;
use hallstage_input::shipped::stage;
use hallstage_input::stage::Stage;
use hallstage_simulate::assembly::Assembly;
use hallstage_simulate::protocol::Protocol;
use hallstage_simulate::recording::record;
use hallstage_simulate::sensors::SensorErrors;
use hallstage_solver::estimator::model::Model;
use runtime::ModelKind;

/// A log of a stage by a protocol.
fn log_by_protocol(stage: &Stage, seed: u64, protocol: Protocol) -> Dataset {
    let drift_per_root_s = match protocol {
        Protocol::Service => [0.0; 3],
        _ => SensorErrors::USUAL.drift_per_root_s,
    };
    let errors = SensorErrors {
        drift_per_root_s,
        ..SensorErrors::USUAL
    };
    let run = protocol.run(stage.servo_period_s, seed);
    let recording = record(stage, &Assembly::draw(stage, seed), run, &errors, seed).expect("clear");
    recording.dataset(stage).expect("a triangle")
}

/// rms of X, Y, Rz in service of a fit to such a log, with its diagnosis.
fn in_service(
    stage: &Stage,
    seed: u64,
    protocol: Protocol,
    choice: ModelChoice,
) -> (Fit, Diagnosis, [f64; 3]) {
    let dataset = log_by_protocol(stage, seed, protocol);
    let fitted = fit(&dataset, stage, &FitSettings::new(choice)).expect("a fit");
    let diagnosis = diagnose_log(&dataset, stage, Ok(&fitted));
    let service = log_by_protocol(stage, seed, Protocol::Service);
    let judgement = Decoded::new(&fitted.set, &service).judge(&service, stage, Zeros::None);
    let rms = judgement.errors.axes.map(|axis| axis.rms);
    (fitted, diagnosis, rms)
}

#[test]
fn what_is_predicted_for_model_31_holds_in_service() {
    let stage = stage();
    for (seed, protocol) in [
        (3, Protocol::Combined),
        (3, Protocol::Paper),
        (4, Protocol::Paper),
    ] {
        let choice = ModelChoice::Named(Model::from_kind(ModelKind::M31));
        let (_, diagnosis, rms) = in_service(&stage, seed, protocol, choice);
        assert_eq!(diagnosis.verdict, Some(Verdict::Limited));
        let range = diagnosis.predicted.expect("figures").range;
        for ([low, high], rms) in range.into_iter().zip(rms) {
            assert!(low < rms && rms < high, "{seed}: {low:e} {rms:e} {high:e}");
            assert!(high < 8.0 * low, "{seed}: {low:e} {high:e}");
        }
    }
}

#[test]
fn declared_errors_of_resets_let_the_field_model_serve_on_a_log_of_the_paper() {
    let (seed, unknown) = (3, stage());
    let declared = Stage {
        reset_sd: Some(SensorErrors::USUAL.reset),
        ..unknown.clone()
    };
    let of = |stage| in_service(stage, seed, Protocol::Paper, ModelChoice::Auto);
    let ((of_31, _, before), (field, diagnosis, after)) = (of(&unknown), of(&declared));
    assert_eq!((of_31.model.name, field.model.name), ("31", "field"));
    assert_eq!(diagnosis.verdict, Some(Verdict::Limited));
    let worst = |rms: [f64; 3]| {
        let predicted = diagnosis.predicted.expect("figures");
        let floor = |axis: usize| predicted.rms[axis] / predicted.ratio[axis];
        (0..3)
            .map(|axis| rms[axis] / floor(axis))
            .fold(0.0, f64::max)
    };
    assert!(worst(after) < 0.7 * worst(before), "{after:?} {before:?}");
}

/// The beams have a new value in every tenth row, and lines between. Whatever the motion, the prediction holds.
#[test]
fn a_reference_at_a_lower_rate_costs_what_is_predicted() {
    const EVERY: usize = 10;
    let stage = stage();
    for seed in [3, 4] {
        let mut slow = recording(seed);
        for samples in &mut slow.movements {
            let nm: Vec<[i64; 3]> = samples.iter().map(|sample| sample.beams_nm).collect();
            for (k, sample) in samples.iter_mut().enumerate() {
                let (start, part) = (k - k % EVERY, (k % EVERY) as i64);
                let end = (start + EVERY).min(nm.len() - 1);
                let between = |from: i64, to: i64| from + part * (to - from) / EVERY as i64;
                sample.beams_nm = [0, 1, 2].map(|beam| between(nm[start][beam], nm[end][beam]));
            }
        }
        let dataset = slow.dataset(&stage).expect("a triangle");
        let fitted = fit(&dataset, &stage, &FitSettings::new(ModelChoice::Auto)).expect("a fit");
        let diagnosis = diagnose_log(&dataset, &stage, Ok(&fitted));
        let predicted = diagnosis.predicted.expect("figures");
        let constants = fitted.estimate.parameters.constants(1.0).expect("a pose");
        let floor = [0, 1, 2].map(|axis| predicted.noise(axis));
        let shown = worst_ratio(&constants, &Assembly::draw(&stage, seed), seed, floor);
        let ratio = predicted.worst_ratio();
        let close = 0.7 * shown..1.4 * shown;
        assert!(
            shown > 2.0 && close.contains(&ratio),
            "{seed}: {ratio} {shown}"
        );
    }
}
