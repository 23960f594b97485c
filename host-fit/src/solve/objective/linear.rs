//! `--project linear`: gain and offsets in closed form, nine unknowns left.
//!
//! With s'_i = s_i / (1 + r_i v), r_i = (a, b, c)_i / eta_i, the pose of Model (31) is
//! q = G s' - o: linear in the gain G = PM^-1 diag(1/eta), an arbitrary 3x3 matrix (its nine
//! entries are the three lever arms, angles and eta), and in one offset o for each movement.
//! Given the nine ratios, the best G and o follow from sums over the rows: with s' and q each
//! less its mean over the movement, A = sum s' s'^T and b_k = sum s' q_k, row k of G is
//! A^-1 b_k and leaves sum q_k^2 - b_k A^-1 b_k.
//!
//! An individual holds a/eta, b/eta, c/eta of A, then of B, then of C (1/m, 1/rad, 1/rad). Its
//! bounds follow from the ranges of a, b, c and eta and from the poles ([`super::poles`]); the
//! boxes of lever arms, angles and zero deviations are not enforced here.

use super::lanes::{Individuals, LaneCost, Lanes, each};
use super::model::{corrected_um, shares};
use super::poles::{Smallest, cut, slope_extent};
use crate::input::stage::Range;
use crate::problem::model::SLOPES_MAX;
use crate::problem::parameters::{ETA, Parameters, SLOPES, search_box};
use crate::problem::{Problem, TrainRow};
use crate::solve::least_squares::coordinates::parameters_of;
use crate::solve::least_squares::normal::Point;
use crate::solve::search::random::{Phase, RandomSource, RandomStreams, SeededStreams};
use nalgebra::Matrix3;
use runtime::geometry::inverse_and_determinant;
use runtime::model::dot;

/// The six products of three numbers with each other: 00, 01, 02, 11, 12, 22.
const PAIRS: [(usize, usize); 6] = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];

/// Root mean square of all pose errors at the best gain and offsets.
#[derive(Clone, Debug)]
pub struct LinearCost<'a> {
    problem: &'a Problem<'a>,
    bounds: Vec<Range>,
    /// The rows with the reference less its mean over the movement.
    rows: Vec<TrainRow>,
    /// Sum of the squared centred reference, X, Y, Rz.
    reference_squares: [f64; 3],
}

/// The range of a quotient of two ranges.
fn quotient(numerator: Range, denominator: Range) -> Range {
    let ends = [numerator.low, numerator.high]
        .map(|n| [n / denominator.low, n / denominator.high])
        .concat();
    Range {
        low: ends.iter().copied().fold(f64::INFINITY, f64::min),
        high: ends.iter().copied().fold(f64::NEG_INFINITY, f64::max),
    }
}

/// A and b of some individuals.
struct Sums {
    /// A, by [`PAIRS`].
    signal: [Lanes; 6],
    /// Row k: b_k.
    reference: [[Lanes; 3]; 3],
    smallest: Smallest,
}

impl<'a> LinearCost<'a> {
    /// The cost of a problem's rows; `None` for models without slopes, which have no ratios to
    /// search for, and for ranges of eta that contain zero.
    pub fn new(problem: &'a Problem<'a>) -> Option<Self> {
        let slopes = problem.model.fitted_slopes();
        let ranges = search_box(problem.stage, problem.model, [0.0; 3]);
        let etas = &ranges[ETA..SLOPES];
        let eta_is_apart = etas.iter().all(|eta| eta.low > 0.0 || eta.high < 0.0);
        if slopes == 0 || !eta_is_apart {
            return None;
        }
        let extent = slope_extent(&problem.rows);
        let bound = |index: usize| {
            let (probe, slope) = (index / slopes, index % slopes);
            let ratios = quotient(ranges[SLOPES + 3 * slope + probe], etas[probe]);
            cut(ratios, 1.0, extent[slope])
        };
        let mut rows = problem.rows.clone();
        let mut reference_squares = [0.0; 3];
        for group in &problem.groups {
            let rows = &mut rows[group.rows.clone()];
            let n = rows.len() as f64;
            for (k, squares) in reference_squares.iter_mut().enumerate() {
                let mean = rows.iter().fold(0.0, |sum, row| sum + row.reference_um[k]) / n;
                for row in &mut *rows {
                    row.reference_um[k] -= mean;
                    *squares += row.reference_um[k] * row.reference_um[k];
                }
            }
        }
        Some(Self {
            problem,
            bounds: (0..3 * slopes).map(bound).collect(),
            rows,
            reference_squares,
        })
    }

    #[inline(always)]
    fn sums<const K: usize>(&self, u: &Individuals<'_>) -> Sums {
        let slopes = self.problem.model.fitted_slopes();
        let mut ratios = [[Lanes::ZERO; K]; 3];
        for (probe, ratios) in ratios.iter_mut().enumerate() {
            for (slope, ratio) in ratios.iter_mut().enumerate().take(slopes) {
                *ratio = u.number(slopes * probe + slope);
            }
        }
        let mut smallest = Smallest::NONE;
        let mut signal = [Lanes::ZERO; 6];
        let mut reference = [[Lanes::ZERO; 3]; 3];
        for group in &self.problem.groups {
            let rows = &self.rows[group.rows.clone()];
            let mut mean = [Lanes::ZERO; 3];
            for row in rows {
                let shares = shares(&ratios, row);
                smallest.note(shares[0].smaller(shares[1]).smaller(shares[2]));
                let s = corrected_um(shares, row);
                mean = each(|k| mean[k] + s[k]);
                reference =
                    each(|axis| each(|k| reference[axis][k] + s[k] * row.reference_um[axis]));
                for (sum, (i, j)) in signal.iter_mut().zip(PAIRS) {
                    *sum += s[i] * s[j];
                }
            }
            // The reference is centred already, so its products need no correction.
            let n = rows.len() as f64;
            for (sum, (i, j)) in signal.iter_mut().zip(PAIRS) {
                *sum = *sum - mean[i] * mean[j] / n;
            }
        }
        Sums {
            signal,
            reference,
            smallest,
        }
    }

    /// The parameters at the best gain of an individual, wherever their own ranges are; `None`
    /// where the gain is singular.
    pub fn parameters(&self, individual: &[f64]) -> Option<Parameters> {
        let slopes = self.problem.model.fitted_slopes();
        let sums = self.sums::<SLOPES_MAX>(&Individuals::new(individual, self.bounds.len()));
        let gain = sums.gain();
        let mut ratios = [[0.0; SLOPES_MAX]; 3];
        for (ratios, found) in ratios.iter_mut().zip(individual.chunks_exact(slopes)) {
            ratios[..slopes].copy_from_slice(found);
        }
        parameters_of(&Point {
            gain: Matrix3::from_fn(|i, j| gain[i][j].0[0]),
            ratios,
        })
    }

    /// The first `count` individuals of a search: uniform draws from the box, each shrunk towards
    /// zero slopes by the cube of a uniform number. Stages lie near zero: a probe that changes its
    /// sensitivity by a tenth over the log fills a tenth of each range, and all nine of a
    /// billionth of the box.
    pub fn first_population(&self, count: usize, seed: u64) -> Vec<Vec<f64>> {
        let streams = SeededStreams::new(seed);
        let draw = |k: usize| {
            let mut random = streams.stream(0, Phase::Start, k);
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
        (0..count).map(draw).collect()
    }

    /// An individual with the ratios of these parameters, for a warm start.
    pub fn individual(&self, parameters: &Parameters) -> Vec<f64> {
        let slopes = self.problem.model.fitted_slopes();
        let of_probe = |(slope, eta): ([f64; SLOPES_MAX], f64)| slope.map(|slope| slope / eta);
        let ratios = parameters.slopes().into_iter().zip(parameters.eta());
        ratios
            .flat_map(|probe| of_probe(probe).into_iter().take(slopes))
            .collect()
    }
}

impl Sums {
    /// The best gain, row by row: um, um, urad per um.
    #[inline(always)]
    fn gain(&self) -> [[Lanes; 3]; 3] {
        let [aa, ab, ac, bb, bc, cc] = self.signal;
        let (inverse, _) = inverse_and_determinant(&[[aa, ab, ac], [ab, bb, bc], [ac, bc, cc]]);
        each(|axis| each(|k| dot(&inverse[k], self.reference[axis])))
    }
}

impl LaneCost for LinearCost<'_> {
    fn problem(&self) -> &Problem<'_> {
        self.problem
    }

    fn box_of_eight(&self) -> &[Range] {
        &self.bounds
    }

    #[inline(always)]
    fn cost_of_eight<const K: usize>(&self, u: &Individuals<'_>) -> Lanes {
        let sums = self.sums::<K>(u);
        let gain = sums.gain();
        let weights = self.problem.weights;
        let mut total = Lanes::ZERO;
        for k in 0..3 {
            let left = -dot(&sums.reference[k], gain[k]) + self.reference_squares[k];
            // Rounding could make an exact fit negative.
            let left = left.map(|x| if x < 0.0 { 0.0 } else { x });
            total += left * weights[k];
        }
        let fitness = total.map(|sum| self.problem.fitness(sum));
        sums.smallest.judge(fitness)
    }
}
