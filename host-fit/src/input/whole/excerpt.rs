//! The rows of a long log that a fit works on: runs of rows that follow each other, because the
//! reference drifts from row to row, taken where they tell most.
//!
//! Every run that moves the stage in any axis has the same chance, so that the excerpt is like the
//! log; one in which nothing moves has none. A run that tells of what others do not, such as the only one that
//! tilts the stage, is told by its leverage, the trace of S_run S^-1: S_run holds the products of
//! the regressors of Model (31), s and s v with v = (Z, Rx, Ry), less their means over the run,
//! and S is the sum over all runs. Its chance grows with its leverage where that is far above the
//! mean. One run is taken in each of equal steps of the sum of their chances, at a place within the
//! step that differs from step to step: the runs are spread over the log, a protocol that repeats
//! is met in all its phases, and nothing is random. To these are added the runs that go farthest in
//! an axis, so that the model is fitted over the whole range, and as many of a short log beside
//! long ones as show whether it is of the same stage.

use super::Whole;
use crate::input::dataset::{Dataset, Movement, Row};
use crate::input::log::sequence;
use nalgebra::{Cholesky, SMatrix, SVector};
use rayon::prelude::*;
use std::collections::BTreeSet;
use std::ops::Range;
use std::sync::Arc;

/// Rows of a run: a second, as long as the period of the paper's motions.
pub(super) const RUN: usize = 500;
/// Rows of a run that are looked at for its leverage, about.
const LOOKED_AT: usize = 50;
/// Regressors.
const COUNT: usize = 12;
/// What is added to the diagonal of S, in parts of it: for directions that the log leaves open.
const RIDGE: f64 = 1e-9;
/// A run in which X, Y and Z move less, m, and Rz, Rx and Ry, rad, stands still.
const IDLE_M: f64 = 2e-6;
const IDLE_RAD: f64 = 20e-6;
/// How far the place within a step moves from step to step, in steps: by the golden ratio the
/// places of any number of steps are spread evenly.
pub(super) const GOLDEN: f64 = 0.618_033_988_749_894_8;
/// Rows of a log beside others that tell whether it is of the same stage, ...
const OF_LOG: usize = 16_000;
/// ... at least so many runs of it, though they be more than its share of the excerpt.
const FEW: usize = 8;
/// Runs that are taken of those that go farthest in an axis, where they go farther than all others
/// by this part: one may be a fault.
const FARTHEST: usize = 3;
const FARTHER: f64 = 0.02;
/// Leverage, in terms of the mean of the runs that move, from which on a run is likelier to be taken.
const RARE: f64 = 4.0;
/// Runs whose products are summed one after the other.
const TOGETHER: usize = 64;

type Products = SMatrix<f64, COUNT, COUNT>;

/// Rows of one movement.
pub struct Run {
    /// Its number.
    pub movement: usize,
    /// The rows.
    pub rows: Range<usize>,
}

impl Whole {
    /// An excerpt of about `most` rows, each run a movement by itself; sequence numbers are 0.
    pub fn excerpt(self: &Arc<Self>, most: usize, sha256: [u8; 32]) -> Dataset {
        self.dataset(self.chosen(most), sha256)
    }

    /// An excerpt with more rows of the whole, given by the numbers of [`runs`](Self::runs); those
    /// that follow each other in a movement are one movement.
    pub fn with_more(
        self: &Arc<Self>,
        excerpt: &Dataset,
        more: &BTreeSet<usize>,
        servo_period_s: f64,
    ) -> Dataset {
        let mut of_excerpt = excerpt.movements.iter().peekable();
        let mut joined: Vec<Run> = Vec::new();
        let mut before_is_more = false;
        for (number, run) in self.runs().into_iter().enumerate() {
            let is_same = |taken: &&Movement| {
                let movement = &self.movements[run.movement];
                (taken.log, taken.index) == (movement.log, movement.index)
                    && taken.rows.len() == run.rows.len()
                    && excerpt.rows[taken.rows.start].t_us == self.row(run.rows.start).t_us
            };
            let is_taken = of_excerpt.next_if(is_same).is_some();
            let is_more = more.contains(&number);
            match joined.last_mut() {
                Some(last) if is_more && before_is_more && last.movement == run.movement => {
                    last.rows.end = run.rows.end;
                }
                _ if is_taken || is_more => joined.push(run),
                _ => {}
            }
            before_is_more = is_more;
        }
        let mut dataset = self.dataset(joined, excerpt.sha256);
        sequence::number_logs(&mut dataset, servo_period_s);
        dataset
    }

    /// Each run a movement by itself; sequence numbers are 0.
    fn dataset(self: &Arc<Self>, runs: Vec<Run>, sha256: [u8; 32]) -> Dataset {
        let mut dataset = Dataset {
            logs: self.logs.clone(),
            sha256,
            whole: Some(Arc::clone(self)),
            ..Dataset::default()
        };
        for run in runs {
            let (start, number) = (dataset.rows.len(), dataset.movements.len());
            dataset.rows.extend(self.rows_of(number, run.rows));
            dataset.movements.push(Movement {
                rows: start..dataset.rows.len(),
                ..self.movements[run.movement].clone()
            });
        }
        for (log, source) in dataset.logs.iter_mut().enumerate() {
            let rows_before = |end: usize| {
                let movements = dataset.movements.iter().filter(|m| m.log < end);
                movements.map(|m| m.rows.len()).sum()
            };
            source.rows = rows_before(log)..rows_before(log + 1);
        }
        dataset
    }

    /// The runs of an excerpt, in the order of their rows.
    fn chosen(&self, most: usize) -> Vec<Run> {
        let runs = self.runs();
        let products: Vec<Products> = runs.par_iter().map(|run| self.products(run)).collect();
        let parts: Vec<Products> = (products.par_chunks(TOGETHER))
            .map(|products| products.iter().sum())
            .collect();
        let mut total: Products = parts.iter().sum();
        for k in 0..COUNT {
            // A regressor that is always 0 takes no part.
            total[(k, k)] = (total[(k, k)] * (1.0 + RIDGE)).max(f64::MIN_POSITIVE);
        }
        // Beyond rounding the sum of products is positive, and the ridge is above that.
        let inverse = Cholesky::new(total).map_or_else(Products::zeros, |factor| factor.inverse());
        let told = |(run, products): (&Run, &Products)| {
            let leverage = products.component_mul(&inverse).sum();
            (leverage, moves(self.looked_at(run)))
        };
        let mut told: Vec<(f64, bool)> = runs.par_iter().zip(&products).map(told).collect();
        drop(products);
        if told.iter().all(|(_, moves)| !moves) {
            told.iter_mut().for_each(|(_, moves)| *moves = true);
        }
        let moving = told.iter().filter(|(_, moves)| *moves).count();
        let rare = RARE * COUNT as f64 / moving.max(1) as f64;
        let chance = |&(leverage, moves): &(f64, bool)| match moves {
            true => f64::max(leverage / rare, 1.0),
            false => 0.0,
        };
        let chances: Vec<f64> = told.iter().map(chance).collect();
        let rows = runs
            .iter()
            .zip(&chances)
            .map(|(run, c)| c * run.rows.len() as f64);
        let step = rows.sum::<f64>() / most.max(1) as f64;
        let place = |k: usize| step * (k as f64 + (k as f64 * GOLDEN + 0.5).fract());
        let (mut sum, mut next) = (0.0, 0);
        let take = |chance: &f64| {
            sum += chance;
            let before = next;
            while sum > place(next) {
                next += 1;
            }
            next > before
        };
        let mut taken: Vec<bool> = chances.iter().map(take).collect();
        self.take_farthest(&runs, &told, &mut taken);
        self.take_of_each_log(&runs, &told, most, &mut taken);
        let chosen = runs.into_iter().zip(taken).filter(|(_, taken)| *taken);
        chosen.map(|(run, _)| run).collect()
    }

    /// Takes the runs that go farthest in each axis; `told` is whether a run moves.
    fn take_farthest(&self, runs: &[Run], told: &[(f64, bool)], taken: &mut [bool]) {
        let reach: Vec<[f64; 6]> = runs.par_iter().map(|run| self.reach(run)).collect();
        let mut moving: Vec<usize> = (0..runs.len()).filter(|k| told[*k].1).collect();
        let sampled: Vec<usize> = (0..runs.len()).filter(|k| taken[*k]).collect();
        for axis in 0..6 {
            let reach = |run: usize| reach[run][axis];
            let farthest = sampled.iter().map(|&run| reach(run));
            let least = farthest.fold(0.0, f64::max) * (1.0 + FARTHER);
            moving.sort_by(|&a, &b| reach(b).total_cmp(&reach(a)));
            for &run in moving.iter().take(FARTHEST) {
                taken[run] |= reach(run) > least;
            }
        }
    }

    /// How far a run goes from zero in each axis, m, rad: its second farthest row of those looked
    /// at, because a single one may be a fault.
    fn reach(&self, run: &Run) -> [f64; 6] {
        let mut most = [[0.0f64; 2]; 6];
        for row in self.looked_at(run) {
            let ([x, y, rz], [z, rx, ry]) = (row.reference, row.vertical);
            for (most, value) in most.iter_mut().zip([x, y, rz, z, rx, ry]) {
                let [first, second] = *most;
                let value = value.abs();
                *most = [first.max(value), second.max(first.min(value))];
            }
        }
        most.map(|[_, second]| second)
    }

    /// Takes runs of each log, spread evenly, until its share is taken; `told` is whether a run moves.
    fn take_of_each_log(
        &self,
        runs: &[Run],
        told: &[(f64, bool)],
        most: usize,
        taken: &mut [bool],
    ) {
        let share = (most / (2 * self.logs.len().max(1))).min(OF_LOG);
        for log in 0..self.logs.len() {
            let of_log = |run: &Run| self.movements[run.movement].log == log;
            let has: Vec<usize> = (0..runs.len())
                .filter(|&k| taken[k] && of_log(&runs[k]))
                .collect();
            let left: Vec<usize> = (0..runs.len())
                .filter(|&k| told[k].1 && !taken[k] && of_log(&runs[k]))
                .collect();
            let rows = |of: &[usize]| of.iter().map(|&k| runs[k].rows.len()).sum::<usize>();
            let missing = share.saturating_sub(rows(&has)) * left.len();
            let wanted = missing.div_ceil(rows(&left).max(1));
            let wanted = wanted.max(FEW.saturating_sub(has.len())).min(left.len());
            for k in 0..wanted {
                taken[left[k * left.len() / wanted]] = true;
            }
        }
    }

    /// Some rows of a run, spread evenly.
    pub fn looked_at(&self, run: &Run) -> impl Iterator<Item = Row> {
        looked_at(run.rows.clone()).map(|row| self.row(row))
    }

    /// All movements in runs of about equal length.
    pub fn runs(&self) -> Vec<Run> {
        let mut runs = Vec::new();
        for (movement, Movement { rows, .. }) in self.movements.iter().enumerate() {
            let count = rows.len().div_ceil(RUN);
            let start = |k: usize| rows.start + rows.len() * k / count;
            runs.extend((0..count).map(|k| Run {
                movement,
                rows: start(k)..start(k + 1),
            }));
        }
        runs
    }

    /// The products of the regressors of a run, in um and um times m or rad.
    fn products(&self, run: &Run) -> Products {
        let regressors: Vec<SVector<f64, COUNT>> =
            self.looked_at(run).map(|row| regressors(&row)).collect();
        let mean = regressors.iter().sum::<SVector<f64, COUNT>>() / regressors.len().max(1) as f64;
        let mut sum = Products::zeros();
        for z in &regressors {
            let z = z - mean;
            sum.ger(1.0, &z, &z, 1.0);
        }
        // As if all rows had been looked at.
        sum * (run.rows.len() as f64 / regressors.len().max(1) as f64)
    }
}

/// Some of the rows of a run.
pub(super) fn looked_at<R: ExactSizeIterator>(rows: R) -> impl Iterator<Item = R::Item> {
    let stride = rows.len().div_ceil(LOOKED_AT).max(1);
    rows.step_by(stride)
}

/// Whether the stage moves in any of the six axes from one of these rows to another.
pub(super) fn moves(rows: impl Iterator<Item = Row>) -> bool {
    const IDLE: [f64; 6] = [IDLE_M, IDLE_M, IDLE_RAD, IDLE_M, IDLE_RAD, IDLE_RAD];
    let (mut low, mut high) = ([f64::INFINITY; 6], [f64::NEG_INFINITY; 6]);
    for row in rows {
        let ([x, y, rz], [z, rx, ry]) = (row.reference, row.vertical);
        for (k, value) in [x, y, rz, z, rx, ry].into_iter().enumerate() {
            low[k] = low[k].min(value);
            high[k] = high[k].max(value);
        }
    }
    (0..6).any(|k| high[k] - low[k] >= IDLE[k])
}

fn regressors(row: &Row) -> SVector<f64, COUNT> {
    SVector::from_fn(|k, _| {
        let signal_um = row.signal_m[k % 3] * 1e6;
        match k / 3 {
            0 => signal_um,
            // Of the order of one.
            v => signal_um * (row.vertical[v - 1] * 1e4),
        }
    })
}
