//! A small log for tests of the objective: Model (31) with noise of a known seed.

use crate::input::dataset::{Dataset, LoggedFrame, Movement, Row};
use crate::input::shipped::STAGE_TOML;
use crate::input::stage::{Range, Stage};
use crate::problem::model::Model;
use crate::problem::parameters::Parameters;
use crate::problem::{Problem, TrainRow};
use crate::solve::search::random::{Phase, RandomSource, stream};
use runtime::geometry::ProbeGeometry;
use runtime::model::{Sensitivity, probe_displacement_m};
use runtime::{ModelKind, PlanarPose, RawFrame, VerticalPose};

/// The stage of the tests: Tables 1, 3 and 5 of the paper.
pub fn stage() -> Stage {
    let mut stage = Stage::from_toml(STAGE_TOML, "stage.toml".as_ref()).expect("sound");
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
    Parameters::of_model_31(
        &geometry,
        &[
            probe(0.87, -190.0, -70.0, 15.0),
            probe(0.70, -160.0, -57.0, -55.0),
            probe(0.86, -180.0, -63.0, 13.0),
        ],
    )
}

/// A log of `movements` movements of `rows` rows each: planar motion of 300 um and urad, a
/// vertical pose of its own for each movement that wanders by 0.2 um and urad, a zero deviation
/// of up to 4 um, noise of 0.5 um.
pub fn dataset(movements: usize, rows: usize) -> Dataset {
    let truth = truth();
    let plane = truth.geometry().plane_rows();
    let mut dataset = Dataset::default();
    for movement in 0..movements {
        let mut random = stream(7, movement, Phase::Start, 0);
        let mut symmetric = |size: f64| size * (2.0 * random.uniform() - 1.0);
        let held = [2.5e-4, 5e-4, 5e-4].map(&mut symmetric);
        let delta = [4e-6; 3].map(&mut symmetric);
        let start = dataset.rows.len();
        for _ in 0..rows {
            let planar = PlanarPose::from_array([3e-4, 5e-4, 3e-4].map(&mut symmetric));
            let vertical = held.map(|v| v + symmetric(2e-7));
            let read = probe_displacement_m(
                &plane,
                &truth.sensitivity(),
                &planar,
                &VerticalPose::from_array(vertical),
                delta,
            );
            dataset.rows.push(Row {
                movement,
                t_us: 2000 * dataset.rows.len() as i64,
                frame: LoggedFrame::Codes(RawFrame {
                    hall: [0; 3],
                    capacitive: [0; 3],
                    sequence: 0,
                    time_us: 0,
                }),
                signal_m: read.map(|s| s + symmetric(0.9e-6)),
                vertical,
                reference: planar.to_array(),
            });
        }
        dataset.movements.push(Movement {
            log: 0,
            index: movement as i64,
            rows: start..dataset.rows.len(),
        });
    }
    dataset
}

/// The problem of all rows of a sample.
pub fn problem<'a>(dataset: &Dataset, stage: &'a Stage, model: ModelKind) -> Problem<'a> {
    let all: Vec<usize> = (0..dataset.rows.len()).collect();
    Problem::new(dataset, &all, stage, Model::of(model))
}

/// The fitness by the runtime's own model in f64, row by row.
pub fn fitness_by_the_runtime(
    problem: &Problem<'_>,
    parameters: &Parameters,
    delta_m: &[[f64; 3]],
) -> f64 {
    use runtime::geometry::inverse_rows;
    use runtime::model::{planar_pose, sensitivity_at, zero_pose};
    let Some(inverse) = inverse_rows(&parameters.geometry().plane_rows()) else {
        return f64::NAN;
    };
    let mut cost = 0.0;
    for group in &problem.groups {
        let zero = zero_pose(&inverse, parameters.eta(), delta_m[group.movement]);
        for row in &problem.rows[group.rows.clone()] {
            let vertical = VerticalPose::from_array(vertical(row));
            let phi = parameters
                .sensitivity()
                .map(|s| sensitivity_at(&s, &vertical));
            let signal = row.signal_um.map(|s| s * 1e-6);
            let pose = planar_pose(&inverse, signal, phi, &zero).to_array();
            let axes = pose.iter().zip(row.reference_um).zip(problem.weights);
            for ((pose, reference), weight) in axes {
                let error = pose * 1e6 - reference;
                cost += weight * error * error;
            }
        }
    }
    problem.fitness(cost)
}

/// Z, Rx, Ry of a row: the factors of the slopes of Model (31).
pub fn vertical(row: &TrainRow) -> [f64; 3] {
    row.vertical
}
