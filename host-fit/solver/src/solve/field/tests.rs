//! The whole fit on logs whose truth is known.

use super::error::FieldFitError;
use super::fit::{FieldFit, fit_field};
use super::parameters::FieldParameters;
use super::sample_for_tests::{Run, parameters, stage};
use super::terms::{COUNT, name};
use crate::input::dataset::Dataset;
use crate::input::stage::Stage;
use crate::problem::Problem;
use crate::problem::model::Model;
use crate::problem::parameters::Parameters;
use crate::solve::{Projection, Solver, SolverOptions};
use runtime::ModelKind;

fn model_31(dataset: &Dataset, all: &[usize], stage: &Stage) -> Parameters {
    let options = SolverOptions::new(Projection::Linear, 1);
    let problem = Problem::new(dataset, all, stage, Model::of(ModelKind::M31));
    Solver::LeastSquares
        .solve(&problem, &options)
        .expect("a fit")
        .parameters
}

fn fit(dataset: &Dataset) -> Result<FieldFit, FieldFitError> {
    let stage = stage();
    let all: Vec<usize> = (0..dataset.rows.len()).collect();
    fit_field(dataset, &all, &stage, &model_31(dataset, &all, &stage))
}

fn fitted(run: &Run) -> FieldFit {
    fit(&run.dataset(&parameters())).expect("a fit")
}

/// Errors in terms of their standard errors: of the 81 parameters.
fn normalized(fit: &FieldFit) -> [f64; COUNT] {
    let errors = fit.posterior.standard_errors();
    let (found, truth) = (fit.parameters, parameters());
    let (found, truth) = (found.probes.as_flattened(), truth.probes.as_flattened());
    std::array::from_fn(|k| (found[k] - truth[k]) / errors[k])
}

#[test]
fn eight_seconds_give_the_parameters_within_their_standard_errors() {
    let fit = fitted(&Run::EIGHT_SECONDS);
    let normalized = normalized(&fit);
    for (k, x) in normalized.iter().enumerate() {
        assert!(x.abs() < 4.5, "{}: {x}", name(k));
    }
    let mean_square = normalized.iter().map(|x| x * x).sum::<f64>() / COUNT as f64;
    assert!((0.3..2.0).contains(&mean_square), "{mean_square}");
    let chi_squared = fit.score.chi_squared / fit.score.residuals as f64;
    assert!((0.85..1.15).contains(&chi_squared), "{chi_squared}");
    for ratio in fit.verdict.service.ratios() {
        assert!(ratio < 1.02, "{ratio}");
    }
    assert!(fit.verdict.field, "{}", fit.verdict);
    assert!(fit.iterations <= 8, "{}", fit.iterations);
}

#[test]
fn the_noise_of_the_probes_and_the_walk_of_the_reference_are_told_apart() {
    let fit = fitted(&Run {
        movements: 4,
        drift: [0.3e-6, 0.1e-6, 0.5e-6],
        ..Run::EIGHT_SECONDS
    });
    for white in fit.noise.white_mm {
        assert!((white / 0.5e-3 - 1.0).abs() < 0.05, "{white}");
    }
    for (drift, truth) in fit.noise.drift_mm.into_iter().zip([0.3e-3, 0.1e-3, 0.5e-3]) {
        assert!((drift / truth - 1.0).abs() < 0.5, "{drift} {truth}");
    }
}

#[test]
fn a_lag_of_the_reference_is_found_and_does_no_harm() {
    let lagging = fitted(&Run {
        lag_rows: 2,
        ..Run::EIGHT_SECONDS
    });
    let error = lagging.posterior.lag_error_s.expect("a lag");
    assert!(error < 20e-6, "{error}");
    assert!(
        (lagging.lag_s - 0.004).abs() < 5.0 * error,
        "{}",
        lagging.lag_s
    );
    for (k, x) in normalized(&lagging).iter().enumerate() {
        assert!(x.abs() < 4.5, "{}: {x}", name(k));
    }
}

#[test]
fn the_fit_is_the_same_on_one_thread_and_on_many() {
    let dataset = Run {
        movements: 3,
        seconds: 3.0,
        ..Run::EIGHT_SECONDS
    }
    .dataset(&parameters());
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        pool.expect("threads")
            .install(|| fit(&dataset).expect("a fit"))
    };
    let (one, many) = (on(1), on(3));
    assert_eq!(one.parameters, many.parameters);
    assert_eq!(one.posterior, many.posterior);
    assert_eq!(one.score, many.score);
}

/// Where the vertical pose stands still in each movement, E and the resets are the same thing.
#[test]
fn a_log_of_still_heights_cannot_carry_the_model() {
    let dataset = Run {
        movements: 7,
        seconds: 4.0,
        still: true,
        ..Run::EIGHT_SECONDS
    }
    .dataset(&parameters());
    match fit(&dataset) {
        Err(FieldFitError::NotCarried(verdict)) => assert!(!verdict.field, "{verdict}"),
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_stage_that_is_model_31_keeps_it() {
    let truth = FieldParameters::of_model_31(&parameters().model_31(), &stage());
    let fit = fit(&Run::EIGHT_SECONDS.dataset(&truth)).expect("a fit");
    assert!(!fit.verdict.field, "{}", fit.verdict);
}
