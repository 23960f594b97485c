//! Which fault would explain the residuals best, the parameters profiled out.

use super::columns::{Bank, Course, Family, families};
use super::estimate::{Estimate, RESIDUAL, WIDTH};
use super::{NOTHING, UNDECIDED};
use hallstage_input::channel::Channel;
use hallstage_input::finding::Quantity;
use hallstage_solver::estimator::gauss_newton::{Factor, Normal};
use hallstage_solver::estimator::whiten::UNKNOWNS;
use nalgebra::{DMatrix, DVector, Matrix3, SMatrix, SVector, Vector3};
use rayon::prelude::*;
use std::ops::Range;

/// A fault that explains something.
#[derive(Clone, Debug)]
pub(super) struct Fault {
    pub(super) family: Family,
    pub(super) course: Course,
    /// By how much it makes chi-square smaller.
    pub(super) gain: f64,
    /// Other channels or groups that explain it as well.
    pub(super) alike: Vec<Channel>,
}

type Columns = SMatrix<f64, WIDTH, 3>;

/// Everything that a scan needs of an estimate.
pub(super) struct Scan<'a> {
    bank: &'a Bank<'a>,
    estimate: &'a Estimate,
    /// The rows of the estimate, whitened backwards too.
    rows: Vec<Columns>,
    /// The steps of the filter: innovation per error of the reference, error per innovation, and what makes an
    /// innovation white.
    steps: Vec<[Matrix3<f64>; 3]>,
}

impl<'a> Scan<'a> {
    pub(super) fn new(bank: &'a Bank, estimate: &'a Estimate) -> Option<Self> {
        let mut steps = Vec::with_capacity(estimate.gains.len());
        for gain in &estimate.gains {
            let of = [gain.by_pose, gain.kalman, gain.factor];
            let [by_error, kalman, factor] = of.map(|rows| Matrix3::from(rows).transpose());
            steps.push([by_error, kalman, factor.try_inverse()?]);
        }
        let mut rows: Vec<Columns> = estimate.rows.iter().map(|row| (*row).into()).collect();
        for movement in &bank.log.means.movements {
            let mut error = Columns::zeros();
            for at in movement.clone().rev() {
                let [by_error, kalman, to_white] = &steps[at];
                rows[at] = rows[at] * to_white + error * kalman;
                error -= rows[at] * by_error;
            }
        }
        Some(Self {
            bank,
            estimate,
            rows,
            steps,
        })
    }

    /// The best courses of each row of the bank.
    pub(super) fn faults(&self) -> Vec<Fault> {
        let families: Vec<Family> = families().collect();
        let of_family = families
            .into_par_iter()
            .flat_map_iter(|family| self.of_family(family));
        of_family.collect()
    }

    fn of_family(&self, family: Family) -> impl Iterator<Item = Fault> {
        let all = 0..self.bank.log.means.rows.len();
        let raw = self.bank.raw(family);
        let whole = |course| {
            let column = self.bank.column(family, course);
            let found = self.scan(&column, &all, |at| at == 0);
            found.first().map(|(_, gain)| (course, *gain))
        };
        let mut found = Vec::new();
        if family.0 == Quantity::Time {
            found.push(whole(Course::On(0, all.end)));
        }
        // Channels of a kind have one clock.
        if family.0 != Quantity::Time || !family.is_single() {
            found.push(whole(Course::Ramp));
        }
        if family.stays() {
            found.push(self.onset(&raw, std::slice::from_ref(&all)));
        }
        if family.ends_with_movement() {
            found.push(whole(Course::RampInMovements));
            found.push(self.onset(&raw, &self.bank.log.means.movements));
        }
        let fault = move |(course, gain)| Fault {
            family,
            course,
            gain,
            alike: Vec::new(),
        };
        found.into_iter().flatten().map(fault)
    }

    /// The onset that explains most: a fault from there on to the end of its range.
    fn onset(&self, raw: &[[f64; 3]], ranges: &[Range<usize>]) -> Option<(Course, f64)> {
        // First far apart, then all about the best. The square root would be quickest, but a step near the end of a
        // movement shows for a moment only.
        let apart = (raw.len().isqrt() / 2).max(1);
        let coarse = ranges.iter().filter_map(|range| {
            let wanted = |at: usize| at > range.start && (at - range.start).is_multiple_of(apart);
            Some((largest(self.scan(raw, range, wanted))?, range))
        });
        let ((around, _), range) = coarse.max_by(|(a, _), (b, _)| a.1.total_cmp(&b.1))?;
        let wanted = |at: usize| at > range.start && at.abs_diff(around) < apart;
        let fine = self.scan(raw, range, wanted);
        // Things change between movements rather than within them.
        let is_start = |at: usize| self.bank.log.means.movements.iter().any(|m| m.start == at);
        let between = largest(fine.iter().copied().filter(|(at, _)| is_start(*at)));
        let best = largest(fine)?;
        let between = between.filter(|(_, gain)| *gain > best.1 - UNDECIDED);
        let (from, gain) = between.unwrap_or(best);
        Some((Course::On(from, range.end), gain))
    }

    /// The gains of a column from each wanted mean on to the end of a range, which is that of a movement.
    fn scan(
        &self,
        raw: &[[f64; 3]],
        range: &Range<usize>,
        wanted: impl Fn(usize) -> bool,
    ) -> Vec<(usize, f64)> {
        let movements = self.bank.log.means.movements.iter().rev();
        let mut found = Vec::new();
        let mut products = SVector::<f64, WIDTH>::zeros();
        let mut squares = 0.0;
        for movement in movements.filter(|m| range.contains(&m.start)) {
            // By an error of the reference so far, the squares of the rest of the movement are e' `own` e - 2 `by` e
            // more.
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

    /// What a column gains by its products with the rows and its squares.
    fn gain(&self, products: &SVector<f64, WIDTH>, squares: f64) -> Option<f64> {
        let size = UNKNOWNS + self.estimate.sizes().len();
        let by = DVector::from_column_slice(&products.as_slice()[..size]);
        let score = products[RESIDUAL] - by.dot(&self.estimate.step);
        let information = squares - by.dot(&self.estimate.curvature.solve(&by));
        (information > NOTHING * squares).then(|| score * score / information)
    }
}

fn largest(of: impl IntoIterator<Item = (usize, f64)>) -> Option<(usize, f64)> {
    of.into_iter().max_by(|a, b| a.1.total_cmp(&b.1))
}

/// Another stage, or another state of it, from a mean on.
#[derive(Debug)]
pub(super) struct Split {
    /// The first mean of the second part.
    pub(super) from: usize,
    /// By how much parameters of their own make chi-square smaller.
    pub(super) gain: f64,
    /// By how much the parameters of the second part differ from the common ones.
    pub(super) off: DVector<f64>,
}

/// The onset, out of some, from which on parameters of their own explain most. Each part has half of the prior,
/// so that both together are the common fit.
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
    let all = onsets.filter_map(at);
    all.max_by(|a, b| a.gain.total_cmp(&b.gain))
}
