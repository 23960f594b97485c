use super::*;
use crate::estimator::model::Model;
use crate::estimator::synthetic::Protocol;
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

/// Standard errors against the spread over many logs that differ only in their noise.
#[test]
fn standard_errors_match_the_spread_over_repeated_logs() {
    let stage = Stage::from_toml(STAGE_TOML, "stage.toml".as_ref()).expect("sound");
    let mut truth = Parameters::designed(&stage);
    truth.values[6..18].copy_from_slice(&[
        0.8671, 0.7049, 0.8632, -188.2, -156.6, -178.2, -69.7, -56.8, -63.4, 14.9, -55.1, 12.7,
    ]);
    let logs = 60;
    let mut sums = [[0.0; 2]; 18];
    let mut claimed = [0.0; 18];
    for seed in 0..logs {
        let dataset = Protocol {
            hall_noise_m: 0.5e-6,
            zero_deviation_m: 4e-6,
            seed: 1000 + seed,
            ..Protocol::exact(truth, 40)
        }
        .dataset(&stage);
        let rows: Vec<usize> = (0..dataset.rows.len()).collect();
        let problem = Problem::new(&dataset, &rows, &stage, Model::from_kind(ModelKind::M31));
        let options = SolverOptions::new(Projection::Linear, 1);
        let solution = (Solver::LeastSquares.solve(&problem, &options)).expect("a fit");
        let errors = Sandwich::new(&problem, &solution.parameters).expect("evaluated");
        let errors = errors.posterior.standard_errors_31();
        for k in 0..18 {
            let deviation = solution.parameters.values[k] - truth.values[k];
            sums[k][0] += deviation;
            sums[k][1] += deviation * deviation;
            claimed[k] += errors[k].expect("determined") / logs as f64;
        }
    }
    for k in 0..18 {
        let spread = (sums[k][1] / logs as f64).sqrt();
        let ratio = claimed[k] / spread;
        assert!(
            (0.7..1.6).contains(&ratio),
            "{k}: claimed {:e}, spread {spread:e}",
            claimed[k]
        );
    }
}
