//! A log in means over a few rows each, rows far from the others left out.

use super::MEANS_MAX;
use super::score::ONSETS;
use crate::diagnose::signals::robust_deviation;
use crate::input::dataset::Dataset;
use crate::input::stage::Stage;
use crate::solve::field::blocks::{FieldRow, Rows};
use crate::solve::field::probe::Probe;
use crate::statistics::median;
use std::ops::Range;

/// A row this many times its white noise off the middle of its block, as beside a step, is left out: noise
/// alone does that once in 10^9 rows.
const SPIKE: f64 = 6.0;

/// Pieces of a movement, of so many rows at least, each with its own noise.
const PIECES: usize = 8;
const PIECE_MIN: usize = 500;

/// A log.
#[derive(Debug)]
pub(super) struct Log {
    /// The means, each a block; the number of its rows is the weight.
    pub(super) rows: Rows,
    /// The first row of each in the dataset.
    pub(super) first: Vec<usize>,
    /// White noise of A, B, C from row to row, mm.
    pub(super) white_mm: [f64; 3],
    /// Errors of the resets, mm, mm, mrad, where they are declared.
    pub(super) resets_mm: Option<[f64; 3]>,
}

impl Log {
    /// The rows of a dataset; `probes` are those of a first fit.
    pub(super) fn new(dataset: &Dataset, stage: &Stage, probes: &[Probe; 3]) -> Self {
        let all: Vec<usize> = (0..dataset.rows.len()).collect();
        let mut rows = Rows::new(dataset, &all);
        let residuals = rows.residuals_mm(probes, 0.0, &vec![[0.0; 3]; rows.movements.len()]);
        let least_mm = stage.hall.m_per_count * 1e3 / 12f64.sqrt();
        // From second differences within movements, by their median.
        let white = |windows: &mut dyn Iterator<Item = &[[f64; 3]]>| {
            let windows: Vec<_> = windows.collect();
            [0, 1, 2].map(|k| {
                let differences = windows.iter().map(|w| (w[0][k] - 2.0 * w[1][k]) + w[2][k]);
                (robust_deviation(differences) / 6f64.sqrt()).max(least_mm)
            })
        };
        let all = rows
            .movement_rows()
            .flat_map(|rows| residuals[rows].windows(3));
        let white_mm = white(&mut all.into_iter());
        for block in rows.blocks.clone() {
            for (k, white_mm) in white_mm.into_iter().enumerate() {
                let mut values: Vec<f64> = residuals[block.clone()].iter().map(|r| r[k]).collect();
                let middle = median(&mut values).unwrap_or(0.0);
                for row in block.clone() {
                    if (residuals[row][k] - middle).abs() > SPIKE * white_mm {
                        rows.rows[row].weight = 0.0;
                    }
                }
            }
        }
        // Where a probe is noisier than usual, rows count less.
        for movement in rows.movement_rows().collect::<Vec<_>>() {
            let length = movement.len().div_ceil(PIECES).max(PIECE_MIN);
            for start in movement.clone().step_by(length) {
                let piece = start..(start + length).min(movement.end);
                let own_mm = white(&mut residuals[piece.clone()].windows(3));
                let part = [0, 1, 2].map(|k| white_mm[k] / own_mm[k].max(white_mm[k]));
                let weight = part.into_iter().fold(1.0, f64::min).powi(2);
                rows.rows[piece]
                    .iter_mut()
                    .for_each(|row| row.weight *= weight);
            }
        }
        let (rows, first) = rows.means(MEANS_MAX);
        Self {
            rows,
            first,
            white_mm,
            resets_mm: stage.resets_mm(),
        }
    }

    pub(super) fn means(&self) -> &[FieldRow] {
        &self.rows.rows
    }

    pub(super) fn movements(&self) -> &[Range<usize>] {
        &self.rows.movements
    }

    /// How many numbers the means hold beyond the offsets of the movements.
    pub(super) fn count(&self) -> f64 {
        let offsets = self.resets_mm.map_or(self.movements().len(), |_| 0);
        3.0 * (self.means().len() - offsets) as f64
    }

    /// What a number more, of an unknown, has to gain in chi-square (Schwarz 1978).
    pub(super) fn per_unknown(&self) -> f64 {
        libm::log(3.0 * self.means().len() as f64)
    }

    /// Poses (X, Y, Rz and Z, Rx, Ry: m, rad) spread over the log: what a model is good for that has no more
    /// terms.
    pub(super) fn poses(&self) -> impl ExactSizeIterator<Item = ([f64; 3], [f64; 3])> {
        let rows = self
            .means()
            .iter()
            .step_by((self.means().len() / ONSETS).max(1));
        rows.map(|row| (row.reference_mm.map(|x| x * 1e-3), row.vertical))
    }
}
