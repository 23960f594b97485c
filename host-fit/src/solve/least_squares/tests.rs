//! The least-squares fit against known truth, an independent crate, and its own derivatives.

use super::coordinates::{Boxed, Coordinates, parameters_of, point_of};
use super::descend::{Sums, descend};
use super::normal::{Column, cost, descent};
use super::scatter::{Offset, regressors, scatter};
use crate::input::shipped::STAGE_TOML;
use crate::input::stage::Stage;
use crate::problem::Problem;
use crate::problem::model::{COUNT, Model};
use crate::problem::parameters::Parameters;
use crate::problem::synthetic::Protocol;
use crate::solve::{Projection, Solution, Solver, SolverOptions};
use levenberg_marquardt::{LeastSquaresProblem, LevenbergMarquardt};
use nalgebra::{DMatrix, DVector, Dyn, Owned};
use runtime::ModelKind;

fn stage() -> Stage {
    Stage::from_toml(STAGE_TOML, "stage.toml".as_ref()).expect("the shipped stage")
}

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

fn solve(problem: &Problem, projection: Projection) -> Solution {
    let options = SolverOptions::new(projection, 1);
    (Solver::LeastSquares.solve(problem, &options)).expect("a solution")
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
fn truth_is_recovered_from_a_log_without_noise_in_every_form() {
    let stage = stage();
    let exact = Protocol {
        zero_deviation_m: 4e-6,
        ..Protocol::exact(truth(), 40)
    };
    let dataset = exact.dataset(&stage);
    let all: Vec<usize> = (0..dataset.rows.len()).collect();
    let problem = Problem::new(&dataset, &all, &stage, Model::of(ModelKind::M31));
    for projection in [Projection::Linear, Projection::Delta, Projection::None] {
        let solution = solve(&problem, projection);
        for (k, (have, want)) in solution
            .parameters
            .values
            .iter()
            .zip(truth().values)
            .enumerate()
        {
            assert!(
                (have - want).abs() < 1e-5 * want.abs() + 1e-8,
                "{projection:?} {k}: {have} {want}"
            );
        }
        // The forward model holds the zero deviation that the closed form gives back.
        let largest = solution
            .delta_m
            .iter()
            .flatten()
            .fold(0.0f64, |m, d| m.max(d.abs()));
        assert!(largest > 3e-6 && largest <= 4e-6 + 1e-12, "{largest}");
    }
}

/// Derivatives of the cost with respect to the 18 parameters against differences of the cost.
#[test]
fn gradient_matches_differences_of_the_cost() {
    let stage = stage();
    let dataset = noisy(3).dataset(&stage);
    let all: Vec<usize> = (0..dataset.rows.len()).collect();
    let problem = Problem::new(&dataset, &all, &stage, Model::of(ModelKind::M31));
    let offsets = vec![Offset::Free; problem.groups.len()];
    let boxed = Boxed {
        stage: &stage,
        model: Model::of(ModelKind::M31),
    };
    let mut at = boxed.unknowns(&truth());
    at *= 1.01;
    // Angles that are not small, so that the sign of a sine shows.
    for (k, theta) in [0.05, -0.04, 0.06].into_iter().enumerate() {
        at[3 + k] = theta;
    }
    let cost_at = |p: &Column| {
        let point = boxed.point(p).expect("regular");
        let sums = scatter(&problem, &point.ratios, &offsets).expect("no pole");
        cost(&sums, &point.gain, problem.weights)
    };
    let point = boxed.point(&at).expect("regular");
    let sums = scatter(&problem, &point.ratios, &offsets).expect("no pole");
    let gradient = boxed.jacobian(&at, &point).expect("a chain").transpose()
        * descent(&sums, &point.gain, problem.weights);
    for k in 0..COUNT {
        let step = 1e-4 * at[k].abs().max(0.05);
        let (mut up, mut down) = (at, at);
        up[k] += step;
        down[k] -= step;
        let difference = -(cost_at(&up) - cost_at(&down)) / (4.0 * step);
        assert!(
            (gradient[k] - difference).abs() < 1e-4 * difference.abs() + 1e-7 * cost_at(&at) / step,
            "{k}: {} {difference}",
            gradient[k]
        );
    }
}

/// The same residuals for the `levenberg-marquardt` crate: every unknown and every offset its
/// own, nothing projected, differences for the Jacobian.
struct Plain<'p> {
    problem: &'p Problem<'p>,
    x: DVector<f64>,
}

impl Plain<'_> {
    fn residuals_at(&self, x: &DVector<f64>) -> DVector<f64> {
        let scaled: [f64; COUNT] = std::array::from_fn(|k| x[k] * truth().values[k]);
        let point = point_of(&Parameters { values: scaled }).expect("regular");
        let mut out = Vec::new();
        for (index, group) in self.problem.groups.iter().enumerate() {
            for row in &self.problem.rows[group.rows.clone()] {
                let z = regressors(row, &point.ratios).expect("no pole");
                for axis in 0..3 {
                    let decoded: f64 = (0..3).map(|i| point.gain[(axis, i)] * z[i]).sum();
                    out.push(decoded - x[COUNT + 3 * index + axis] - row.reference_um[axis]);
                }
            }
        }
        DVector::from_vec(out)
    }
}

impl LeastSquaresProblem<f64, Dyn, Dyn> for Plain<'_> {
    type ParameterStorage = Owned<f64, Dyn>;
    type ResidualStorage = Owned<f64, Dyn>;
    type JacobianStorage = Owned<f64, Dyn, Dyn>;

    fn set_params(&mut self, x: &DVector<f64>) {
        self.x = x.clone();
    }
    fn params(&self) -> DVector<f64> {
        self.x.clone()
    }
    fn residuals(&self) -> Option<DVector<f64>> {
        Some(self.residuals_at(&self.x))
    }
    fn jacobian(&self) -> Option<DMatrix<f64>> {
        let columns: Vec<DVector<f64>> = (0..self.x.len())
            .map(|k| {
                let (mut up, mut down) = (self.x.clone(), self.x.clone());
                up[k] += 1e-5;
                down[k] -= 1e-5;
                (self.residuals_at(&up) - self.residuals_at(&down)) / 2e-5
            })
            .collect();
        Some(DMatrix::from_columns(&columns))
    }
}

#[test]
fn optimum_equals_that_of_an_independent_solver_without_projection() {
    let stage = stage();
    let dataset = Protocol {
        settings: crate::problem::synthetic::TABLE_6[..9]
            .iter()
            .chain(&crate::problem::synthetic::TABLE_6[13..15])
            .copied()
            .collect(),
        rows_per_movement: 8,
        ..noisy(5)
    }
    .dataset(&stage);
    let all: Vec<usize> = (0..dataset.rows.len()).collect();
    let problem = Problem::new(&dataset, &all, &stage, Model::of(ModelKind::M31));
    let ours = solve(&problem, Projection::Linear);
    let mut start = DVector::zeros(COUNT + 3 * problem.groups.len());
    start.rows_mut(0, COUNT).fill(1.0);
    let (found, report) = LevenbergMarquardt::new().minimize(Plain {
        problem: &problem,
        x: start,
    });
    let theirs = 2.0 * report.objective_function;
    assert!(
        (ours.cost - theirs).abs() < 1e-6 * theirs,
        "{} {theirs} {report:?}",
        ours.cost
    );
    for k in 0..18 {
        let ours = ours.parameters.values[k];
        let theirs = found.x[k] * truth().values[k];
        assert!(
            (ours - theirs).abs() < 2e-3 * theirs.abs(),
            "{k}: {ours} {theirs}"
        );
    }
}

#[test]
fn a_truth_outside_the_box_ends_on_its_edge_and_is_named() {
    let mut narrow = stage();
    let mut eta = narrow.search.of("eta").expect("known");
    eta[0].high = 0.85;
    narrow.search.set("eta", eta);
    let dataset = noisy(7).dataset(&narrow);
    let all: Vec<usize> = (0..dataset.rows.len()).collect();
    let problem = Problem::new(&dataset, &all, &narrow, Model::of(ModelKind::M31));
    let solution = solve(&problem, Projection::Linear);
    assert!((solution.parameters.eta()[0] - 0.85).abs() < 1e-12);
    let names: Vec<String> = solution.at_limit.iter().map(|id| id.name()).collect();
    assert_eq!(names, ["eta_a"]);
    // Worse than free, better than the free optimum merely clipped.
    let free = solve(
        &Problem::new(&dataset, &all, &stage(), Model::of(ModelKind::M31)),
        Projection::Linear,
    );
    let boxed = Boxed {
        stage: &narrow,
        model: Model::of(ModelKind::M31),
    };
    let point = point_of(&boxed.clipped(&free.parameters)).expect("regular");
    let offsets = vec![Offset::Free; problem.groups.len()];
    let sums = scatter(&problem, &point.ratios, &offsets).expect("no pole");
    assert!(free.cost < solution.cost);
    assert!(solution.cost < cost(&sums, &point.gain, problem.weights));

    let mut high = stage();
    let mut eta = high.search.of("eta").expect("known");
    eta[2].low = 0.88;
    high.search.set("eta", eta);
    let solution = solve(
        &Problem::new(&dataset, &all, &high, Model::of(ModelKind::M31)),
        Projection::Linear,
    );
    let names: Vec<String> = solution.at_limit.iter().map(|id| id.name()).collect();
    assert_eq!(names, ["eta_c"]);
}

#[test]
fn zero_deviations_beyond_their_range_are_clipped_as_unknowns() {
    let mut tight = stage();
    tight.search.delta_m.low = -2e-6;
    tight.search.delta_m.high = 2e-6;
    let dataset = noisy(11).dataset(&tight);
    let all: Vec<usize> = (0..dataset.rows.len()).collect();
    let problem = Problem::new(&dataset, &all, &tight, Model::of(ModelKind::M31));
    let solution = solve(&problem, Projection::None);
    assert!(solution.delta_m.iter().flatten().all(|d| d.abs() <= 2e-6));
    // As unknowns of the fit they cost no more than clipped after it, and more than free.
    let afterwards = solve(&problem, Projection::Linear);
    assert!(afterwards.delta_m.iter().flatten().all(|d| d.abs() <= 2e-6));
    assert!(solution.cost <= afterwards.cost * (1.0 + 1e-6));
    let wide = stage();
    let free = Problem::new(&dataset, &all, &wide, Model::of(ModelKind::M31));
    assert!(2.0 * solve(&free, Projection::Linear).cost < solution.cost);
}

#[test]
fn a_start_next_to_a_pole_is_refused() {
    let stage = stage();
    let dataset = noisy(1).dataset(&stage);
    let all: Vec<usize> = (0..dataset.rows.len()).collect();
    let problem = Problem::new(&dataset, &all, &stage, Model::of(ModelKind::M31));
    let mut pole = truth().values;
    pole[9] = -0.8671 / 250e-6;
    let boxed = Boxed {
        stage: &stage,
        model: Model::of(ModelKind::M31),
    };
    let offsets = vec![Offset::Free; problem.groups.len()];
    assert!(
        descend(
            Sums {
                problem: &problem,
                moments: None
            },
            &offsets,
            &boxed,
            boxed.unknowns(&Parameters { values: pole })
        )
        .is_none()
    );
}

#[test]
fn parameters_and_gains_undo_each_other() {
    let point = point_of(&truth()).expect("regular");
    let back = parameters_of(&point).expect("regular").values;
    for (have, want) in back.iter().zip(truth().values) {
        assert!((have - want).abs() < 1e-12 * want.abs() + 1e-15);
    }
}

/// Standard errors against the spread over many logs that differ only in their noise.
#[test]
fn standard_errors_match_the_spread_over_repeated_logs() {
    let stage = stage();
    let logs = 60;
    let mut sums = [[0.0; 2]; COUNT];
    let mut claimed = [0.0; COUNT];
    for seed in 0..logs {
        let dataset = noisy(1000 + seed).dataset(&stage);
        let all: Vec<usize> = (0..dataset.rows.len()).collect();
        let problem = Problem::new(&dataset, &all, &stage, Model::of(ModelKind::M31));
        let solution = solve(&problem, Projection::Linear);
        let errors = crate::judge::uncertainty::uncertainty(&problem, &solution.parameters, &[])
            .expect("evaluated");
        for k in 0..18 {
            let value = solution.parameters.values[k];
            let deviation = value - truth().values[k];
            sums[k][0] += deviation;
            sums[k][1] += deviation * deviation;
            claimed[k] += errors.standard_error[k].expect("determined") / logs as f64;
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

/// With the coordinates of the probes fixed, the lever arms follow the misalignments: no set of
/// angles near the solution does better, each arm moving with its angle.
#[test]
fn lever_arms_on_their_limits_follow_the_misalignments() {
    let mut fixed = stage();
    let h = fixed.designed;
    let point = |value| crate::input::stage::Range {
        low: value,
        high: value,
    };
    fixed.search.h_m = runtime::geometry::ProbeCoordinates {
        h1x_m: point(h.h1x_m),
        h1y_m: point(h.h1y_m),
        h2x_m: point(h.h2x_m),
        h2y_m: point(h.h2y_m),
        h3x_m: point(h.h3x_m),
        h3y_m: point(h.h3y_m),
    };
    let dataset = noisy(13).dataset(&fixed);
    let all: Vec<usize> = (0..dataset.rows.len()).collect();
    let problem = Problem::new(&dataset, &all, &fixed, Model::of(ModelKind::M31));
    let solution = solve(&problem, Projection::Linear);
    assert!(solution.at_limit.is_empty(), "{:?}", solution.at_limit);
    let offsets = vec![Offset::Free; problem.groups.len()];
    let cost_at = |theta: [f64; 3]| {
        let mut p = solution.parameters;
        p.values[..3].copy_from_slice(&h.lever_arms_m(theta));
        p.values[3..6].copy_from_slice(&theta);
        let point = point_of(&p).expect("regular");
        let sums = scatter(&problem, &point.ratios, &offsets).expect("no pole");
        cost(&sums, &point.gain, problem.weights)
    };
    let theta = solution.parameters.geometry().misalignment_rad;
    assert!((cost_at(theta) / solution.cost - 1.0).abs() < 1e-9);
    for probe in 0..3 {
        for step in [-1e-4, 1e-4] {
            let mut moved = theta;
            moved[probe] += step;
            assert!(cost_at(moved) > solution.cost, "probe {probe}, step {step}");
        }
    }
}
