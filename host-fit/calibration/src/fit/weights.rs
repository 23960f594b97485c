//! What the weights of a robust fit say of its rows.

use crate::judge::left_out::{LeftOut, RowPlace};
use hallstage_input::dataset::Dataset;
use hallstage_solver::solve::robust::HALF;

/// The rows that count less than half.
pub(super) fn outliers(selected: &[usize], weights: &[f64]) -> impl Iterator<Item = usize> {
    let light = selected.iter().zip(weights).filter(|(_, w)| **w < HALF);
    light.map(|(&row, _)| row)
}

/// The weights of all rows of a dataset.
pub(super) fn by_row(dataset: &Dataset, selected: &[usize], weights: &[f64]) -> Vec<f64> {
    let mut all = vec![0.0; dataset.rows.len()];
    for (&row, weight) in selected.iter().zip(weights) {
        all[row] = *weight;
    }
    all
}

/// How many count less than half, and where.
pub(super) fn left_out(dataset: &Dataset, selected: &[usize], weights: &[f64]) -> LeftOut {
    let mut left_out = LeftOut::default();
    for (&row, weight) in selected.iter().zip(weights) {
        let row = &dataset.rows[row];
        let movement = &dataset.movements[row.movement];
        let place = RowPlace {
            log: movement.log,
            movement: movement.index,
            t_us: row.t_us,
        };
        left_out.take(place, *weight < HALF);
    }
    left_out
}
