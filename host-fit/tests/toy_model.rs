//! A model that the program does not have, fitted by the library as it is: Model (31) with one
//! more term in the sensitivity, phi = eta + a Z + b Rx + c Ry + d Z^2.
//!
//! Nothing but its table stands here: sizes, objectives, least squares, standard errors, checks
//! and JSON follow from it. Its tick, which the runtime does not have, is a type of its own in
//! `runtime/tests/another_model.rs`; until a decoder has it, `fit` refuses to judge it.

use host_fit::fit::{FitError, FitSettings, ModelChoice, fit};
use host_fit::input::dataset::Dataset;
use host_fit::input::shipped::STAGE_TOML;
use host_fit::input::stage::{Range, Stage};
use host_fit::judge::identify::{FitFailure, check_determined, check_motion};
use host_fit::judge::uncertainty::uncertainty;
use host_fit::problem::Problem;
use host_fit::problem::model::{Model, SLOPES_MAX};
use host_fit::problem::parameters::Parameters;
use host_fit::problem::synthetic::Protocol;
use host_fit::problem::terms::{MODEL_31, Motion, Term};
use host_fit::report::parameters::parameters;
use host_fit::solve::search::kind::SearchKind;
use host_fit::solve::{Projection, Solver, SolverOptions};
use runtime::ModelKind;
use runtime::geometry::ProbeGeometry;

const D: Term = Term {
    name: "d",
    unit: "1/m^2",
    range_key: "d_per_m2",
    seen_in: [Motion::Z; 3],
    in_phi: |[z, _, _]| z * z,
    fixed: 0.0,
};
static TOY: Model = Model {
    name: "toy",
    summary: "Model (31) with a term in Z^2",
    kind: ModelKind::M31,
    terms: &{
        let [lever_arm, theta, eta, a, b, c] = MODEL_31;
        [lever_arm, theta, eta, a, b, c, D]
    },
    fitted: 7,
    has_zero_deviation: true,
};

/// d of A, B, C: a tenth of eta at Z = 250 um.
const D_TRUE: [f64; 3] = [1.4e6, -1.1e6, 1.3e6];

fn stage() -> Stage {
    let mut stage = Stage::from_toml(STAGE_TOML, "stage.toml".as_ref()).expect("sound");
    let range = Range {
        low: -4e6,
        high: 4e6,
    };
    stage.search.set("d_per_m2", [range; 3]);
    stage
}

fn truth() -> Parameters {
    let geometry = ProbeGeometry {
        lever_arm_m: [0.1944, -0.2150, -0.3290],
        misalignment_rad: [0.0005, 0.0077, -0.0010],
    };
    let slopes = [
        [-188.2, -69.7, 14.9, D_TRUE[0]],
        [-156.6, -56.8, -55.1, D_TRUE[1]],
        [-178.2, -63.4, 12.7, D_TRUE[2]],
    ];
    Parameters::new(&geometry, [0.8671, 0.7049, 0.8632], slopes)
}

/// A log by the paper's protocol of a stage that the toy model describes exactly.
fn log(stage: &Stage) -> Dataset {
    let truth = truth();
    let mut dataset = Protocol::exact(truth, 20).dataset(stage);
    for row in &mut dataset.rows {
        let factors = TOY.slopes_at(row.vertical);
        for probe in 0..3 {
            let eta = truth.eta()[probe];
            let of = |slopes: usize| {
                let terms = truth.slopes()[probe].into_iter().zip(factors).take(slopes);
                terms.fold(eta, |phi, (slope, factor)| phi + slope * factor)
            };
            row.signal_m[probe] *= of(SLOPES_MAX) / of(3);
        }
    }
    dataset
}

fn problem<'a>(dataset: &Dataset, stage: &'a Stage, model: &'static Model) -> Problem<'a> {
    let all: Vec<usize> = (0..dataset.rows.len()).collect();
    Problem::new(dataset, &all, stage, model)
}

#[test]
fn every_form_and_solver_finds_the_term_that_was_added() {
    let stage = stage();
    let dataset = log(&stage);
    let problem = problem(&dataset, &stage, &TOY);
    for (solver, projection) in [
        (Solver::Finished, Projection::Linear),
        (Solver::Finished, Projection::Delta),
        (Solver::LeastSquares, Projection::None),
    ] {
        let options = SolverOptions::new(projection, 1);
        let found = solver.solve(&problem, &options).expect("a solution");
        for (id, want) in TOY.parameters().zip(truth().values) {
            let have = found.parameters.values[id.index];
            assert!(
                (have - want).abs() < 1e-5 * want.abs() + 1e-8,
                "{} {projection:?} {}: {have} {want}",
                solver.name(),
                id.name()
            );
        }
    }
    // A search alone is within its bounds and better than what Model (31) can reach.
    let shtlbo = Solver::Search(SearchKind::Shtlbo);
    let options = SolverOptions::new(Projection::Linear, 1);
    let found = shtlbo.solve(&problem, &options).expect("a solution");
    let without = self::problem(&dataset, &stage, Model::of(ModelKind::M31));
    let best = Solver::LeastSquares.solve(&without, &options);
    assert!(100.0 * found.cost < best.expect("a solution").cost);
}

#[test]
fn standard_errors_checks_and_json_know_the_term() {
    let stage = stage();
    let mut dataset = log(&stage);
    // A little error, or there is nothing to estimate.
    for (k, row) in dataset.rows.iter_mut().enumerate() {
        row.signal_m[k % 3] += 1e-7 * ((k * 7 % 11) as f64 - 5.0);
    }
    let problem = problem(&dataset, &stage, &TOY);
    check_motion(&dataset, &stage, dataset.rows.len(), &TOY).expect("it moves");
    let options = SolverOptions::new(Projection::Linear, 1);
    let found = Solver::LeastSquares
        .solve(&problem, &options)
        .expect("a solution");
    let errors = uncertainty(&problem, &found.parameters, &[]).expect("no pole");
    let span = [250e-6, 500e-6, 500e-6];
    check_determined(&problem, &found.parameters, &errors, span).expect("determined");
    let json = parameters(&TOY, &found.parameters, &errors.standard_error);
    assert_eq!(json.len(), 21);
    for (name, want) in ["d_a", "d_b", "d_c"].into_iter().zip(D_TRUE) {
        let d = json[name];
        let error = d.standard_error.expect("determined");
        assert_eq!(d.unit, "1/m^2");
        assert!(error > 0.0 && error < 0.01 * want.abs(), "{name}: {error}");
        assert!((d.value - want).abs() < 5.0 * error, "{name}: {}", d.value);
    }

    // At one height, d is neither seen nor told apart from eta and a.
    let flat = Protocol {
        settings: vec![[0.0; 3], [0.0, 500.0, 0.0], [0.0, 0.0, 500.0]],
        ..Protocol::exact(truth(), 20)
    };
    let flat = flat.dataset(&stage);
    let refused = check_motion(&flat, &stage, flat.rows.len(), &TOY);
    match refused.expect_err("no height") {
        FitFailure::NoMotion {
            motion, parameters, ..
        } => {
            assert_eq!(motion, Motion::Z);
            assert_eq!(parameters, "a_a, a_b, a_c, d_a, d_b, d_c");
        }
        other => panic!("{other}"),
    }
    // At three heights that are the same twice over, d is open while a is not.
    let two = Protocol {
        settings: vec![
            [100.0, 0.0, 0.0],
            [-100.0, 0.0, 0.0],
            [100.0, 500.0, 0.0],
            [-100.0, 0.0, 500.0],
        ],
        ..Protocol::exact(truth(), 20)
    };
    let two = two.dataset(&stage);
    let problem = self::problem(&two, &stage, &TOY);
    let found = Solver::LeastSquares
        .solve(&problem, &options)
        .expect("a solution");
    let errors = uncertainty(&problem, &found.parameters, &[]).expect("no pole");
    let refused = check_determined(&problem, &found.parameters, &errors, span);
    let message = refused.expect_err("d is open").to_string();
    assert!(
        message.contains("d_a") && message.contains("heights Z"),
        "{message}"
    );
}

#[test]
fn fit_refuses_what_no_decoder_has_and_terms_without_a_range() {
    let stage = stage();
    let dataset = log(&stage);
    let settings = FitSettings::new(ModelChoice::Named(&TOY));
    let refused = fit(&dataset, &stage, &settings).map(|fit| fit.solution);
    assert_eq!(refused, Err(FitError::NoDecoder { model: "toy" }));
    let without = Stage::from_toml(STAGE_TOML, "stage.toml".as_ref()).expect("sound");
    let refused = fit(&dataset, &without, &settings).map(|fit| fit.solution);
    let key = "d_per_m2";
    assert_eq!(refused, Err(FitError::NoRange { key, model: "toy" }));
}
