//! A log in means over a few rows each, without rows far from the others.

use super::effects::suspects;
use crate::diagnose::limits::{CLEAR, MEANS_MAX, RARITY};
use hallstage_input::dataset::Dataset;
use hallstage_input::stage::Stage;
use hallstage_input::statistics::median;
use hallstage_solver::estimator::dynamics::{Dynamics, PER_ACCELERATION};
use hallstage_solver::estimator::parameters::{FieldParameters, HELD, place_m};
use hallstage_solver::estimator::probe::probes;
use hallstage_solver::estimator::rows::Rows;
use hallstage_solver::estimator::terms::COUNT;
use hallstage_solver::statistics::white_noise;
use std::ops::Range;

/// Rows of a piece of a movement with a noise of its own, which is known within a tenth.
const PIECE: usize = 500;

/// A log in means.
#[derive(Debug)]
pub(super) struct Means {
    /// The means, each a block; the weight is the number of rows.
    pub(super) rows: Rows,
    /// The first row of each mean in the dataset.
    pub(super) first: Vec<usize>,
    /// White noise of A, B, C from row to row, m.
    pub(super) white_m: [f64; 3],
    /// Errors of the resets, m, m, rad, where they are declared.
    pub(super) resets: Option<[f64; 3]>,
    /// Prior standard deviation of the places of the probes, m.
    pub(super) place_m: f64,
    /// Prior standard deviation of what acceleration adds to the readings, m per m/s2.
    pub(super) acceleration: f64,
}

impl Means {
    /// The rows of a dataset; `parameters` predict its signals.
    pub(super) fn new(
        dataset: &Dataset,
        stage: &Stage,
        parameters: &FieldParameters,
        shows_acceleration: bool,
    ) -> Self {
        let probes = &probes(parameters);
        let all: Vec<usize> = (0..dataset.rows.len()).collect();
        let mut rows = Rows::new(dataset, &all);
        let residuals = rows.residuals_m(
            probes,
            &Dynamics::default(),
            &vec![[0.0; 3]; rows.movements.len()],
        );
        let least_m = stage.hall.m_per_count / 12f64.sqrt();
        let white = |pieces: &[Range<usize>]| {
            let threes = |k: usize| {
                let windows = pieces
                    .iter()
                    .flat_map(|rows| residuals[rows.clone()].windows(3));
                windows.map(move |w| [w[0][k], w[1][k], w[2][k]])
            };
            [0, 1, 2].map(|k| white_noise(threes(k)).max(least_m))
        };
        let movements: Vec<Range<usize>> = rows.movement_rows().collect();
        let white_m = white(&movements);
        // Rows far from the middle of their block, as beside a step, have no weight.
        for block in rows.blocks.clone() {
            for (k, white_m) in white_m.into_iter().enumerate() {
                let mut values: Vec<f64> = residuals[block.clone()].iter().map(|r| r[k]).collect();
                let middle = median(&mut values).unwrap_or(0.0);
                for row in block.clone() {
                    if (residuals[row][k] - middle).abs() > CLEAR * white_m {
                        rows.rows[row].weight = 0.0;
                    }
                }
            }
        }
        // Where a probe is noisier than usual, rows count less.
        for movement in movements {
            let pieces = (movement.len() / PIECE).max(1);
            let end = |k: usize| movement.start + k * movement.len() / pieces;
            for piece in (0..pieces).map(|k| end(k)..end(k + 1)) {
                let own_m = white(std::slice::from_ref(&piece));
                let part = [0, 1, 2].map(|k| white_m[k] / own_m[k].max(white_m[k]));
                let weight = part.into_iter().fold(1.0, f64::min).powi(2);
                (rows.rows[piece].iter_mut()).for_each(|row| row.weight *= weight);
            }
        }
        let (rows, first) = rows.means(MEANS_MAX);
        Self {
            rows,
            first,
            white_m,
            resets: stage.reset_sd,
            place_m: place_m(stage),
            acceleration: if shows_acceleration {
                PER_ACCELERATION
            } else {
                HELD
            },
        }
    }

    /// Degrees of freedom: numbers in the means less parameters and offsets of the movements.
    pub(super) fn freedom(&self) -> f64 {
        let offsets = self.resets.map_or(self.rows.movements.len(), |_| 0);
        (3.0 * (self.rows.rows.len() - offsets) as f64 - COUNT as f64).max(1.0)
    }

    /// The gain in chi-square that an additional unknown needs (Schwarz 1978).
    pub(super) fn per_unknown(&self) -> f64 {
        libm::log(3.0 * self.rows.rows.len() as f64)
    }

    /// The gain that a fault needs: it is one unknown out of all suspects, and of all means if its onset is unknown.
    pub(super) fn per_fault(&self, with_onset: bool, is_rare: bool) -> f64 {
        let onsets = if with_onset { self.rows.rows.len() } else { 1 };
        let choices = (suspects(true).count() * onsets) as f64;
        let rarity = if is_rare { RARITY } else { 1.0 };
        self.per_unknown() + 2.0 * libm::log(rarity * choices)
    }
}
