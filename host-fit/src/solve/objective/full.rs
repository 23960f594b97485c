//! `--project none`: the paper's unknowns, every zero deviation among them.
//!
//! An individual holds, in SI units: H1x, H1y, H2x, H2y, H3x, H3y; theta of A, B, C; and as
//! the model has them eta, a, b, c of A, B, C and delta of A, B, C of each movement of the log:
//! 192 numbers for Model (31) and 57 movements. The bounds are those of Tables 3 and 5. The
//! two coordinates of a probe act through its lever arm alone, so three of the unknowns are
//! redundant; they are kept because the paper has them.

use super::lanes::{Individuals, LaneCost, Lanes, each};
use super::model::{Linearized, Plane, fitness, shares};
use crate::input::stage::Range;
use crate::problem::Problem;
use crate::problem::parameters::{self, Parameters, search_box};
use runtime::geometry::{ProbeCoordinates, SensingAxes};
use runtime::model::dot;

/// Where the misalignments start.
const THETA: usize = 6;
/// Where eta starts, and then the slopes, as far as the model fits them.
const ETA: usize = 9;

/// Root mean square of all pose errors as a function of the paper's unknowns.
#[derive(Clone, Debug)]
pub struct FullCost<'a> {
    problem: &'a Problem<'a>,
    bounds: Vec<Range>,
}

impl<'a> FullCost<'a> {
    /// The cost of a problem's rows.
    pub fn new(problem: &'a Problem<'a>) -> Self {
        let search = &problem.stage.search;
        let mut bounds = search.h_m.pairs().concat();
        // The lever arms, which these coordinates make, come first in a model.
        let ranges = search_box(problem.stage, problem.model, [0.0; 3]);
        bounds.extend(&ranges[parameters::THETA..problem.model.free_count()]);
        if problem.model.has_zero_deviation {
            bounds.extend(vec![search.delta_m; 3 * problem.movements]);
        }
        Self { problem, bounds }
    }

    /// Where the zero deviations start, for models that have them: each coordinate pair makes one
    /// lever arm.
    const fn deltas_start(&self) -> usize {
        self.problem.model.free_count() + 3
    }

    /// The parameters of an individual.
    pub fn parameters(&self, individual: &[f64]) -> Parameters {
        let u = |index: usize| individual.get(index).copied().unwrap_or(0.0);
        let pairs = [0, 1, 2].map(|k| [u(2 * k), u(2 * k + 1)]);
        let coordinates = ProbeCoordinates::from_pairs(pairs);
        let mut parameters = Parameters::designed(self.problem.stage);
        for index in parameters::THETA..self.problem.model.free_count() {
            parameters.values[index] = u(index + 3);
        }
        let arms = coordinates.lever_arms_m([0, 1, 2].map(|k| u(THETA + k)));
        parameters.values[..3].copy_from_slice(&arms);
        parameters
    }

    /// The zero deviation of each movement of the log, m; zero for movements without rows,
    /// whose unknowns act on nothing.
    pub fn delta_m(&self, individual: &[f64]) -> Vec<[f64; 3]> {
        let mut delta_m = vec![[0.0; 3]; self.problem.movements];
        if self.problem.model.has_zero_deviation {
            for group in &self.problem.groups {
                let start = self.deltas_start() + 3 * group.movement;
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
            .nearest_with(&parameters.geometry());
        let mut individual = h.pairs().concat();
        individual.extend(&parameters.values[parameters::THETA..model.free_count()]);
        if model.has_zero_deviation {
            individual.extend(delta_m.iter().flatten());
        }
        individual
    }
}

impl LaneCost for FullCost<'_> {
    fn problem(&self) -> &Problem<'_> {
        self.problem
    }

    fn box_of_eight(&self) -> &[Range] {
        &self.bounds
    }

    #[inline(always)]
    fn cost_of_eight<const K: usize>(&self, u: &Individuals<'_>) -> Lanes {
        let model = self.problem.model;
        let axes = SensingAxes::at(u.three(THETA));
        let coordinates_m = each(|k| [u.number(2 * k), u.number(2 * k + 1)]);
        let plane = Plane::new(&axes, axes.lever_arms_m(coordinates_m));
        let (linearized, _) = Linearized::<K>::new(&plane, model, u, ETA);
        let mut sums = [Lanes::ZERO; 3];
        for group in &self.problem.groups {
            let zero = if model.has_zero_deviation {
                let delta_m = u.three(self.deltas_start() + 3 * group.movement);
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
        fitness(self.problem, sums)
    }
}
