//! `--project none`: the paper's unknowns, every zero deviation among them.
//!
//! An individual holds, in SI units: H1x, H1y, H2x, H2y, H3x, H3y; theta of A, B, C; and as
//! the model has them eta, a, b, c of A, B, C and delta of A, B, C of each movement of the log:
//! 192 numbers for Model (31) and 57 movements. The bounds are those of Tables 3 and 5. The
//! two coordinates of a probe act through its lever arm alone, so three of the unknowns are
//! redundant; they are kept because the paper has them.

use super::lanes::{Individuals, LaneCost, Lanes, dot, each, for_each_eight};
use super::model::{Linearized, Plane, Turns, shares};
use crate::input::stage::Range;
use crate::problem::Problem;
use crate::problem::parameters::Parameters;
use crate::solve::search::cost::CostFunction;
use runtime::ModelKind;
use runtime::geometry::ProbeCoordinates;
use runtime::model::Sensitivity;

/// Where the misalignments start.
const THETA: usize = 6;
/// Where eta starts.
const ETA: usize = 9;
/// Where a, b, c start.
const SLOPES: usize = 12;

/// Root mean square of all pose errors as a function of the paper's unknowns.
#[derive(Clone, Debug)]
pub struct FullCost<'a> {
    problem: &'a Problem<'a>,
    bounds: Vec<Range>,
}

/// Where the zero deviations start, for models that have them.
fn deltas_start(model: ModelKind) -> usize {
    if model.has_vertical_terms() {
        21
    } else {
        SLOPES
    }
}

impl<'a> FullCost<'a> {
    /// The cost of a problem's rows.
    pub fn new(problem: &'a Problem<'a>) -> Self {
        let search = &problem.stage.search;
        let term = |key| search.of(key).unwrap_or_default();
        let h = &search.h_m;
        let mut bounds = vec![h.h1x_m, h.h1y_m, h.h2x_m, h.h2y_m, h.h3x_m, h.h3y_m];
        bounds.extend(term("theta_deg"));
        if problem.model.has_sensitivity() {
            bounds.extend(term("eta"));
        }
        if problem.model.has_vertical_terms() {
            bounds.extend(term("a_per_m"));
            bounds.extend(term("b_per_rad"));
            bounds.extend(term("c_per_rad"));
        }
        if problem.model.has_zero_deviation() {
            bounds.extend(vec![search.delta_m; 3 * problem.movements]);
        }
        Self { problem, bounds }
    }

    /// The parameters of an individual.
    pub fn parameters(&self, individual: &[f64]) -> Parameters {
        let u = |index: usize| individual.get(index).copied().unwrap_or(0.0);
        let coordinates = ProbeCoordinates {
            h1x_m: u(0),
            h1y_m: u(1),
            h2x_m: u(2),
            h2y_m: u(3),
            h3x_m: u(4),
            h3y_m: u(5),
        };
        let model = self.problem.model;
        Parameters {
            geometry: coordinates.geometry([0, 1, 2].map(|k| u(THETA + k))),
            sensitivity: [0, 1, 2].map(|k| {
                let eta = if model.has_sensitivity() {
                    u(ETA + k)
                } else {
                    1.0
                };
                let mut slopes = Sensitivity::constant(eta);
                if model.has_vertical_terms() {
                    slopes.per_z_m = u(SLOPES + k);
                    slopes.per_rx_rad = u(SLOPES + 3 + k);
                    slopes.per_ry_rad = u(SLOPES + 6 + k);
                }
                slopes
            }),
        }
    }

    /// The zero deviation of each movement of the log, m; zero for movements without rows,
    /// whose unknowns act on nothing.
    pub fn delta_m(&self, individual: &[f64]) -> Vec<[f64; 3]> {
        let mut delta_m = vec![[0.0; 3]; self.problem.movements];
        if self.problem.model.has_zero_deviation() {
            for group in &self.problem.groups {
                let start = deltas_start(self.problem.model) + 3 * group.movement;
                if let Some(&[a, b, c]) = individual.get(start..start + 3) {
                    delta_m[group.movement] = [a, b, c];
                }
            }
        }
        delta_m
    }

    /// An individual with these parameters and zero deviations, for a warm start. The
    /// coordinates are the nearest to the designed ones that have the lever arms.
    pub fn individual(&self, parameters: &Parameters, delta_m: &[[f64; 3]]) -> Vec<f64> {
        let model = self.problem.model;
        let h = self
            .problem
            .stage
            .designed
            .nearest_with(&parameters.geometry);
        let mut individual = vec![h.h1x_m, h.h1y_m, h.h2x_m, h.h2y_m, h.h3x_m, h.h3y_m];
        individual.extend(parameters.geometry.misalignment_rad);
        if model.has_sensitivity() {
            individual.extend(parameters.eta());
        }
        if model.has_vertical_terms() {
            individual.extend(parameters.sensitivity.map(|s| s.per_z_m));
            individual.extend(parameters.sensitivity.map(|s| s.per_rx_rad));
            individual.extend(parameters.sensitivity.map(|s| s.per_ry_rad));
        }
        if model.has_zero_deviation() {
            individual.extend(delta_m.iter().flatten());
        }
        individual
    }
}

impl LaneCost for FullCost<'_> {
    fn dimensions(&self) -> usize {
        self.bounds.len()
    }

    #[inline(always)]
    fn cost_of_eight(&self, u: &Individuals<'_>) -> Lanes {
        let model = self.problem.model;
        let turns = Turns::of(u.three(THETA));
        let Turns { sin, cos } = &turns;
        // Third column of PM (equation 11).
        let lever_arm_m = [
            u.number(0) * cos[0] + u.number(1) * sin[0],
            u.number(3) * sin[1] - u.number(2) * cos[1],
            u.number(4) * sin[2] - u.number(5) * cos[2],
        ];
        let plane = Plane::new(lever_arm_m, &turns);
        let eta = if model.has_sensitivity() {
            u.three(ETA)
        } else {
            [Lanes::splat(1.0); 3]
        };
        let slopes = if model.has_vertical_terms() {
            each(|k| u.three(SLOPES + 3 * k))
        } else {
            [[Lanes::ZERO; 3]; 3]
        };
        let linearized = Linearized::new(&plane, eta, slopes);
        let deltas = deltas_start(model);
        let mut sums = [Lanes::ZERO; 3];
        for group in &self.problem.groups {
            let zero = if model.has_zero_deviation() {
                let delta_m = u.three(deltas + 3 * group.movement);
                let delta_um = each(|k| delta_m[k] * 1e6);
                each(|k| dot(&linearized.gain[k], delta_um))
            } else {
                [Lanes::ZERO; 3]
            };
            for row in &self.problem.rows[group.rows.clone()] {
                let shares = shares(&linearized.ratios, row);
                let error = linearized.pose_error(shares, row);
                let error = each(|k| error[k] - zero[k]);
                sums = each(|k| sums[k] + error[k] * error[k]);
            }
        }
        let [x, y, rz] = self.problem.weights;
        ((sums[0] * x + sums[1] * y) + sums[2] * rz).map(|sum| self.problem.fitness(sum))
    }
}

impl CostFunction for FullCost<'_> {
    fn bounds(&self) -> &[Range] {
        &self.bounds
    }

    fn cost(&self, individual: &[f64]) -> f64 {
        let mut cost = [f64::NAN];
        self.costs(individual, &mut cost);
        cost[0]
    }

    fn costs(&self, individuals: &[f64], costs: &mut [f64]) {
        for_each_eight(self, individuals, costs);
    }

    fn evaluation_ns(&self) -> f64 {
        self.problem.rows.len() as f64
    }
}
