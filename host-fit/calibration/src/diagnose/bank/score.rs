//! Which fault would explain the residuals best, the parameters profiled out.

use super::UNDECIDED;
use super::blocks::Log;
use super::columns::{Course, FAMILIES, Family, to_reset};
use super::map::{Estimate, RESIDUAL, Row, UNKNOWNS, WIDTH, solve_all};
use crate::solve::field::terms::PER_PROBE;
use crate::solve::gauss_newton::{Factor, Normal};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use std::ops::Range;

/// Onsets that are tried over the log, before the best is refined.
const ONSETS: usize = 64;
/// Onsets that are tried in a movement.
const ONSETS_IN_MOVEMENT: usize = 12;
/// A fault that the parameters can follow but for this part of its information is theirs.
const OWN_MIN: f64 = 0.01;
/// Pieces of a movement at whose ends another stage may begin.
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

/// Everything that a scan needs of an estimate.
pub(super) struct Scan<'a> {
    log: &'a Log,
    estimate: &'a Estimate,
    /// The rows of the estimate, whitened backwards.
    back: Vec<Row>,
}

impl<'a> Scan<'a> {
    pub(super) fn new(log: &'a Log, estimate: &'a Estimate) -> Self {
        let mut back = estimate.rows.clone();
        estimate.filter.whiten_back(&mut back);
        Self {
            log,
            estimate,
            back,
        }
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
        let count = self.log.means.len();
        let mut found = Vec::new();
        let mut add = |course, gain: Option<f64>, onsets: usize| {
            let choices = (FAMILIES.len() * onsets) as f64;
            found.extend(gain.map(|gain| Candidate {
                family: number,
                course,
                gain,
                choices,
            }));
        };
        add(Course::Ramp, self.of_column(raw, family, Course::Ramp), 1);
        let apart = (count / ONSETS).max(1);
        if family.steps
            && let Some((from, gain)) = self.onset(raw, std::slice::from_ref(&(0..count)), apart)
        {
            add(Course::From(from), Some(gain), count);
        }
        if family.to_reset {
            let course = Course::RampInMovements;
            add(course, self.of_column(raw, family, course), 1);
            let longest = self.log.movements.iter().map(Range::len).max();
            let apart = (longest.unwrap_or(1) / ONSETS_IN_MOVEMENT).max(1);
            if let Some((from, gain)) = self.onset(raw, &self.log.movements, apart) {
                add(Course::ToReset(from), Some(gain), count);
            }
        }
        found
    }

    /// The onset that explains most: a fault from there on to the end of its range.
    fn onset(
        &self,
        raw: &[[f64; 3]],
        ranges: &[Range<usize>],
        apart: usize,
    ) -> Option<(usize, f64)> {
        let mut best: Option<(usize, f64)> = None;
        let mut within: Option<&Range<usize>> = None;
        for range in ranges {
            let coarse = |at: usize| at > range.start && (at - range.start).is_multiple_of(apart);
            self.scan(raw, range, coarse, &mut |at, gain| {
                if best.is_none_or(|(_, most)| gain > most) {
                    best = Some((at, gain));
                    within = Some(range);
                }
            });
        }
        let (around, range) = (best?.0, within?);
        let fine = |at: usize| at > range.start && at.abs_diff(around) < apart;
        self.scan(raw, range, fine, &mut |at, gain| {
            if best.is_none_or(|(_, most)| gain > most) {
                best = Some((at, gain));
            }
        });
        // Things change between movements rather than within them.
        let most = best.map_or(0.0, |(_, most)| most) - UNDECIDED;
        let starts: Vec<usize> = self
            .log
            .movements
            .iter()
            .map(|movement| movement.start)
            .collect();
        let between = |at: usize| fine(at) && starts.binary_search(&at).is_ok();
        self.scan(raw, range, between, &mut |at, gain| {
            if gain > most {
                best = Some((at, gain));
            }
        });
        best
    }

    fn scan(
        &self,
        raw: &[[f64; 3]],
        range: &Range<usize>,
        wanted: impl Fn(usize) -> bool,
        take: &mut impl FnMut(usize, f64),
    ) {
        let mut sums = [0.0; WIDTH];
        for at in range.clone().rev() {
            self.add(&mut sums, at, raw[at]);
            if wanted(at) {
                let squares = self.estimate.filter.squares(raw, &(at..range.end));
                if let Some(gain) = self.gain(&sums, squares) {
                    take(at, gain);
                }
            }
        }
    }

    fn add(&self, sums: &mut [f64; WIDTH], at: usize, raw: [f64; 3]) {
        for (x, row) in raw.into_iter().zip(&self.back[at]) {
            sums.iter_mut().zip(row).for_each(|(sum, y)| *sum += x * y);
        }
    }

    fn of_column(&self, raw: &[[f64; 3]], family: &Family, course: Course) -> Option<f64> {
        let column = super::columns::shaped(self.log, raw, family, course);
        let mut sums = [0.0; WIDTH];
        for (at, x) in column.iter().enumerate() {
            self.add(&mut sums, at, *x);
        }
        let squares = self.estimate.filter.squares(&column, &(0..column.len()));
        self.gain(&sums, squares)
    }

    /// What a column gains, by its products with all others and its squares.
    fn gain(&self, sums: &[f64; WIDTH], squares: f64) -> Option<f64> {
        let by = DVector::from_column_slice(&sums[..UNKNOWNS + self.estimate.sizes().len()]);
        let score = sums[RESIDUAL] - by.dot(&self.estimate.step);
        let information = squares - by.dot(&self.estimate.curvature.solve(&by));
        (information > OWN_MIN * squares).then(|| score * score / information)
    }
}

/// The fault's column to its end.
pub(super) fn range_of(log: &Log, course: Course) -> Range<usize> {
    match course {
        Course::From(from) => from..log.means.len(),
        Course::ToReset(from) => to_reset(log, from),
        Course::Ramp | Course::RampInMovements => 0..log.means.len(),
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

/// Precision of the parameters of Model (31) over all stages.
fn usual(unknown: usize) -> f64 {
    /// Lever arm, theta, eta, a, b, c.
    const SPREADS: [f64; 6] = [0.1, 0.1, 0.3, 100.0, 50.0, 50.0];
    let spread = SPREADS.get(unknown % PER_PROBE).copied().unwrap_or(1.0);
    1.0 / (spread * spread)
}

/// The onset from which on parameters of their own explain most, an eighth of the log or more on either
/// side. Each part has half of the prior, so that both together are the common fit.
pub(super) fn split(log: &Log, estimate: &Estimate) -> Option<Split> {
    let count = log.means.len();
    let mut ends: Vec<usize> = log.movements.iter().map(|movement| movement.end).collect();
    if ends.len() < PIECES {
        let pieces = log
            .movements
            .iter()
            .flat_map(|m| (1..=PIECES).map(|k| m.start + k * m.len() / PIECES));
        ends = pieces.collect();
    }
    let common = estimate.without_faults(PER_PROBE)?;
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
        let mut of_second = DMatrix::from_fn(UNKNOWNS, UNKNOWNS, |i, j| sums.curvature(i, j));
        let mut score = DVector::from_fn(UNKNOWNS, |k, _| sums.descent(k));
        for (k, (precision, pull)) in estimate.of_prior().enumerate() {
            of_second[(k, k)] += 0.5 * precision;
            score[k] -= 0.5 * pull;
        }
        score -= &of_second * &estimate.step;
        let followed = solve_all(&common, &of_second);
        let mut information = &of_second - &of_second * followed;
        for k in 0..UNKNOWNS {
            // Against rounding, in directions that neither part determines.
            information[(k, k)] += usual(k) + 1e-6 * of_second[(k, k)];
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
