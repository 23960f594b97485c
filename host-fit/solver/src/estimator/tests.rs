//! The whole fit on logs with known truth.

use super::error::FieldFitError;
use super::field::{FieldFit, fit_field};
use super::parameters::FieldParameters;
use super::sample_for_tests::{Run, parameters, stage};
use super::terms::{COUNT, name};
use crate::estimator::model::Model;
use crate::estimator::paper::Parameters;
use crate::estimator::problem::Problem;
use crate::solve::{Projection, Solver, SolverOptions};
use hallstage_input::dataset::{Dataset, LogSource, LoggedFrame};
use hallstage_input::stage::Stage;
use runtime::frame::MISSING_CODE;
use runtime::{ModelKind, RawFrame};

fn model_31(dataset: &Dataset, all: &[usize], stage: &Stage) -> Parameters {
    let options = SolverOptions::new(Projection::Linear, 1);
    let problem = Problem::new(dataset, all, stage, Model::from_kind(ModelKind::M31));
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
    let chi_squared = fit.figures.score.chi_squared / fit.figures.score.residuals as f64;
    assert!((0.85..1.15).contains(&chi_squared), "{chi_squared}");
    for ratio in fit.figures.comparison.service.ratios() {
        assert!(ratio < 1.02, "{ratio}");
    }
    assert!(fit.figures.comparison.field, "{:?}", fit.figures.comparison);
    assert!(fit.iterations <= 8, "{}", fit.iterations);
}

#[test]
fn the_noise_of_the_probes_and_the_walk_of_the_reference_are_separated() {
    let fit = fitted(&Run {
        movements: 4,
        drift: [0.3e-6, 0.1e-6, 0.5e-6],
        ..Run::EIGHT_SECONDS
    });
    for white in fit.figures.noise.white_m {
        assert!((white / 0.5e-6 - 1.0).abs() < 0.05, "{white}");
    }
    for (drift, truth) in fit
        .figures
        .noise
        .drift
        .into_iter()
        .zip([0.3e-6, 0.1e-6, 0.5e-6])
    {
        assert!((drift / truth - 1.0).abs() < 0.5, "{drift} {truth}");
    }
}

#[test]
fn a_lag_of_the_reference_is_found_and_does_no_harm() {
    let lagging = fitted(&Run {
        lag_rows: 2,
        ..Run::EIGHT_SECONDS
    });
    let lag = lagging.lag.expect("a lag");
    let error = lag.standard_error_s;
    assert!(error < 20e-6, "{error}");
    assert!((lag.value_s - 0.004).abs() < 5.0 * error, "{}", lag.value_s);
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
    assert_eq!(one.figures.score, many.figures.score);
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
        Err(FieldFitError::NotCarried(verdict)) => assert!(!verdict.field, "{verdict:?}"),
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_stage_that_is_model_31_keeps_it() {
    let truth = FieldParameters::from_model_31(&parameters().model_31(), &stage());
    let fit = fit(&Run::EIGHT_SECONDS.dataset(&truth)).expect("a fit");
    assert!(
        !fit.figures.comparison.field,
        "{:?}",
        fit.figures.comparison
    );
}

/// Two runs, the second with a mount that is 5 K warmer. The magnets differ in k.
fn cold_and_warm(k_per_k: [f64; 3], logs: usize) -> Dataset {
    let run = Run {
        movements: 2,
        ..Run::EIGHT_SECONDS
    };
    let mut dataset = run.dataset(&parameters());
    let cold = dataset.movements[1].rows.start;
    for (index, row) in dataset.rows.iter_mut().enumerate() {
        let change_k = if index < cold { 0.0 } else { 5.0 };
        let frame = RawFrame::new([0; 3], [0; 3], 0, 0);
        let mount_mc = 20_000 + (change_k * 1e3) as i32;
        row.frame = LoggedFrame::from(frame.with_temperature_mc([mount_mc, MISSING_CODE]));
        for (signal, k) in row.signal_m.iter_mut().zip(k_per_k) {
            *signal *= 1.0 + k * change_k;
        }
    }
    if logs == 2 {
        let whole = dataset.logs[0].clone();
        let with_rows = |rows| LogSource {
            rows,
            ..whole.clone()
        };
        dataset.logs = vec![with_rows(0..cold), with_rows(cold..whole.rows.end)];
    }
    dataset.compensate_as_expected(&stage().temperature);
    dataset
}

#[test]
fn a_cold_and_a_warm_log_tell_k_within_its_standard_error() {
    let truth = [-0.9e-3, -1.3e-3, -1.6e-3];
    let temperature = fit(&cold_and_warm(truth, 2))
        .expect("a fit")
        .figures
        .temperature;
    assert_eq!(temperature.temperature.zero_mc[0], 22_500);
    for (probe, truth) in truth.into_iter().enumerate() {
        // k counts from the gain at T0, 2.5 K above the cold log.
        let truth = truth / (1.0 + truth * 2.5);
        let found = temperature.temperature.per_mk[probe][0] * 1e3;
        let error = temperature.error_per_k[probe][0];
        assert!(error < 6e-5, "{probe}: {error:e}");
        let off = (found - truth) / error;
        assert!(off.abs() < 3.5, "{probe}: {found:e} is {off} errors off");
    }
    assert_eq!(
        temperature.temperature.reach_mk[1], 0,
        "there is no body sensor"
    );
}

#[test]
fn logs_at_nearly_one_temperature_leave_k_as_expected() {
    // One log of 1.7 K, and two 0.05 K apart.
    for (logs, part) in [(1, 3), (2, 100)] {
        let mut dataset = cold_and_warm([-1.2e-3; 3], logs);
        for row in &mut dataset.rows {
            let [mount_mc, _] = &mut row.frame.codes.temperature_mc;
            *mount_mc = 20_000 + (*mount_mc - 20_000) / part;
        }
        dataset.compensate_as_expected(&stage().temperature);
        let temperature = fit(&dataset).expect("a fit").figures.temperature;
        assert_eq!(temperature.spans_k, [0.0; 2]);
        for (per_mk, error) in temperature
            .temperature
            .per_mk
            .iter()
            .zip(temperature.error_per_k)
        {
            assert!((per_mk[0] + 1.2e-6).abs() < 1e-9, "{per_mk:?}");
            assert_eq!(error[0], 3e-4);
        }
    }
}
