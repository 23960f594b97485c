//! Which fault would explain the residuals best, the parameters profiled out.

use super::columns::{Course, FAMILIES, Family, Kind, shaped};
use super::estimate::{Estimate, RESIDUAL, Row, WIDTH, solve_all};
use super::means::Log;
use super::{NOTHING, UNDECIDED};
use crate::solve::field::terms::PER_PROBE;
use crate::solve::field::whiten::{Gain, UNKNOWNS};
use crate::solve::gauss_newton::{Factor, Normal};
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};
use rayon::prelude::*;
use std::ops::Range;

/// Onsets that are tried over the log, before the best is refined.
pub(super) const ONSETS: usize = 128;
/// Pieces of a log at whose ends another stage may begin.
const PIECES: usize = 8;

/// A fault that explains something.
#[derive(Clone, Copy, Debug)]
pub(super) struct Candidate {
    pub(super) family: usize,
    pub(super) course: Course,
    /// By how much it makes chi-square smaller.
    pub(super) gain: f64,
    /// Out of how many it was chosen, all families and onsets together.
    pub(super) choices: f64,
}

/// One step back through the filter, of a column that begins there: its square is x' `own` x - 2 `kalman` x b
/// more with b what it already does to the reference's error, which becomes `by_x` x + `by_b` b.
struct Back {
    own: Matrix3<f64>,
    kalman: Matrix3<f64>,
    by_x: Matrix3<f64>,
    by_b: Matrix3<f64>,
}

/// Everything that a scan needs of an estimate.
pub(super) struct Scan<'a> {
    log: &'a Log,
    estimate: &'a Estimate,
    /// The rows of the estimate, whitened backwards too.
    rows: Vec<Row>,
    steps: Vec<Back>,
}

/// Where a sum from the end of the log on has come to.
struct Sums {
    /// Products of the column with all others.
    products: [f64; WIDTH],
    /// Its square.
    squares: f64,
    b: Vector3<f64>,
}

fn matrix(of: &[[f64; 3]; 3]) -> Matrix3<f64> {
    Matrix3::from_fn(|i, j| of[i][j])
}

impl<'a> Scan<'a> {
    pub(super) fn new(log: &'a Log, estimate: &'a Estimate) -> Option<Self> {
        let mut rows = estimate.rows.clone();
        let mut steps = Vec::with_capacity(rows.len());
        for movement in log.movements().iter().rev() {
            let mut after = [[0.0; WIDTH]; 3];
            let mut information = Matrix3::zeros();
            for at in movement.clone().rev() {
                let Gain {
                    by_pose,
                    kalman,
                    factor,
                    ..
                } = &estimate.gains[at];
                let to_white = matrix(factor).try_inverse()?;
                for j in 0..WIDTH {
                    let column = |of: &Row| Vector3::new(of[0][j], of[1][j], of[2][j]);
                    let (white, error) = (column(&rows[at]), column(&after));
                    let back = to_white.tr_mul(&white) + matrix(kalman).tr_mul(&error);
                    let error = error - matrix(by_pose).tr_mul(&back);
                    (0..3).for_each(|k| (rows[at][k][j], after[k][j]) = (back[k], error[k]));
                }
                let (h, kalman) = (matrix(by_pose), matrix(kalman));
                let precision = to_white.tr_mul(&to_white);
                let follows = Matrix3::identity() - kalman * h;
                let seen = h.tr_mul(&precision);
                steps.push(Back {
                    own: precision + kalman.tr_mul(&(information * kalman)),
                    kalman,
                    by_x: seen - follows.tr_mul(&(information * kalman)),
                    by_b: follows.transpose(),
                });
                information = seen * h + follows.tr_mul(&(information * follows));
            }
        }
        steps.reverse();
        Some(Self {
            log,
            estimate,
            rows,
            steps,
        })
    }

    /// The best of each row of the bank.
    pub(super) fn candidates(&self, raw: &[Vec<[f64; 3]>]) -> Vec<Candidate> {
        let families = (0..FAMILIES.len()).into_par_iter();
        families
            .flat_map_iter(|family| self.of_family(family, &raw[family]))
            .collect()
    }

    fn of_family(&self, number: usize, raw: &[[f64; 3]]) -> Vec<Candidate> {
        let family: &Family = &FAMILIES[number];
        let (all, movements) = (0..self.log.means().len(), self.log.movements());
        let mut found = Vec::new();
        let mut add = |course, gain: Option<f64>, onsets: usize| {
            found.extend(gain.map(|gain| Candidate {
                family: number,
                course,
                gain,
                choices: (FAMILIES.len() * onsets) as f64,
            }));
        };
        let mut whole = |course| add(course, self.of_column(raw, family, course), 1);
        match family.0 {
            Kind::Lag => whole(Course::Whole),
            _ => whole(Course::Ramp),
        }
        if family.ends_with_movement() {
            whole(Course::RampInMovements);
        }
        let mut onset = |ranges: &[Range<usize>], course: fn(usize) -> Course| {
            if let Some((from, gain)) = self.onset(raw, ranges) {
                add(course(from), Some(gain), all.end);
            }
        };
        if family.steps() {
            onset(std::slice::from_ref(&all), Course::From);
        }
        if family.ends_with_movement() {
            onset(movements, Course::ToReset);
        }
        found
    }

    /// The onset that explains most: a fault from there on to the end of its range.
    fn onset(&self, raw: &[[f64; 3]], ranges: &[Range<usize>]) -> Option<(usize, f64)> {
        let apart = (self.log.means().len() / ONSETS).max(1);
        let mut coarse: Option<(usize, f64, &Range<usize>)> = None;
        for range in ranges {
            let wanted = |at: usize| at > range.start && (at - range.start).is_multiple_of(apart);
            self.scan(raw, range, wanted, |at, gain| {
                if coarse.is_none_or(|(_, most, _)| gain > most) {
                    coarse = Some((at, gain, range));
                }
            });
        }
        let (around, _, range) = coarse?;
        // Things change between movements rather than within them.
        let mut best: Option<(usize, f64)> = None;
        let mut between: Option<(usize, f64)> = None;
        let is_start = |at: usize| self.log.movements().iter().any(|m| m.start == at);
        let wanted = |at: usize| at > range.start && at.abs_diff(around) < apart;
        self.scan(raw, range, wanted, |at, gain| {
            let better = |of: Option<(usize, f64)>| of.is_none_or(|(_, most)| gain > most);
            if better(best) {
                best = Some((at, gain));
            }
            if better(between) && is_start(at) {
                between = Some((at, gain));
            }
        });
        let least = best?.1 - UNDECIDED;
        between.filter(|(_, gain)| *gain > least).or(best)
    }

    /// The gains of a column from the wanted means on to the end of a range, which is that of a movement.
    fn scan(
        &self,
        raw: &[[f64; 3]],
        range: &Range<usize>,
        wanted: impl Fn(usize) -> bool,
        mut take: impl FnMut(usize, f64),
    ) {
        let mut sums = Sums {
            products: [0.0; WIDTH],
            squares: 0.0,
            b: Vector3::zeros(),
        };
        let mut ends = self.log.movements().iter().rev().map(|m| m.end).peekable();
        for at in range.clone().rev() {
            while ends.next_if(|end| *end > at).is_some() {
                sums.b = Vector3::zeros();
            }
            self.add(&mut sums, at, raw[at]);
            if wanted(at)
                && let Some(gain) = self.gain(&sums)
            {
                take(at, gain);
            }
        }
    }

    /// A column that begins a mean earlier.
    fn add(&self, sums: &mut Sums, at: usize, raw: [f64; 3]) {
        for (x, row) in raw.into_iter().zip(&self.rows[at]) {
            let products = sums.products.iter_mut().zip(row);
            products.for_each(|(sum, y)| *sum += x * y);
        }
        let (x, step) = (Vector3::from(raw), &self.steps[at]);
        sums.squares += x.dot(&(step.own * x)) - 2.0 * sums.b.dot(&(step.kalman * x));
        sums.b = step.by_x * x + step.by_b * sums.b;
    }

    fn of_column(&self, raw: &[[f64; 3]], family: &Family, course: Course) -> Option<f64> {
        let column = shaped(self.log, raw, family, course);
        let mut found = None;
        let all = 0..column.len();
        self.scan(&column, &all, |at| at == 0, |_, gain| found = Some(gain));
        found
    }

    /// What a column gains.
    fn gain(&self, sums: &Sums) -> Option<f64> {
        let size = UNKNOWNS + self.estimate.sizes().len();
        let by = DVector::from_column_slice(&sums.products[..size]);
        let score = sums.products[RESIDUAL] - by.dot(&self.estimate.step);
        let information = sums.squares - by.dot(&self.estimate.curvature.solve(&by));
        (information > NOTHING * sums.squares).then(|| score * score / information)
    }
}

/// Another stage, or another state of it, from a mean on.
#[derive(Debug)]
pub(super) struct Split {
    /// The first mean of the second part.
    pub(super) from: usize,
    /// By how much parameters of their own make chi-square smaller.
    pub(super) gain: f64,
    /// What it adds to the gradient of a common fit.
    pub(super) pull: DVector<f64>,
}

/// The onset from which on parameters of their own explain most, an eighth of the log or more on either
/// side. Each part has half of the prior, so that both together are the common fit.
pub(super) fn split(log: &Log, estimate: &Estimate) -> Option<Split> {
    let count = log.means().len();
    let movements = log.movements().iter();
    let mut ends: Vec<usize> = movements.clone().map(|movement| movement.end).collect();
    if ends.len() < PIECES {
        let pieces = movements.flat_map(|m| (1..=PIECES).map(|k| m.start + k * m.len() / PIECES));
        ends = pieces.collect();
    }
    let common = estimate.without_faults(PER_PROBE)?;
    let half = 0.5 * &estimate.prior;
    let mut sums = Normal::none();
    let mut best: Option<Split> = None;
    let mut to = ends.pop()?;
    while let Some(from) = ends.pop() {
        let rows = estimate.rows[from..to].iter();
        rows.for_each(|row| sums.add_row(row, 1.0));
        to = from;
        if from.min(count - from) < count / PIECES {
            continue;
        }
        let of_rows = DMatrix::from_fn(UNKNOWNS, UNKNOWNS, |i, j| sums.curvature(i, j));
        let of_second = of_rows + &half;
        let score = DVector::from_fn(UNKNOWNS, |k, _| sums.descent(k))
            - &half * estimate.values()
            - &of_second * &estimate.step;
        let followed = solve_all(&common, &of_second);
        let mut information = &of_second - &of_second * followed;
        for k in 0..UNKNOWNS {
            // Against rounding, in directions that neither part determines.
            information[(k, k)] += 1e-6 * of_second[(k, k)];
        }
        let Some(factor) = Factor::new(&information, 0.0) else {
            continue;
        };
        let change = factor.solve(&score);
        let gain = score.dot(&change);
        if best.as_ref().is_none_or(|best| gain > best.gain) {
            let pull = of_second * change;
            best = Some(Split { from, gain, pull });
        }
    }
    best
}
