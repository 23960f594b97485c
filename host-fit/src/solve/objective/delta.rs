//! `--project delta`: the zero deviations in closed form, 18 unknowns left.
//!
//! Given the other parameters, the pose is linear in a movement's zero deviation, and the best
//! one takes off the movement's mean pose error: delta = eta (PM mean error), clipped to its
//! range as the full form would hold it there.
//!
//! An individual holds the parameters that the model fits, in their usual order and in SI units,
//! with one exception: a lever arm is written as its place in its range, 0 to 1, since the range,
//! the image of the box of two coordinates, moves with theta. So a box in these unknowns is the
//! box of the paper, without the three unknowns that act on nothing and without what lies beyond
//! the poles ([`super::poles`]).

use super::lanes::{Individuals, LaneCost, Lanes, each};
use super::model::{Linearized, Plane, fitness, shares};
use super::poles::{Smallest, cut, slope_extent};
use crate::input::stage::Range;
use crate::problem::Problem;
use crate::problem::parameters::{ETA, Parameters, SLOPES, THETA, search_box};
use runtime::geometry::SensingAxes;
use runtime::model::dot;

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
        let mut bounds = search_box(problem.stage, problem.model, [0.0; 3]);
        bounds[..THETA].fill(Range {
            low: 0.0,
            high: 1.0,
        });
        // With the largest eta the pole is farthest away.
        let eta = [0, 1, 2].map(|k| bounds[ETA + k].high.abs().max(bounds[ETA + k].low.abs()));
        let extent = slope_extent(&problem.rows);
        for (k, bound) in bounds[SLOPES..].iter_mut().enumerate() {
            *bound = cut(*bound, eta[k % 3], extent[k / 3]);
        }
        let coordinates = problem.stage.search.h_m.pairs();
        Self {
            problem,
            bounds: bounds[..problem.model.free_count()].to_vec(),
            arms_m: coordinates.map(|probe| probe.map(middle_and_half)),
        }
    }

    /// Lever arms in m from their places in their ranges.
    #[inline(always)]
    fn lever_arms_m(&self, places: [Lanes; 3], axes: &SensingAxes<Lanes>) -> [Lanes; 3] {
        let factors = axes.arm_factors();
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
        let mut parameters = Parameters::designed(self.problem.stage);
        let values = &mut parameters.values;
        for (value, u) in values.iter_mut().zip(individual) {
            *value = *u;
        }
        let axes = SensingAxes::at([0, 1, 2].map(|k| Lanes::splat(values[THETA + k])));
        let places = [0, 1, 2].map(|k| Lanes::splat(values[k]));
        for (value, arm) in values.iter_mut().zip(self.lever_arms_m(places, &axes)) {
            *value = arm.0[0];
        }
        parameters
    }

    /// An individual with these parameters, for a warm start; outside the bounds where the
    /// parameters are outside their box.
    pub fn individual(&self, parameters: &Parameters) -> Vec<f64> {
        let values = &parameters.values;
        let axes = SensingAxes::at([0, 1, 2].map(|k| Lanes::splat(values[THETA + k])));
        let [low, high] = [0.0, 1.0].map(|t| self.lever_arms_m([Lanes::splat(t); 3], &axes));
        let mut individual = values[..self.bounds.len()].to_vec();
        for (k, place) in individual.iter_mut().enumerate().take(3) {
            let (low, high) = (low[k].0[0], high[k].0[0]);
            *place = (values[k] - low) / (high - low);
        }
        individual
    }
}

impl LaneCost for DeltaCost<'_> {
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
        let plane = Plane::new(&axes, self.lever_arms_m(u.three(0), &axes));
        let (linearized, eta) = Linearized::<K>::new(&plane, model, u, ETA);
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
            if !model.has_zero_deviation {
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
        smallest.judge(fitness(self.problem, total))
    }
}
