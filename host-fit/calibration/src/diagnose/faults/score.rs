//! The fault that explains the residuals best, with the parameters profiled out.

use super::effects::{Effects, Shape, Suspect, suspects};
use super::estimate::{Estimate, RESIDUAL, WIDTH};
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

/// A fault is not tested where the parameters can follow all but this part of its information: the log hardly shows it.
const SEEN_MIN: f64 = 0.01;

type Columns = SMatrix<f64, WIDTH, 3>;

/// An estimate, prepared to be scanned for faults.
pub(super) struct Scan<'a> {
    effects: &'a Effects<'a>,
    estimate: &'a Estimate,
    steps: Vec<Step>,
}

/// A step of the filter that whitens, for signals of A, B, C.
struct Step {
    /// Of the rows of the estimate, whitened backwards too: their products with signals.
    row: Columns,
    to_white: Matrix3<f64>,
    kalman: Matrix3<f64>,
    /// White signals per error of the reference before the step.
    seen: Matrix3<f64>,
    /// The part of that error that stays after the step.
    stays: Matrix3<f64>,
    /// Squares of white signals after the step by an error of the reference there.
    after: Matrix3<f64>,
}

/// A direction of the signals at a mean, as the scan needs it.
struct Direction {
    /// Products with the rows.
    products: SVector<f64, WIDTH>,
    /// Its own squares.
    squares: f64,
    /// The error of the reference that it makes.
    error: Vector3<f64>,
    /// Products with an error of the reference before the step.
    by_error: Vector3<f64>,
}

impl<'a> Scan<'a> {
    pub(super) fn new(effects: &'a Effects, estimate: &'a Estimate) -> Option<Self> {
        let step = |(gain, row): (&Gain, &super::estimate::Row)| {
            let of = [gain.by_pose, gain.kalman, gain.factor];
            let [by_error, kalman, factor] = of.map(|rows| Matrix3::from(rows).transpose());
            let to_white = factor.try_inverse()?;
            let step = Step {
                row: (*row).into(),
                to_white,
                kalman,
                seen: to_white * by_error,
                stays: Matrix3::identity() - kalman * by_error,
                after: Matrix3::zeros(),
            };
            Some((by_error, step))
        };
        let steps = estimate.gains.iter().zip(&estimate.rows).map(step);
        let (by_error, mut steps): (Vec<_>, Vec<_>) =
            steps.collect::<Option<Vec<_>>>()?.into_iter().unzip();
        for movement in &effects.means.rows.movements {
            let (mut error, mut after) = (Columns::zeros(), Matrix3::zeros());
            for at in movement.clone().rev() {
                let step = &mut steps[at];
                step.row = step.row * step.to_white + error * step.kalman;
                error -= step.row * by_error[at];
                step.after = after;
                after = step.seen.tr_mul(&step.seen) + step.stays.tr_mul(&(after * step.stays));
            }
        }
        Some(Self {
            effects,
            estimate,
            steps,
        })
    }

    /// The best shapes of each suspect.
    pub(super) fn faults(&self, with_motion: bool) -> Vec<Fault> {
        let suspects: Vec<Suspect> = suspects(with_motion).collect();
        let share_direction =
            |a: &Suspect, b: &Suspect| a.is_single() && a.channels() == b.channels();
        let groups: Vec<&[Suspect]> = suspects.chunk_by(share_direction).collect();
        let faults = groups.into_par_iter().flat_map_iter(|group| {
            let count = self.steps.len();
            let directions: Vec<Direction> = (0..count)
                .map(|at| self.direction(at, self.effects.direction(group[0], at)))
                .collect();
            let found = group
                .iter()
                .flat_map(|suspect| self.faults_of(*suspect, &directions));
            found.collect::<Vec<_>>()
        });
        faults.collect()
    }

    fn direction(&self, at: usize, signals: Vector3<f64>) -> Direction {
        let step = &self.steps[at];
        let (white, error) = (step.to_white * signals, step.kalman * signals);
        let after = step.after * error;
        Direction {
            products: step.row * signals,
            squares: white.norm_squared() + error.dot(&after),
            error,
            by_error: step.seen.tr_mul(&white) - step.stays.tr_mul(&after),
        }
    }

    fn faults_of(&self, suspect: Suspect, directions: &[Direction]) -> Vec<Fault> {
        let all = 0..self.steps.len();
        let units = self.effects.units(suspect);
        let whole = |shape| {
            let shares = self.effects.shares(suspect, shape);
            let sizes: Vec<f64> = units.iter().zip(shares).map(|(a, b)| a * b).collect();
            let found = self.scan((directions, &sizes), &all, |at| at == 0);
            found.first().map(|(_, gain)| (shape, *gain))
        };
        let onset = |ranges: &[Range<usize>]| self.onset((directions, &units), ranges);
        let mut found = Vec::new();
        let is_time = suspect.quantity() == Some(Quantity::Time);
        if is_time || suspect.quantity().is_none() {
            found.push(whole(Shape::From(0, all.end)));
        }
        // Channels of a kind have one clock.
        if suspect.quantity().is_some() && !(is_time && suspect.is_single()) {
            found.push(whole(Shape::Ramp));
        }
        // A lost row makes all later rows late.
        if is_time {
            found.push(onset(std::slice::from_ref(&all)));
        }
        if suspect.can_stay() {
            found.push(whole(Shape::Arc));
            found.push(onset(std::slice::from_ref(&all)));
        }
        if suspect.ends_with_movement() {
            found.push(whole(Shape::RampInMovements));
            found.push(onset(&self.effects.means.rows.movements));
        }
        let fault = |(shape, gain)| Fault {
            suspect,
            shape,
            gain,
            alike: Vec::new(),
        };
        found.into_iter().flatten().map(fault).collect()
    }

    /// The onset that explains most: a fault from there on to the end of its range.
    fn onset(
        &self,
        column: (&[Direction], &[f64]),
        ranges: &[Range<usize>],
    ) -> Option<(Shape, f64)> {
        // First means far apart, then all means near the best. Half the square root of their number apart, because a
        // step near the end of a movement shows only for a moment.
        let apart = (self.steps.len().isqrt() / 2).max(1);
        // A moment at the end of a log does not show the state in which the stage ends.
        let end = |range: &Range<usize>| match self.steps.len() {
            last if range.end == last => last.saturating_sub(apart),
            _ => range.end,
        };
        let coarse = ranges.iter().filter_map(|range| {
            let wanted = |at: usize| {
                (range.start + 1..end(range)).contains(&at)
                    && (at - range.start).is_multiple_of(apart)
            };
            Some((largest(self.scan(column, range, wanted))?, range))
        });
        let ((around, _), range) = coarse.max_by(|(a, _), (b, _)| a.1.total_cmp(&b.1))?;
        let wanted =
            |at: usize| (range.start + 1..end(range)).contains(&at) && at.abs_diff(around) < apart;
        let (from, gain) = largest(self.scan(column, range, wanted))?;
        Some((Shape::From(from, range.end), gain))
    }

    /// The gains of a fault that begins at each wanted mean and ends with a range of whole movements.
    fn scan(
        &self,
        (directions, sizes): (&[Direction], &[f64]),
        range: &Range<usize>,
        wanted: impl Fn(usize) -> bool,
    ) -> Vec<(usize, f64)> {
        let movements = self.effects.means.rows.movements.iter().rev();
        let mut found = Vec::new();
        let mut products = SVector::<f64, WIDTH>::zeros();
        let mut squares = 0.0;
        for movement in movements.filter(|m| range.contains(&m.start)) {
            // Products of the rest of the movement with an error of the reference up to here.
            let mut by = Vector3::zeros();
            for at in movement.clone().rev() {
                let (direction, size) = (&directions[at], sizes[at]);
                products.axpy(size, &direction.products, 1.0);
                squares += size * (size * direction.squares - 2.0 * by.dot(&direction.error));
                by = direction.by_error * size + self.steps[at].stays.tr_mul(&by);
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
