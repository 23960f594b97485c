//! The fault that explains the residuals best, with the parameters profiled out.

use super::effects::{Effects, Shape, Suspect, suspects};
use super::estimate::{Estimate, RESIDUAL, WIDTH};
use crate::diagnose::limits::UNDECIDED;
use hallstage_input::channel::Channel;
use hallstage_input::finding::Quantity;
use hallstage_solver::estimator::gauss_newton::{Factor, Normal};
use hallstage_solver::estimator::whiten::{Gain, UNKNOWNS};
use nalgebra::{DMatrix, DVector, Matrix3, SMatrix, SVector, Vector3};
use rayon::prelude::*;
use std::ops::Range;

/// A fault that explains something.
#[derive(Clone, Debug)]
pub(super) struct Fault {
    pub(super) suspect: Suspect,
    pub(super) shape: Shape,
    /// How much it lowers chi-square.
    pub(super) gain: f64,
    /// Other channels or groups that explain the log as well.
    pub(super) alike: Vec<Channel>,
}

/// A fault is not tested where the parameters can follow all but this part of its information.
const SEEN_MIN: f64 = 0.01;

type Columns = SMatrix<f64, WIDTH, 3>;

/// A step of the filter: innovation per error of the reference, error per innovation, and what makes an innovation white.
pub(super) type Step = [Matrix3<f64>; 3];

pub(super) fn steps(estimate: &Estimate) -> Option<Vec<Step>> {
    let step = |gain: &Gain| {
        let of = [gain.by_pose, gain.kalman, gain.factor];
        let [by_error, kalman, factor] = of.map(|rows| Matrix3::from(rows).transpose());
        Some([by_error, kalman, factor.try_inverse()?])
    };
    estimate.gains.iter().map(step).collect()
}

/// An estimate, prepared to be scanned for faults.
pub(super) struct Scan<'a> {
    effects: &'a Effects<'a>,
    estimate: &'a Estimate,
    /// The rows of the estimate, whitened backwards too.
    rows: Vec<Columns>,
    steps: Vec<Step>,
}

impl<'a> Scan<'a> {
    pub(super) fn new(effects: &'a Effects, estimate: &'a Estimate) -> Option<Self> {
        let steps = steps(estimate)?;
        let mut rows: Vec<Columns> = estimate.rows.iter().map(|row| (*row).into()).collect();
        for movement in &effects.means.rows.movements {
            let mut error = Columns::zeros();
            for at in movement.clone().rev() {
                let [by_error, kalman, to_white] = &steps[at];
                rows[at] = rows[at] * to_white + error * kalman;
                error -= rows[at] * by_error;
            }
        }
        Some(Self {
            effects,
            estimate,
            rows,
            steps,
        })
    }

    /// The best shapes of each suspect.
    pub(super) fn faults(&self) -> Vec<Fault> {
        let suspects: Vec<Suspect> = suspects().collect();
        let faults = suspects
            .into_par_iter()
            .flat_map_iter(|suspect| self.faults_of(suspect));
        faults.collect()
    }

    fn faults_of(&self, suspect: Suspect) -> impl Iterator<Item = Fault> {
        let all = 0..self.effects.means.rows.rows.len();
        let raw = self.effects.constant(suspect);
        let whole = |shape| {
            let column = self.effects.shaped(suspect, shape);
            let found = self.scan(&column, &all, |at| at == 0);
            found.first().map(|(_, gain)| (shape, *gain))
        };
        let mut found = Vec::new();
        if suspect.quantity == Quantity::Time {
            found.push(whole(Shape::From(0, all.end)));
        }
        // Channels of a kind have one clock.
        if suspect.quantity != Quantity::Time || !suspect.is_single() {
            found.push(whole(Shape::Ramp));
        }
        if suspect.can_stay() {
            found.push(self.onset(&raw, std::slice::from_ref(&all)));
        }
        if suspect.ends_with_movement() {
            found.push(whole(Shape::RampInMovements));
            found.push(self.onset(&raw, &self.effects.means.rows.movements));
        }
        let fault = move |(shape, gain)| Fault {
            suspect,
            shape,
            gain,
            alike: Vec::new(),
        };
        found.into_iter().flatten().map(fault)
    }

    /// The onset that explains most: a fault from there on to the end of its range.
    fn onset(&self, raw: &[[f64; 3]], ranges: &[Range<usize>]) -> Option<(Shape, f64)> {
        // First means far apart, then all means near the best. Half the square root of their number apart, because a
        // step near the end of a movement shows only for a moment.
        let apart = (raw.len().isqrt() / 2).max(1);
        let coarse = ranges.iter().filter_map(|range| {
            let wanted = |at: usize| at > range.start && (at - range.start).is_multiple_of(apart);
            Some((largest(self.scan(raw, range, wanted))?, range))
        });
        let ((around, _), range) = coarse.max_by(|(a, _), (b, _)| a.1.total_cmp(&b.1))?;
        let wanted = |at: usize| at > range.start && at.abs_diff(around) < apart;
        let fine = self.scan(raw, range, wanted);
        // Things change between movements rather than within them.
        let is_start = |at: usize| {
            self.effects
                .means
                .rows
                .movements
                .iter()
                .any(|m| m.start == at)
        };
        let between = largest(fine.iter().copied().filter(|(at, _)| is_start(*at)));
        let best = largest(fine)?;
        let between = between.filter(|(_, gain)| *gain > best.1 - UNDECIDED);
        let (from, gain) = between.unwrap_or(best);
        Some((Shape::From(from, range.end), gain))
    }

    /// The gains of a column that begins at each wanted mean and ends with a range of whole movements.
    fn scan(
        &self,
        raw: &[[f64; 3]],
        range: &Range<usize>,
        wanted: impl Fn(usize) -> bool,
    ) -> Vec<(usize, f64)> {
        let movements = self.effects.means.rows.movements.iter().rev();
        let mut found = Vec::new();
        let mut products = SVector::<f64, WIDTH>::zeros();
        let mut squares = 0.0;
        for movement in movements.filter(|m| range.contains(&m.start)) {
            // An error e of the reference up to here adds e' `own` e - 2 `by` e to the squares of the rest.
            let (mut own, mut by) = (Matrix3::zeros(), Vector3::zeros());
            for at in movement.clone().rev() {
                let ([by_error, kalman, to_white], x) = (&self.steps[at], Vector3::from(raw[at]));
                let (white, error) = (to_white * x, kalman * x);
                let (seen, stays) = (to_white * by_error, Matrix3::identity() - kalman * by_error);
                products += self.rows[at] * x;
                squares += white.norm_squared() + error.dot(&(own * error)) - 2.0 * by.dot(&error);
                by = seen.tr_mul(&white) + stays.tr_mul(&(by - own * error));
                own = seen.tr_mul(&seen) + stays.tr_mul(&(own * stays));
                if wanted(at)
                    && let Some(gain) = self.gain(&products, squares)
                {
                    found.push((at, gain));
                }
            }
        }
        found
    }

    /// The gain of a column from its products with the rows and its squares.
    fn gain(&self, products: &SVector<f64, WIDTH>, squares: f64) -> Option<f64> {
        let size = UNKNOWNS + self.estimate.sizes().len();
        let by = DVector::from_column_slice(&products.as_slice()[..size]);
        let score = products[RESIDUAL] - by.dot(&self.estimate.step);
        let information = squares - by.dot(&self.estimate.curvature.solve(&by));
        (information > SEEN_MIN * squares).then(|| score * score / information)
    }
}

fn largest(of: impl IntoIterator<Item = (usize, f64)>) -> Option<(usize, f64)> {
    of.into_iter().max_by(|a, b| a.1.total_cmp(&b.1))
}

/// Another stage, or another state of the stage, from a mean on.
#[derive(Debug)]
pub(super) struct Split {
    /// The first mean of the second part.
    pub(super) from: usize,
    /// How much parameters of its own lower chi-square.
    pub(super) gain: f64,
    /// The parameters of the second part less the common parameters.
    pub(super) off: DVector<f64>,
}

/// The best of some onsets to split the log into parts with parameters of their own. Each part has half of the
/// prior, so that equal parts are the common fit.
pub(super) fn split(estimate: &Estimate, onsets: impl Iterator<Item = usize>) -> Option<Split> {
    let half = 0.5 * &estimate.prior;
    let whole = &estimate.squares * &estimate.step;
    let alone = |curvature: DMatrix<f64>, descent: &DVector<f64>| {
        let off = Factor::new(&curvature, 0.0)?.solve(descent);
        Some((descent.dot(&off), off))
    };
    let at = |from: usize| {
        let mut sums = Normal::none();
        (estimate.rows[from..].iter()).for_each(|row| sums.add_row(row, 1.0));
        let curvature = DMatrix::from_fn(UNKNOWNS, UNKNOWNS, |i, j| sums.curvature(i, j)) + &half;
        let descent =
            DVector::from_fn(UNKNOWNS, |k, _| sums.descent(k)) - &half * estimate.values();
        let (first, _) = alone(&estimate.squares - &curvature, &(&whole - &descent))?;
        let (second, off) = alone(curvature, &descent)?;
        let gain = first + second - whole.dot(&estimate.step);
        Some(Split { from, gain, off })
    };
    let splits = onsets.filter_map(at);
    splits.max_by(|a, b| a.gain.total_cmp(&b.gain))
}
