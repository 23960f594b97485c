//! Model (31) for eight individuals at once, in um, um, urad.
//!
//! The same equations as `runtime::model`, which is the model; a test holds the two equal
//! within rounding. Two rearrangements: eta moves from phi into the matrix,
//! PM^-1 (s / phi - delta / eta) = G (s' - delta) with G = PM^-1 diag(1/eta) and
//! s' = s / (phi / eta), and three divisions are one division by their product.

use super::lanes::{Individuals, Lanes, each};
use crate::problem::model::Model;
use crate::problem::{Problem, TrainRow};
use runtime::geometry::{SensingAxes, inverse_and_determinant};
use runtime::model::dot;

/// PM and its inverse (equations 11, 32). Where PM is singular the inverse is not finite, and so
/// neither is the cost.
#[derive(Clone, Copy, Debug)]
pub struct Plane {
    /// Rows of PM.
    pub rows: [[Lanes; 3]; 3],
    /// Rows of PM^-1.
    pub inverse: [[Lanes; 3]; 3],
}

impl Plane {
    /// PM of sensing axes and lever arms in m.
    #[inline(always)]
    pub fn new(axes: &SensingAxes<Lanes>, lever_arm_m: [Lanes; 3]) -> Self {
        let rows = axes.plane_rows(lever_arm_m);
        let (inverse, _) = inverse_and_determinant(&rows);
        Self { rows, inverse }
    }
}

/// (a, b, c, ..) / eta of one probe.
pub type Ratios<const K: usize> = [Lanes; K];

/// What the rows need to know of the parameters: the gain and the ratios.
#[derive(Clone, Copy, Debug)]
pub struct Linearized<const K: usize> {
    /// G = PM^-1 diag(1/eta), rows X, Y, Rz.
    pub gain: [[Lanes; 3]; 3],
    /// The slopes over eta of A, B, C.
    pub ratios: [Ratios<K>; 3],
}

impl<const K: usize> Linearized<K> {
    /// The gain and the ratios of a plane with the eta and slopes of individuals, and that eta.
    /// In `u` they begin at `eta_at`: eta of A, B, C, then each slope of A, B, C. An eta that the
    /// model does not fit is 1, a slope 0.
    #[inline(always)]
    pub fn new(
        plane: &Plane,
        model: &Model,
        u: &Individuals<'_>,
        eta_at: usize,
    ) -> (Self, [Lanes; 3]) {
        let eta = if model.fits_gain() {
            u.three(eta_at)
        } else {
            [Lanes::splat(1.0); 3]
        };
        let per_eta = each(|k| Lanes::splat(1.0) / eta[k]);
        let mut ratios = [[Lanes::ZERO; K]; 3];
        for (probe, ratios) in ratios.iter_mut().enumerate() {
            for (slope, ratio) in ratios.iter_mut().enumerate().take(model.fitted_slopes()) {
                *ratio = u.number(eta_at + 3 + 3 * slope + probe) * per_eta[probe];
            }
        }
        let gain = each(|i| each(|k| plane.inverse[i][k] * per_eta[k]));
        (Self { gain, ratios }, eta)
    }

    /// Decoded pose minus reference, without the zero deviation (equation 31): um, um, urad.
    #[inline(always)]
    pub fn pose_error(&self, shares: [Lanes; 3], row: &TrainRow) -> [Lanes; 3] {
        let corrected = corrected_um(shares, row);
        each(|k| dot(&self.gain[k], corrected) - row.reference_um[k])
    }
}

/// phi / eta = 1 + r v of the three probes (equation 33), for the slopes' ratios r.
#[expect(
    clippy::needless_range_loop,
    reason = "a constant number of steps, written as sums are"
)]
#[inline(always)]
pub fn shares<const K: usize>(ratios: &[Ratios<K>; 3], row: &TrainRow) -> [Lanes; 3] {
    each(|probe| {
        let mut sum = ratios[probe][0] * row.slopes[0];
        for slope in 1..K {
            sum += ratios[probe][slope] * row.slopes[slope];
        }
        sum + 1.0
    })
}

/// The weighted fitness of sums of squared errors of X, Y, Rz.
#[inline(always)]
pub fn fitness(problem: &Problem<'_>, squares: [Lanes; 3]) -> Lanes {
    let [x, y, rz] = problem.weights;
    ((squares[0] * x + squares[1] * y) + squares[2] * rz).map(|sum| problem.fitness(sum))
}

/// s' = s / (phi / eta) of the three probes, um, with one division for all three.
#[inline(always)]
pub fn corrected_um(shares: [Lanes; 3], row: &TrainRow) -> [Lanes; 3] {
    let [a, b, c] = shares;
    let ab = a * b;
    let r = Lanes::splat(1.0) / (ab * c);
    let [s_a, s_b, s_c] = row.signal_um;
    [((b * c) * r) * s_a, ((a * c) * r) * s_b, (ab * r) * s_c]
}
