use super::*;
use crate::estimator::model::Model;
use crate::solve::{Projection, Solver, SolverOptions};
use hallstage_input::log::{ReadOptions, read_bytes};
use hallstage_input::shipped::{LOG_GZ, STAGE_TOML};
use hallstage_input::stage::Stage;
use runtime::ModelKind;

/// Sandwich over the 57 movements of the shipped log, with the usual factors for few clusters and lost degrees of
/// freedom, computed apart from this program from differences of the residuals of all rows.
const EXPECTED: [f64; 18] = [
    4.8129e-5, 4.4207e-5, 5.3443e-5, 1.3769e-4, 3.5186e-5, 1.6500e-4, 5.8805e-5, 6.6887e-5,
    1.0538e-4, 0.93684, 1.1853, 1.035, 0.2681, 0.40078, 0.20211, 0.23271, 0.19858, 0.17075,
];

/// Every `stride`-th row of the shipped log.
fn sandwich(stride: usize) -> (&'static Model, Sandwich) {
    let stage = Stage::from_toml(STAGE_TOML, "stage.toml".as_ref()).expect("sound");
    let path = "paper.csv.gz".as_ref();
    let log = read_bytes(LOG_GZ, path, &stage, &ReadOptions::default()).expect("sound");
    let rows: Vec<usize> = (0..log.dataset.rows.len()).step_by(stride).collect();
    let model = Model::from_kind(ModelKind::M31);
    let problem = Problem::new(&log.dataset, &rows, &stage, model);
    let options = SolverOptions::new(Projection::Linear, 1);
    let solution = Solver::LeastSquares
        .solve(&problem, &options)
        .expect("a solution");
    let found = Sandwich::new(&problem, &solution.parameters).expect("evaluated");
    (model, found)
}

#[test]
fn standard_errors_of_the_shipped_log_are_those_of_an_independent_computation() {
    let (model, found) = sandwich(1);
    let found = found.posterior.standard_errors_31();
    for (id, expected) in model.parameters().zip(EXPECTED) {
        let found = found[id.index].expect("determined");
        assert!(
            (found - expected).abs() < 1e-3 * expected,
            "{}: {found:e} {expected:e}",
            id.name()
        );
    }
}

/// Of every 40th row nine of the 18 errors by clusters are smaller by chance.
#[test]
fn the_error_of_independent_rows_is_a_lower_bound() {
    let (model, found) = sandwich(40);
    let errors = found.posterior.standard_errors_31();
    for id in model.parameters() {
        let (error, least) = (errors[id.index], found.motion_error[id.index]);
        assert!(error >= Some(least), "{}: {error:?} {least}", id.name());
    }
}
