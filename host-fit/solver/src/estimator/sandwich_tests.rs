use super::*;
use crate::estimator::model::Model;
use crate::solve::{Projection, Solver, SolverOptions};
use hallstage_input::log::{ReadOptions, read_bytes};
use hallstage_input::shipped::{LOG_GZ, STAGE_TOML};
use hallstage_input::stage::Stage;
use runtime::ModelKind;

/// Sandwich over the 57 movements of the shipped log, computed apart from this program from
/// differences of the residuals of all rows; for `c_c` the rows-independent figure is larger.
const EXPECTED: [f64; 18] = [
    5.3852e-5, 6.1580e-5, 4.6554e-5, 6.4834e-5, 5.8853e-5, 2.5133e-5, 6.0485e-5, 7.3917e-5,
    4.6547e-5, 0.95172, 1.3032, 0.68427, 0.14024, 0.19391, 0.23914, 0.15327, 0.16378, 0.13738,
];

#[test]
fn standard_errors_of_the_shipped_log_are_those_of_an_independent_computation() {
    let stage = Stage::from_toml(STAGE_TOML, "stage.toml".as_ref()).expect("sound");
    let path = "paper.csv.gz".as_ref();
    let log = read_bytes(LOG_GZ, path, &stage, &ReadOptions::default()).expect("sound");
    let rows: Vec<usize> = (0..log.dataset.rows.len()).collect();
    let model = Model::from_kind(ModelKind::M31);
    let problem = Problem::new(&log.dataset, &rows, &stage, model);
    let options = SolverOptions::new(Projection::Linear, 1);
    let solution = Solver::LeastSquares
        .solve(&problem, &options)
        .expect("a solution");
    let found = Sandwich::new(&problem, &solution.parameters).expect("evaluated");
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
