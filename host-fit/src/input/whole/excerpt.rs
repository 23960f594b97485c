//! The rows of a long log that a fit works on: runs of rows that follow each other, because the
//! reference drifts from row to row, taken where they tell most.
//!
//! Every run that moves the stage has the same chance, so that the excerpt is like the log; one in
//! which nothing moves has none. A run that tells of what others do not, such as the only one that
//! tilts the stage, is told by its leverage, the trace of S_run S^-1: S_run holds the products of
//! the regressors of Model (31), s and s v with v = (Z, Rx, Ry), less their means over the run,
//! and S is the sum over all runs. Its chance grows with its leverage where that is far above the
//! mean. Runs are taken at equal steps of the sum of their chances (systematic sampling): they
//! are spread over the log, and nothing is random.

use super::Whole;
use crate::input::dataset::{Dataset, Movement, Row};
use nalgebra::{Cholesky, SMatrix, SVector};
use rayon::prelude::*;
use std::ops::Range;
use std::sync::Arc;

/// Rows of a run: a second, as long as the period of the paper's motions.
const RUN: usize = 500;
/// Rows of a run that are looked at for its leverage, about.
const LOOKED_AT: usize = 50;
/// Regressors.
const COUNT: usize = 12;
/// What is added to the diagonal of S, in parts of it: for directions that the log leaves open.
const RIDGE: f64 = 1e-9;
/// A run of less than this share of the largest motion stands still.
const IDLE_SHARE: f64 = 0.01;
/// Leverage, in terms of the mean of the runs that move, from which on a run is likelier to be taken.
const RARE: f64 = 4.0;
/// Runs whose products are summed one after the other.
const TOGETHER: usize = 64;

type Products = SMatrix<f64, COUNT, COUNT>;

/// Rows of one movement.
struct Run {
    movement: usize,
    rows: Range<usize>,
}

impl Whole {
    /// An excerpt of about `most` rows, each run a movement by itself; sequence numbers are 0.
    pub fn excerpt(self: &Arc<Self>, most: usize, sha256: [u8; 32]) -> Dataset {
        let mut dataset = Dataset {
            logs: self.logs.clone(),
            sha256,
            whole: Some(Arc::clone(self)),
            ..Dataset::default()
        };
        for run in self.chosen(most) {
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
        let parts: Vec<Products> = (runs.par_chunks(TOGETHER))
            .map(|runs| runs.iter().map(|run| self.products(run)).sum())
            .collect();
        let mut total: Products = parts.iter().sum();
        for k in 0..COUNT {
            // A regressor that is always 0 takes no part.
            total[(k, k)] = (total[(k, k)] * (1.0 + RIDGE)).max(f64::MIN_POSITIVE);
        }
        // Beyond rounding the sum of products is positive, and the ridge is above that.
        let inverse = Cholesky::new(total).map_or_else(Products::zeros, |factor| factor.inverse());
        let told = |run: &Run| {
            let products = self.products(run).component_mul(&inverse);
            (products.sum(), self.moved(run))
        };
        let told: Vec<(f64, f64)> = runs.par_iter().map(told).collect();
        let idle = IDLE_SHARE
            * told
                .iter()
                .fold(0.0, |most: f64, (_, moved)| most.max(*moved));
        let moving = told.iter().filter(|(_, moved)| *moved >= idle).count();
        let rare = RARE * COUNT as f64 / moving.max(1) as f64;
        let chance = |&(leverage, moved): &(f64, f64)| match moved >= idle {
            true => f64::max(leverage / rare, 1.0),
            false => 0.0,
        };
        let chances: Vec<f64> = told.iter().map(chance).collect();
        let rows = runs
            .iter()
            .zip(&chances)
            .map(|(run, c)| c * run.rows.len() as f64);
        let step = rows.sum::<f64>() / most.max(1) as f64;
        let (mut sum, mut next) = (0.0, 0.5 * step);
        let taken = runs.into_iter().zip(chances).filter(|(_, chance)| {
            sum += chance;
            let taken = sum > next;
            while sum > next {
                next += step;
            }
            taken
        });
        taken.map(|(run, _)| run).collect()
    }

    /// How far a run moves: the largest range of X, Y, Rz by the reference, m, rad.
    fn moved(&self, run: &Run) -> f64 {
        let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for row in self.looked_at(run) {
            low = std::array::from_fn(|k| low[k].min(row.reference[k]));
            high = std::array::from_fn(|k| high[k].max(row.reference[k]));
        }
        (0..3).map(|k| high[k] - low[k]).fold(0.0, f64::max)
    }

    fn looked_at(&self, run: &Run) -> impl Iterator<Item = Row> {
        let stride = run.rows.len().div_ceil(LOOKED_AT).max(1);
        run.rows.clone().step_by(stride).map(|row| self.row(row))
    }

    /// All movements in runs of about equal length.
    fn runs(&self) -> Vec<Run> {
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
