//! The least-squares fit against known truth and its own derivatives.

use super::*;
use crate::estimator::gauss_newton::{Equations, Normal, Point};
use crate::estimator::model::Model;
use crate::estimator::synthetic_for_tests::Protocol;
use hallstage_input::shipped::stage;
use hallstage_input::stage::Stage;
use nalgebra::DVector;
use runtime::ModelKind;

fn truth() -> Parameters {
    from_array([
        0.1944, -0.2150, -0.3290, 0.0005, 0.0077, -0.0010, 0.8671, 0.7049, 0.8632, -188.2, -156.6,
        -178.2, -69.7, -56.8, -63.4, 14.9, -55.1, 12.7,
    ])
}

fn from_array(first: [f64; 18]) -> Parameters {
    let mut values = [0.0; COUNT];
    values[..18].copy_from_slice(&first);
    Parameters { values }
}

fn model_31<'a>(dataset: &hallstage_input::dataset::Dataset, stage: &'a Stage) -> Problem<'a> {
    let all: Vec<usize> = (0..dataset.rows.len()).collect();
    Problem::new(dataset, &all, stage, Model::from_kind(ModelKind::M31))
}

fn normal(problem: &Problem, parameters: &Parameters) -> Option<Normal<COLUMNS>> {
    problem.normal(&Point {
        values: DVector::from_column_slice(&parameters.values[..18]),
        offsets: Vec::new(),
    })
}

fn noisy(seed: u64) -> Protocol {
    Protocol {
        hall_noise_m: 0.5e-6,
        zero_deviation_m: 4e-6,
        seed,
        ..Protocol::exact(truth(), 40)
    }
}

#[test]
fn truth_is_recovered_from_a_log_without_noise() {
    let stage = stage();
    let exact = Protocol {
        zero_deviation_m: 4e-6,
        ..Protocol::exact(truth(), 40)
    };
    let dataset = exact.dataset(&stage);
    let solution = solve(&model_31(&dataset, &stage), None).expect("a fit");
    let pairs = solution.parameters.values.iter().zip(truth().values);
    for (k, (have, want)) in pairs.enumerate() {
        assert!(
            (have - want).abs() < 1e-5 * want.abs() + 1e-8,
            "{k}: {have} {want}"
        );
    }
    // The forward model holds the zero deviation that the closed form gives back.
    let deltas = solution.delta_m.iter().flatten();
    let largest = deltas.fold(0.0f64, |m, d| m.max(d.abs()));
    assert!(largest > 3e-6 && largest <= 4e-6 + 1e-12, "{largest}");
}

/// Derivatives of the cost with respect to the 18 parameters against differences of the cost.
#[test]
fn gradient_matches_differences_of_the_cost() {
    let stage = stage();
    let dataset = noisy(3).dataset(&stage);
    let problem = model_31(&dataset, &stage);
    let mut at = truth();
    at.values.iter_mut().for_each(|value| *value *= 1.01);
    // Angles that are not small, so that the sign of a sine shows.
    at.values[3..6].copy_from_slice(&[0.05, -0.04, 0.06]);
    let here = normal(&problem, &at).expect("regular");
    for k in 0..18 {
        let step = 1e-4 * at.values[k].abs().max(0.05);
        let cost = |step: f64| {
            let mut moved = at;
            moved.values[k] += step;
            normal(&problem, &moved).expect("regular").chi_squared()
        };
        let difference = -(cost(step) - cost(-step)) / (4.0 * step);
        let gradient = here.descent(k);
        let rounding = 1e-7 * here.chi_squared() / step;
        let close = (gradient - difference).abs() < 1e-4 * difference.abs() + rounding;
        assert!(close, "{k}: {gradient} {difference}");
    }
}

#[test]
fn a_truth_outside_its_range_is_found_and_named_and_a_fit_within_the_ranges_ends_on_the_edge() {
    let mut narrow = stage();
    let mut eta = narrow.search.get("eta").expect("known");
    eta[0].high = 0.85;
    narrow.search.set("eta", eta);
    let dataset = noisy(7).dataset(&narrow);
    let problem = model_31(&dataset, &narrow);
    let free = solve(&problem, None).expect("a fit");
    assert!((free.parameters.eta()[0] - 0.8671).abs() < 1e-3);
    let names: Vec<String> = at_limit(problem.stage, problem.model, &free.parameters)
        .into_iter()
        .map(|id| id.name())
        .collect();
    assert_eq!(names, ["eta_a"]);
    let within = fit(&problem, free.parameters, true).expect("a fit");
    assert_eq!(within.parameters.eta()[0], 0.85);
    // Worse than free, better than the free optimum merely clipped.
    let mut clipped = free.parameters;
    clipped.values[6] = 0.85;
    let clipped = normal(&problem, &clipped).expect("regular").chi_squared();
    assert!(free.cost < within.cost && within.cost < clipped);
    // A range without width holds its parameter.
    eta[0].low = 0.85;
    eta[0].high = 0.85;
    narrow.search.set("eta", eta);
    let held = solve(&model_31(&dataset, &narrow), None).expect("a fit");
    assert_eq!(held.parameters.eta()[0], 0.85);
}

#[test]
fn parameters_next_to_a_pole_have_no_cost() {
    let stage = stage();
    let dataset = noisy(1).dataset(&stage);
    let mut pole = truth();
    pole.values[9] = -0.8671 / 250e-6;
    assert!(normal(&model_31(&dataset, &stage), &pole).is_none());
}

/// Sensors in another order or with other signs are another stage, which a regression starts at.
#[test]
fn a_probe_with_the_other_sign_is_found() {
    let stage = stage();
    let mut dataset = noisy(9).dataset(&stage);
    dataset
        .rows
        .iter_mut()
        .for_each(|row| row.signal_m[1] *= -1.0);
    let solution = solve(&model_31(&dataset, &stage), None).expect("a fit");
    assert!((solution.parameters.eta()[1] + 0.7049).abs() < 1e-3);
}
