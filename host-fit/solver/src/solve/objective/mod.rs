//! The fitness of a fit as a cost function of a search.
//!
//! The fitness is the root of the mean over rows and axes of the squared pose error,
//! in um, um and urad: [`Problem::fitness`]. How much of the problem is solved in closed form
//! says what an individual holds:
//!
//! | [`Projection`] | an individual, in SI units | unknowns of Model (31) |
//! |---|---|---|
//! | `None` (the paper) | H1x, H1y, H2x, H2y, H3x, H3y; theta, eta, a, b, c of A, B, C; delta of A, B, C of each movement | 21 and three for each movement |
//! | `Delta` | lever arms, theta, eta, a, b, c of A, B, C | 18 |
//! | `Linear` | a/eta, b/eta, c/eta of A, then of B, then of C | 9 |
//!
//! - `None` has the bounds of Tables 3 and 5. The two coordinates of a probe act through its lever
//!   arm alone, so three of the unknowns are redundant; they are kept because the paper has them.
//! - `Delta`: a lever arm is written as its place in its range, 0 to 1, since the range, the image
//!   of the box of two coordinates, moves with theta. So a box in these unknowns is the paper's.
//! - `Linear`: the bounds follow from the ranges of a, b, c and eta. The ranges of lever arms,
//!   angles and zero deviations are not enforced here.
//!
//! `Delta` and `Linear` keep away from the poles of 1/phi ([`poles`]). `rows` holds the sums over
//! the rows.

pub mod poles;
mod rows;

#[cfg(test)]
pub(crate) mod sample_for_tests;
#[cfg(test)]
mod tests;

use crate::estimator::least_squares::zero_deviations;
use crate::estimator::linear::{LinearPoint, linear_point, parameters_at};
use crate::estimator::paper::{ETA, Parameters, SLOPES, THETA, lever_arm_ranges, search_box};
use crate::estimator::problem::Problem;
use crate::solve::Projection;
use crate::solve::search::cost::CostFunction;
use crate::solve::search::random::{Phase, stream};
use hallstage_input::stage::{Range, paper_signs};
use nalgebra::Vector3;
use poles::{cut, slope_extent};
use runtime::geometry::ProbeGeometry;

/// The fitness of a problem in one of its forms.
#[derive(Clone, Debug)]
pub struct Objective<'a> {
    problem: &'a Problem<'a>,
    /// Which form.
    pub projection: Projection,
    bounds: Vec<Range>,
    designed: Parameters,
}

impl<'a> Objective<'a> {
    /// The form of a problem that a projection asks for; `None` where it has no unknowns left
    /// to search for: `Linear` of a model without slopes, or with a range of eta that contains
    /// zero.
    pub fn new(problem: &'a Problem<'a>, projection: Projection) -> Option<Self> {
        let stage = problem.stage;
        let mut ranges = search_box(stage, problem.model, [0.0; 3]);
        let extent = slope_extent(&problem.rows.rows);
        let free = problem.model.free_count();
        let bounds = match projection {
            Projection::None => {
                let delta = 3
                    * problem.rows.movements_of_log
                    * usize::from(problem.model.has_zero_deviation);
                let mut bounds = paper_signs(stage.search.places_m).concat();
                bounds.extend(&ranges[THETA..free]);
                bounds.extend(std::iter::repeat_n(stage.search.delta_m, delta));
                bounds
            }
            Projection::Delta => {
                ranges[..THETA].fill(Range::new(0.0, 1.0));
                for k in SLOPES..free {
                    // With the largest eta the pole is farthest away.
                    let eta = ranges[ETA + k % 3];
                    let eta = eta.high.abs().max(eta.low.abs());
                    ranges[k] = cut(ranges[k], eta, extent[(k - SLOPES) / 3]);
                }
                ranges[..free].to_vec()
            }
            Projection::Linear => {
                let etas = &ranges[ETA..SLOPES];
                if !problem.model.fits_slopes() || etas.iter().any(|eta| eta.contains(0.0)) {
                    return None;
                }
                let bound = |index: usize| {
                    let (probe, slope) = (index / 3, index % 3);
                    let ratios = quotient(ranges[SLOPES + 3 * slope + probe], etas[probe]);
                    cut(ratios, 1.0, extent[slope])
                };
                (0..9).map(bound).collect()
            }
        };
        Some(Self {
            problem,
            projection,
            bounds,
            designed: Parameters::designed(stage),
        })
    }

    /// The parameters of an individual; `None` where the best gain of `Linear` is singular.
    pub fn parameters(&self, individual: &[f64]) -> Option<Parameters> {
        let mut parameters = self.designed;
        let values = &mut parameters.values;
        let fitted = self.problem.model.free_count() - THETA;
        let arms_m = match self.projection {
            Projection::None => {
                values[THETA..][..fitted].copy_from_slice(&individual[6..][..fitted]);
                let pairs = [0, 2, 4].map(|k| [individual[k], individual[k + 1]]);
                let theta = parameters.geometry().misalignment_rad;
                ProbeGeometry::from_places(paper_signs(pairs), theta).lever_arm_m
            }
            Projection::Delta => {
                values[THETA..][..fitted].copy_from_slice(&individual[THETA..][..fitted]);
                let ranges = self.arm_ranges(&parameters);
                [0, 1, 2].map(|k| ranges[k].low + individual[k] * ranges[k].width())
            }
            Projection::Linear => {
                let ratios = self.ratios(individual);
                let (gain, _) = rows::best_gain(self.problem, &ratios)?;
                return parameters_at(&LinearPoint { gain, ratios }, self.problem.stage);
            }
        };
        parameters.values[..THETA].copy_from_slice(&arms_m);
        Some(parameters)
    }

    /// The zero deviations that an individual holds, m for each movement of the log, zero for
    /// movements without rows; `None` in the forms that solve for them.
    pub fn own_delta_m(&self, individual: &[f64]) -> Option<Vec<[f64; 3]>> {
        if self.projection != Projection::None {
            return None;
        }
        let rows = &self.problem.rows;
        let mut delta_m = vec![[0.0; 3]; rows.movements_of_log];
        for &movement in &rows.numbers {
            delta_m[movement] = self.delta_m_of(individual, movement);
        }
        Some(delta_m)
    }

    /// The zero deviation of one movement that an individual of `None` holds, m.
    fn delta_m_of(&self, individual: &[f64], movement: usize) -> [f64; 3] {
        if !self.problem.model.has_zero_deviation {
            return [0.0; 3];
        }
        // Each coordinate pair makes one lever arm.
        let start = self.problem.model.free_count() + 3 + 3 * movement;
        [0, 1, 2].map(|k| individual[start + k])
    }

    /// The ratios that an individual of `Linear` holds.
    fn ratios(&self, individual: &[f64]) -> [[f64; 3]; 3] {
        std::array::from_fn(|probe| std::array::from_fn(|k| individual[3 * probe + k]))
    }

    fn arm_ranges(&self, parameters: &Parameters) -> [Range; 3] {
        lever_arm_ranges(self.problem.stage, parameters.geometry().misalignment_rad)
    }

    /// The first `count` individuals of a search, where the form has a better idea than uniform
    /// draws from the box. Only `Linear` has one: each draw is shrunk towards zero slopes by the cube
    /// of a uniform number. Stages lie near zero: a probe that changes its sensitivity by a tenth
    /// over the log fills a tenth of each range, and all nine of a billionth of the box.
    pub fn first_population(&self, count: usize, seed: u64) -> Vec<Vec<f64>> {
        let draw = |k: usize| {
            let mut random = stream(seed, 0, Phase::Start, k);
            let u = random.uniform();
            let shrink = u * u * u;
            let number = |range: &Range| {
                // Zero, or the end that is nearest to it.
                let centre = range.clip(0.0);
                let drawn = range.low + random.uniform() * range.width();
                centre + shrink * (drawn - centre)
            };
            self.bounds.iter().map(number).collect()
        };
        match self.projection {
            Projection::None | Projection::Delta => Vec::new(),
            Projection::Linear => (0..count).map(draw).collect(),
        }
    }

    /// Sums of the squared errors of X, Y, Rz, um^2; `None` where there is no pose, or where a row is too
    /// near to a pole.
    fn squares(&self, individual: &[f64]) -> Option<Vector3<f64>> {
        let problem = self.problem;
        if self.projection == Projection::Linear {
            return Some(rows::best_gain(problem, &self.ratios(individual))?.1);
        }
        let parameters = self.parameters(individual)?;
        let point = linear_point(&parameters)?;
        if self.projection == Projection::None {
            let delta_m = |movement| self.delta_m_of(individual, movement);
            return Some(rows::squares_at_delta(problem, &point, delta_m));
        }
        rows::squares_at_best_delta(problem, &point, &parameters)
    }
}

impl CostFunction for Objective<'_> {
    fn bounds(&self) -> &[Range] {
        &self.bounds
    }

    fn cost(&self, individual: &[f64]) -> f64 {
        let squares = self.squares(individual);
        squares.map_or(f64::NAN, |squares| self.problem.fitness(squares.sum()))
    }
}

/// The range of a quotient of two ranges.
fn quotient(numerator: Range, denominator: Range) -> Range {
    let ends = [numerator.low, numerator.high]
        .map(|n| [n / denominator.low, n / denominator.high])
        .concat();
    Range::around(ends)
}

/// The best zero deviation of each movement of the log, m; zero for movements
/// without rows and where the parameters have no pose.
pub fn best_delta_m(problem: &Problem<'_>, parameters: &Parameters) -> Vec<[f64; 3]> {
    let zeros = zero_deviations(problem, parameters);
    zeros.iter().map(|zero| zero.delta_m).collect()
}
