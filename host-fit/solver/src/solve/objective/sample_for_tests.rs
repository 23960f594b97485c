//! A small log for tests of the objective: Model (31) with noise of a known seed.

use crate::estimator::model::Model;
use crate::estimator::paper::Parameters;
use crate::estimator::problem::{Problem, UNIT};
use crate::estimator::rows::FieldRow;
use crate::estimator::synthetic_for_tests::Protocol;
use hallstage_input::dataset::Dataset;
use hallstage_input::shipped;
use hallstage_input::stage::{Range, Stage};
use nalgebra::Matrix3;
use runtime::geometry::ProbeGeometry;
use runtime::matrix::{inverse, to_rows};
use runtime::model::{Sensitivity, planar_pose, sensitivity_at, zero_pose};
use runtime::{ModelKind, PlanarPose, VerticalPose};

/// The stage of the tests: Tables 1, 3 and 5 of the paper.
pub fn stage() -> Stage {
    let mut stage = shipped::stage();
    let theta = Range {
        low: -0.14,
        high: 0.14,
    };
    stage.search.set("theta_deg", [theta; 3]);
    stage
}

/// What the sample's stage is really like.
pub fn truth() -> Parameters {
    let probe = |eta, a, b, c| Sensitivity {
        eta,
        per_z_m: a,
        per_rx_rad: b,
        per_ry_rad: c,
    };
    let geometry = ProbeGeometry {
        lever_arm_m: [0.2, -0.205, -0.35],
        misalignment_rad: [0.01, -0.02, 0.015],
    };
    Parameters::from_model_31(
        &geometry,
        &[
            probe(0.87, -190.0, -70.0, 15.0),
            probe(0.70, -160.0, -57.0, -55.0),
            probe(0.86, -180.0, -63.0, 13.0),
        ],
    )
}

/// A log of `movements` with `rows` each: a vertical pose of its own for every three, a zero
/// deviation of up to 4 um, noise of 0.5 um.
pub fn dataset(movements: usize, rows: usize) -> Dataset {
    let vertical = |k: usize| {
        let part = |pace: f64, start: f64| (pace * k as f64 + start).cos();
        [
            250.0 * part(1.9, 0.0),
            500.0 * part(2.3, 0.6),
            500.0 * part(1.1, 2.3),
        ]
    };
    let protocol = Protocol {
        settings: (0..movements.div_ceil(3)).map(vertical).collect(),
        hall_noise_m: 0.5e-6,
        zero_deviation_m: 4e-6,
        seed: 7,
        ..Protocol::exact(truth(), rows)
    };
    let mut dataset = protocol.dataset(&stage());
    dataset.movements.truncate(movements);
    dataset.rows.truncate(movements * rows);
    dataset
}

/// The problem of all rows of a sample.
pub fn problem<'a>(dataset: &Dataset, stage: &'a Stage, model: ModelKind) -> Problem<'a> {
    let all: Vec<usize> = (0..dataset.rows.len()).collect();
    Problem::new(dataset, &all, stage, Model::from_kind(model))
}

/// The sensitivities of the probes in a row.
pub fn phi(parameters: &Parameters, row: &FieldRow) -> [f64; 3] {
    let vertical = VerticalPose::from_array(row.vertical);
    (parameters.sensitivity()).map(|probe| sensitivity_at(&probe, &vertical))
}

/// X, Y, Rz of a row by the runtime's own model in f64.
pub fn pose_by_the_runtime(
    parameters: &Parameters,
    plane_inverse: &Matrix3<f64>,
    row: &FieldRow,
    zero: &PlanarPose<f64>,
) -> [f64; 3] {
    let phi = phi(parameters, row);
    planar_pose(&to_rows(plane_inverse), row.signal_m, phi, zero).to_array()
}

/// The fitness by the runtime's own model in f64, row by row.
pub fn fitness_by_the_runtime(
    problem: &Problem<'_>,
    parameters: &Parameters,
    delta_m: &[[f64; 3]],
) -> f64 {
    let Some(inverse) = inverse(&parameters.geometry().plane()) else {
        return f64::NAN;
    };
    let mut cost = 0.0;
    for (number, movement) in problem.rows.numbered_movements() {
        let zero = zero_pose(&inverse, parameters.eta(), delta_m[number]);
        for row in &problem.rows.rows[movement] {
            let pose = pose_by_the_runtime(parameters, &inverse, row, &zero);
            for (pose, reference) in pose.iter().zip(row.reference) {
                let error = (pose - reference) / UNIT;
                cost += error * error;
            }
        }
    }
    problem.fitness(cost)
}
