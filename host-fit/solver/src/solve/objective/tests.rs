//! Each form against the runtime's own model in f64, and the forms against each other.

use super::Objective;
use super::poles::SHARE_MIN;
use super::sample_for_tests::{
    dataset, fitness_by_the_runtime, phi, pose_by_the_runtime, problem, stage, truth,
};
use crate::estimator::model::Model;
use crate::estimator::paper::{Parameters, THETA};
use crate::estimator::problem::Problem;
use crate::estimator::rows::FieldRow;
use crate::estimator::zero_deviation::ZeroDeviation;
use crate::solve::Projection;
use crate::solve::search::cost::CostFunction;
use crate::solve::search::random::{Phase, stream};
use hallstage_input::stage::Range;
use runtime::matrix::inverse;
use runtime::{ModelKind, PlanarPose};

const MODELS: [ModelKind; 4] = [
    ModelKind::M12,
    ModelKind::M15,
    ModelKind::M30,
    ModelKind::M31,
];

/// An individual drawn from the whole box.
fn draw(cost: &Objective<'_>, number: usize) -> Vec<f64> {
    let mut individual = vec![0.0; cost.bounds().len()];
    stream(3, 0, Phase::Start, number).fill_within(cost.bounds(), &mut individual);
    individual
}

/// The individual of `Delta` or `Linear` that holds these parameters.
fn individual(cost: &Objective<'_>, parameters: &Parameters) -> Vec<f64> {
    let fitted = &parameters.values[THETA..cost.problem.model.free_count()];
    if cost.projection == Projection::Linear {
        let probes = parameters.slopes().into_iter().zip(parameters.eta());
        return probes
            .flat_map(|(slopes, eta)| slopes.map(|slope| slope / eta))
            .collect();
    }
    let ranges = cost.arm_ranges(parameters).into_iter();
    let places = ranges
        .zip(parameters.values)
        .map(|(range, arm_m)| (arm_m - range.low) / range.width());
    places.chain(fitted.iter().copied()).collect()
}

fn objective<'a>(problem: &'a Problem<'a>, projection: Projection) -> Objective<'a> {
    Objective::new(problem, projection).expect("a form with unknowns")
}

fn assert_close(have: f64, want: f64, relative: f64, what: &str) {
    assert!(
        (have - want).abs() <= relative * want.abs(),
        "{what}: {have}, expected {want}"
    );
}

/// The mean pose error of each movement by the runtime's model, and so its zero deviation.
fn zero_deviations(problem: &Problem<'_>, parameters: &Parameters) -> Vec<ZeroDeviation> {
    let inverse = inverse(&parameters.geometry().plane()).expect("sound");
    let mut zeros = vec![ZeroDeviation::NONE; problem.rows.movements_of_log];
    for (number, movement) in problem.rows.numbered_movements() {
        let rows = &problem.rows.rows[movement];
        let mut mean = [0.0; 3];
        for row in rows {
            let pose = pose_by_the_runtime(parameters, &inverse, row, &PlanarPose::ZERO);
            for k in 0..3 {
                mean[k] += (pose[k] - row.reference[k]) / rows.len() as f64;
            }
        }
        let range = &problem.stage.search.delta_m;
        // A search holds them within their range.
        let mut zero = ZeroDeviation::from_mean_error(parameters, mean, range);
        zero.delta_m = zero.delta_m.map(|delta| range.clip(delta));
        zeros[number] = zero;
    }
    zeros
}

/// The smallest phi / eta of all rows by the runtime's model.
fn smallest_share(problem: &Problem<'_>, parameters: &Parameters) -> f64 {
    let share = |row: &FieldRow| {
        let shares = phi(parameters, row).into_iter().zip(parameters.eta());
        let shares = shares.map(|(phi, eta)| phi / eta);
        shares.fold(f64::INFINITY, f64::min)
    };
    problem
        .rows
        .rows
        .iter()
        .map(share)
        .fold(f64::INFINITY, f64::min)
}

#[test]
fn the_delta_form_equals_the_runtimes_model_at_the_best_zero_deviations() {
    let (mut stage, dataset) = (stage(), dataset(7, 5));
    // Half of the zero deviations in the log.
    stage.search.delta_m = Range {
        low: -2e-6,
        high: 2e-6,
    };
    let (mut clipped, mut beyond_pole) = (0, 0);
    for model in MODELS {
        let problem = problem(&dataset, &stage, model);
        let cost = objective(&problem, Projection::Delta);
        let near = individual(&cost, &truth());
        for number in 0..50 {
            // From the truth to anywhere in the box.
            let share = number as f64 / 49.0;
            let far = draw(&cost, number);
            let mix = |(near, far): (&f64, &f64)| near + share * (far - near);
            let individual: Vec<f64> = near.iter().zip(&far).map(mix).collect();
            let parameters = cost.parameters(&individual).expect("parameters");
            let zeros = if Model::from_kind(model).has_zero_deviation {
                zero_deviations(&problem, &parameters)
            } else {
                vec![ZeroDeviation::NONE; problem.rows.movements_of_log]
            };
            let cost = cost.cost(&individual);
            if smallest_share(&problem, &parameters) < SHARE_MIN {
                assert!(cost.is_nan());
                beyond_pole += 1;
                continue;
            }
            clipped += zeros.iter().filter(|zero| zero.is_beyond).count();
            let delta_m: Vec<_> = zeros.iter().map(|zero| zero.delta_m).collect();
            let by_runtime = fitness_by_the_runtime(&problem, &parameters, &delta_m);
            assert_close(cost, by_runtime, 1e-10, "delta form");
        }
    }
    assert!(clipped > 100 && clipped < 600, "{clipped}");
    assert!((1..40).contains(&beyond_pole), "{beyond_pole}");
}

#[test]
fn the_linear_form_equals_the_runtimes_model_at_its_own_gain_and_offsets() {
    let (stage, dataset) = (stage(), dataset(9, 6));
    let problem = problem(&dataset, &stage, ModelKind::M31);
    let cost = objective(&problem, Projection::Linear);
    let mut wide = stage.clone();
    wide.search.delta_m = Range {
        low: -1.0,
        high: 1.0,
    };
    let unclipped = Problem {
        stage: &wide,
        ..problem.clone()
    };
    let near = individual(&cost, &truth());
    for number in 0..50 {
        let individual: Vec<f64> = near
            .iter()
            .zip(draw(&cost, number))
            .map(|(near, far)| near + 0.1 * (far - near))
            .collect();
        let parameters = cost.parameters(&individual).expect("a gain");
        let by_runtime = |parameters: &Parameters| {
            let zeros = zero_deviations(&unclipped, parameters);
            let delta_m: Vec<_> = zeros.iter().map(|zero| zero.delta_m).collect();
            fitness_by_the_runtime(&problem, parameters, &delta_m)
        };
        let best = by_runtime(&parameters);
        assert_close(cost.cost(&individual), best, 1e-9, "linear form");
        // No other gain does better with these ratios.
        let mut other = parameters;
        other.values[number % 3] *= 1.0 + 1e-3;
        assert!(by_runtime(&other) > best);
    }
}

#[test]
fn the_forms_have_the_papers_unknowns_and_bounds() {
    let (stage, dataset) = (stage(), dataset(57, 1));
    let unknowns = |model| {
        let problem = problem(&dataset, &stage, model);
        [
            objective(&problem, Projection::None).bounds().len(),
            objective(&problem, Projection::Delta).bounds().len(),
        ]
    };
    assert_eq!(unknowns(ModelKind::M31), [192, 18]);
    assert_eq!(unknowns(ModelKind::M30), [183, 9]);
    assert_eq!(unknowns(ModelKind::M15), [12, 9]);
    assert_eq!(unknowns(ModelKind::M12), [9, 6]);
    let problem = problem(&dataset, &stage, ModelKind::M31);
    let full = objective(&problem, Projection::None);
    // H3y (Table 3), c of B (Table 5), and the last zero deviation.
    let bounds = |index: usize| (full.bounds()[index].low, full.bounds()[index].high);
    assert_eq!(bounds(5), (0.26, 0.46));
    assert_eq!(bounds(19), (-5000.0, 0.0));
    assert_eq!(bounds(191), (-10e-6, 10e-6));
    // c / eta of C: 0 to 5000 over 0.72, cut where 1 + r Ry would be 0.05 at the lowest Ry.
    let linear = objective(&problem, Projection::Linear);
    let last = linear.bounds()[8];
    let lowest = problem
        .rows
        .rows
        .iter()
        .map(|row| row.vertical[2])
        .fold(0.0, f64::min);
    assert!(
        5000.0 / 0.72 * -lowest > 1.0,
        "the box reaches beyond the pole"
    );
    assert_eq!((last.low, last.high), (0.0, -0.95 / lowest));
    let no_ratios = Problem {
        model: Model::from_kind(ModelKind::M30),
        ..problem.clone()
    };
    assert!(Objective::new(&no_ratios, Projection::Linear).is_none());
}

#[test]
fn whatever_lies_beyond_a_pole_costs_nan() {
    let (stage, dataset) = (stage(), dataset(6, 4));
    let problem = problem(&dataset, &stage, ModelKind::M31);
    let cost = objective(&problem, Projection::Linear);
    let sound = individual(&cost, &truth());
    assert!(cost.cost(&sound) < 3.0);
    // a / eta of A with phi / eta of 0.06, 0.04, -0.5 in the first row.
    let [z, rx, ry] = problem.rows.rows[0].vertical;
    let at_share = |share: f64| {
        let mut individual = sound.clone();
        individual[0] = (share - 1.0 - sound[1] * rx - sound[2] * ry) / z;
        cost.cost(&individual)
    };
    assert!(at_share(0.06).is_finite());
    assert!(at_share(0.04).is_nan() && at_share(-0.5).is_nan());
}
