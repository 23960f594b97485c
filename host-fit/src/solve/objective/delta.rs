//! `--project delta`: the zero deviations in closed form, 18 unknowns left.
//!
//! Given the other parameters, the pose is linear in a movement's zero deviation, and the best
//! one takes off the movement's mean pose error: delta = eta (PM mean error), clipped to its
//! range as the full form would hold it there.
//!
//! An individual holds, in the order of [`ParameterId`] and as far as the model has them: the
//! lever arms, theta, eta, a, b, c of A, B, C, in SI units; but a lever arm is written as its
//! place in its range, 0 to 1, since the range, the image of the box of two coordinates,
//! moves with theta. So a box in these unknowns is the box of the paper, without the three
//! unknowns that act on nothing and without what lies beyond the poles ([`super::poles`]).

use super::lanes::{Individuals, LaneCost, Lanes, dot, each, for_each_eight};
use super::model::{Linearized, Plane, Turns, shares};
use super::poles::{Smallest, cut, vertical_extent};
use crate::input::stage::Range;
use crate::problem::Problem;
use crate::problem::parameters::{COUNT, ParameterId, Parameters, Quantity, search_box};
use crate::solve::search::cost::CostFunction;

/// Where the misalignments start.
const THETA: usize = 3;
/// Where eta starts.
const ETA: usize = 6;
/// Where a, b, c start.
const SLOPES: usize = 9;

/// Root mean square of all pose errors at the best zero deviations within their range.
#[derive(Clone, Debug)]
pub struct DeltaCost<'a> {
    problem: &'a Problem<'a>,
    bounds: Vec<Range>,
    /// Middle and half width of each coordinate's range: x and y of A, B, C, m.
    arms_m: [[(f64, f64); 2]; 3],
}

fn middle_and_half(range: Range) -> (f64, f64) {
    (0.5 * (range.low + range.high), 0.5 * range.width())
}

impl<'a> DeltaCost<'a> {
    /// The cost of a problem's rows.
    pub fn new(problem: &'a Problem<'a>) -> Self {
        let ranges = search_box(problem.stage, [0.0; 3]);
        let share = Range {
            low: 0.0,
            high: 1.0,
        };
        let extent = vertical_extent(&problem.rows);
        let bound = |(id, range): (ParameterId, Range)| {
            // With the largest eta the pole is farthest away.
            let eta = problem.stage.search.of("eta").unwrap_or_default()[id.probe];
            let eta = eta.high.abs().max(eta.low.abs());
            let range = match id.quantity {
                Quantity::LeverArm => share,
                Quantity::Misalignment | Quantity::Eta => range,
                Quantity::PerZ => cut(range, eta, extent[0]),
                Quantity::PerRx => cut(range, eta, extent[1]),
                Quantity::PerRy => cut(range, eta, extent[2]),
            };
            id.is_free_in(problem.model).then_some(range)
        };
        let h = &problem.stage.search.h_m;
        let coordinates = [[h.h1x_m, h.h1y_m], [h.h2x_m, h.h2y_m], [h.h3x_m, h.h3y_m]];
        Self {
            problem,
            bounds: ParameterId::all().zip(ranges).filter_map(bound).collect(),
            arms_m: coordinates.map(|probe| probe.map(middle_and_half)),
        }
    }

    /// Lever arms in m from their places in their ranges.
    #[inline(always)]
    fn lever_arms_m(&self, places: [Lanes; 3], turns: &Turns) -> [Lanes; 3] {
        let Turns { sin, cos } = turns;
        // Factors of the two coordinates in the third column of PM (equation 11).
        let factors = [[cos[0], sin[0]], [-cos[1], sin[1]], [sin[2], -cos[2]]];
        each(|k| {
            let [x, y] = factors[k];
            let [(x_middle, x_half), (y_middle, y_half)] = self.arms_m[k];
            let middle = x * x_middle + y * y_middle;
            let half = x.abs() * x_half + y.abs() * y_half;
            middle + (places[k] * 2.0 - 1.0) * half
        })
    }

    /// The parameters of an individual.
    pub fn parameters(&self, individual: &[f64]) -> Parameters {
        let u = |index: usize| individual.get(index).copied().unwrap_or(0.0);
        let mut values = Parameters::designed(self.problem.stage).to_array();
        for (index, value) in values
            .iter_mut()
            .enumerate()
            .take(individual.len().min(COUNT))
        {
            *value = u(index);
        }
        let turns = Turns::of([0, 1, 2].map(|k| Lanes::splat(u(THETA + k))));
        let places = [0, 1, 2].map(|k| Lanes::splat(u(k)));
        for (value, arm) in values.iter_mut().zip(self.lever_arms_m(places, &turns)) {
            *value = arm.0[0];
        }
        Parameters::from_array(&values)
    }

    /// An individual with these parameters, for a warm start; outside the bounds where the
    /// parameters are outside their box.
    pub fn individual(&self, parameters: &Parameters) -> Vec<f64> {
        let values = parameters.to_array();
        let turns = Turns::of([0, 1, 2].map(|k| Lanes::splat(values[THETA + k])));
        let [low, high] = [0.0, 1.0].map(|t| self.lever_arms_m([Lanes::splat(t); 3], &turns));
        let mut individual = values[..self.bounds.len().min(COUNT)].to_vec();
        for (k, place) in individual.iter_mut().enumerate().take(3) {
            let (low, high) = (low[k].0[0], high[k].0[0]);
            *place = (values[k] - low) / (high - low);
        }
        individual
    }
}

impl LaneCost for DeltaCost<'_> {
    fn dimensions(&self) -> usize {
        self.bounds.len()
    }

    #[inline(always)]
    fn cost_of_eight(&self, u: &Individuals<'_>) -> Lanes {
        let model = self.problem.model;
        let turns = Turns::of(u.three(THETA));
        let plane = Plane::new(self.lever_arms_m(u.three(0), &turns), &turns);
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
        let range = self.problem.stage.search.delta_m;
        let (low_um, high_um) = (range.low * 1e6, range.high * 1e6);
        // The zero deviation of a pose offset; the gain turns it back.
        let to_delta = each(|i| each(|j| plane.rows[i][j] * eta[i]));
        let mut smallest = Smallest::NONE;
        let mut total = [Lanes::ZERO; 3];
        for group in &self.problem.groups {
            let rows = &self.problem.rows[group.rows.clone()];
            let mut sums = [Lanes::ZERO; 3];
            let mut squares = [Lanes::ZERO; 3];
            for row in rows {
                let shares = shares(&linearized.ratios, row);
                smallest.note(shares[0].smaller(shares[1]).smaller(shares[2]));
                let error = linearized.pose_error(shares, row);
                sums = each(|k| sums[k] + error[k]);
                squares = each(|k| squares[k] + error[k] * error[k]);
            }
            if !model.has_zero_deviation() {
                total = each(|k| total[k] + squares[k]);
                continue;
            }
            let n = rows.len() as f64;
            let share = 1.0 / n;
            let mean = each(|k| sums[k] * share);
            // Clipped, and back to a pose: the mean itself unless a deviation is clipped.
            let delta_um = each(|k| dot(&to_delta[k], mean).clip(low_um, high_um));
            // Sum of (error - zero)^2, free of the cancellation that zero^2 would bring.
            let off = each(|k| mean[k] - dot(&linearized.gain[k], delta_um));
            let about_mean = each(|k| squares[k] - sums[k] * mean[k]);
            total = each(|k| total[k] + (about_mean[k] + (off[k] * off[k]) * n));
        }
        let [x, y, rz] = self.problem.weights;
        let sum = (total[0] * x + total[1] * y) + total[2] * rz;
        smallest.judge(sum.map(|sum| self.problem.fitness(sum)))
    }
}

impl CostFunction for DeltaCost<'_> {
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
