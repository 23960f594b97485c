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

use super::lanes::{Individuals, LaneCost, Lanes, dot, each, for_each_eight};
use super::model::{corrected_um, inverse, shares};
use super::poles::{Smallest, cut, vertical_extent};
use crate::input::stage::Range;
use crate::problem::parameters::Parameters;
use crate::problem::{Problem, TrainRow};
use crate::solve::least_squares::coordinates::parameters_of;
use crate::solve::least_squares::normal::Point;
use crate::solve::search::cost::CostFunction;
use crate::solve::search::random::{Phase, RandomSource, RandomStreams, SeededStreams};
use nalgebra::Matrix3;

/// Number of unknowns.
pub const RATIOS: usize = 9;

/// The six products of three numbers with each other: 00, 01, 02, 11, 12, 22.
const PAIRS: [(usize, usize); 6] = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];

/// Root mean square of all pose errors at the best gain and offsets.
#[derive(Clone, Debug)]
pub struct LinearCost<'a> {
    problem: &'a Problem<'a>,
    bounds: [Range; RATIOS],
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
    /// The cost of a problem's rows, for Model (31); `None` for the other models, which have
    /// no ratios to search for, and for ranges of eta that contain zero.
    pub fn new(problem: &'a Problem<'a>) -> Option<Self> {
        let search = &problem.stage.search;
        let extent = vertical_extent(&problem.rows);
        let [eta, a, b, c] = ["eta", "a_per_m", "b_per_rad", "c_per_rad"]
            .map(|key| search.of(key).unwrap_or_default());
        let bounds = std::array::from_fn(|index| {
            let (probe, axis) = (index / 3, index % 3);
            let ratios = quotient([a, b, c][axis][probe], eta[probe]);
            cut(ratios, 1.0, extent[axis])
        });
        let eta_is_apart = eta.iter().all(|eta| eta.low > 0.0 || eta.high < 0.0);
        if !(problem.model.has_vertical_terms() && eta_is_apart) {
            return None;
        }
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
            bounds,
            rows,
            reference_squares,
        })
    }

    #[inline(always)]
    fn sums(&self, u: &Individuals<'_>) -> Sums {
        let ratios = each(|k| u.three(3 * k));
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
        let ratios: [f64; RATIOS] = individual.try_into().ok()?;
        let sums = self.sums(&Individuals::new(individual, RATIOS));
        let gain = sums.gain();
        parameters_of(&Point {
            gain: Matrix3::from_fn(|i, j| gain[i][j].0[0]),
            ratios: [0, 1, 2].map(|k| [ratios[3 * k], ratios[3 * k + 1], ratios[3 * k + 2]]),
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
        let ratios = parameters
            .sensitivity
            .map(|s| [s.per_z_m, s.per_rx_rad, s.per_ry_rad].map(|slope| slope / s.eta));
        ratios.concat()
    }
}

impl Sums {
    /// The best gain, row by row: um, um, urad per um.
    #[inline(always)]
    fn gain(&self) -> [[Lanes; 3]; 3] {
        let [aa, ab, ac, bb, bc, cc] = self.signal;
        let inverse = inverse(&[[aa, ab, ac], [ab, bb, bc], [ac, bc, cc]]);
        each(|axis| each(|k| dot(&inverse[k], self.reference[axis])))
    }
}

impl LaneCost for LinearCost<'_> {
    fn dimensions(&self) -> usize {
        RATIOS
    }

    #[inline(always)]
    fn cost_of_eight(&self, u: &Individuals<'_>) -> Lanes {
        let sums = self.sums(u);
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

impl CostFunction for LinearCost<'_> {
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
