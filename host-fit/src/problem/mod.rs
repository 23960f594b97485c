//! The estimation problem: which rows, which model, which weights, which offsets are free.

pub mod draw;
pub mod parameters;
pub mod synthetic;
pub mod zero_deviation;

use crate::input::dataset::{Dataset, Row};
use crate::input::stage::Stage;
use runtime::ModelKind;
use std::ops::Range;

/// One row of the problem, in um, um, urad for the fit and m, rad for the vertical pose: so
/// that residuals and gains are of the order of one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrainRow {
    /// Displacement read by the probes A, B, C at the designed scale, um.
    pub signal_um: [f64; 3],
    /// Z, Rx, Ry: m, rad, rad.
    pub vertical: [f64; 3],
    /// Reference X, Y, Rz: um, um, urad.
    pub reference_um: [f64; 3],
}

/// The rows of one movement within [`Problem::rows`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Group {
    /// Index of the movement in [`Dataset::movements`].
    pub movement: usize,
    /// Its rows in the problem.
    pub rows: Range<usize>,
}

/// What a solver minimises: the weighted sum of squared pose errors over some rows of a log.
#[derive(Clone, Debug)]
pub struct Problem<'a> {
    /// The stage: designed values and search ranges.
    pub stage: &'a Stage,
    /// The model.
    pub model: ModelKind,
    /// The rows, those of a movement next to each other.
    pub rows: Vec<TrainRow>,
    /// The movements that have rows.
    pub groups: Vec<Group>,
    /// Weights of the squared errors of X, Y, Rz (um, um, urad); 1, 1, 1 in the paper's spirit.
    pub weights: [f64; 3],
    /// Number of movements of the whole log, with or without rows here.
    pub movements: usize,
}

impl<'a> Problem<'a> {
    /// The problem of fitting `model` to the rows `selected` (ascending) of `dataset`.
    pub fn new(dataset: &Dataset, selected: &[usize], stage: &'a Stage, model: ModelKind) -> Self {
        let mut groups: Vec<Group> = Vec::new();
        let mut rows = Vec::with_capacity(selected.len());
        for &index in selected {
            let row = &dataset.rows[index];
            let here = rows.len();
            match groups.last_mut() {
                Some(group) if group.movement == row.movement => group.rows.end = here + 1,
                _ => groups.push(Group {
                    movement: row.movement,
                    rows: here..here + 1,
                }),
            }
            rows.push(TrainRow::new(row));
        }
        Self {
            stage,
            model,
            rows,
            groups,
            weights: [1.0; 3],
            movements: dataset.movements.len(),
        }
    }

    /// The same problem without rows.
    pub fn clone_head(&self) -> Self {
        Self {
            rows: Vec::new(),
            groups: Vec::new(),
            ..*self
        }
    }

    /// The fitness of the paper, as this project defines it: the root of the mean over rows and
    /// axes of the weighted squared error (um, um, urad), from the sum of them.
    pub fn fitness(&self, cost: f64) -> f64 {
        (cost / (3.0 * self.rows.len() as f64)).sqrt()
    }
}

impl TrainRow {
    fn new(row: &Row) -> Self {
        Self {
            signal_um: row.signal_m.map(|s| s * 1e6),
            vertical: row.vertical,
            reference_um: row.reference.map(|q| q * 1e6),
        }
    }
}
