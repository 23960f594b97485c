//! The estimation problem: which rows, which model, which weights, which offsets are free.
//!
//! ```
//! # use hallstage_input::shipped::STAGE_TOML;
//! # use hallstage_input::stage::Stage;
//! # let stage = Stage::from_toml(STAGE_TOML, "stage.toml".as_ref())?;
//! # use hallstage_input::log::{self, ReadOptions};
//! # use hallstage_input::shipped::LOG_GZ;
//! # let reading = log::read_bytes(LOG_GZ, "paper.csv.gz".as_ref(), &stage, &ReadOptions::FIT)?;
//! # let dataset = reading.dataset;
//! use hallstage_solver::problem::Problem;
//! use hallstage_solver::problem::draw::{Draw, draw_rows};
//! use hallstage_solver::problem::model::Model;
//! use runtime::ModelKind;
//!
//! let rows = draw_rows(&dataset, 200, Draw::Stratified, 1);
//! let problem = Problem::new(&dataset, &rows, &stage, Model::of(ModelKind::M31));
//! assert_eq!((problem.rows.len(), problem.movements), (200, 57));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod draw;
pub mod model;
pub mod parameters;
#[cfg(test)]
#[path = "synthetic_for_tests.rs"]
pub mod synthetic;
pub mod terms;
pub mod zero_deviation;

use hallstage_input::dataset::{Dataset, Row};
use hallstage_input::stage::{self, Stage};
use model::Model;
use rayon::prelude::*;
use std::ops::Range;

/// Rows that a thinned problem takes of a movement at least, if it moves.
const MOVING_ROWS_MIN: usize = 8;
/// Rows that a thinned problem takes of a movement that stands still.
const IDLE_ROWS: usize = 2;
/// A movement of less than this share of the largest one stands still.
const IDLE_SHARE: f64 = 0.01;

/// One row of the problem, in um, um, urad for the fit, so that residuals and gains are of the
/// order of one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrainRow {
    /// Displacement read by the probes A, B, C at the designed scale, um.
    pub signal_um: [f64; 3],
    /// Z, Rx, Ry: m, rad, rad.
    pub vertical: [f64; 3],
    /// Reference X, Y, Rz: um, um, urad.
    pub reference_um: [f64; 3],
    /// How much its squared errors count in least squares: 1 unless a robust loss says less.
    pub weight: f64,
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
    pub model: &'static Model,
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
    pub fn new(
        dataset: &Dataset,
        selected: &[usize],
        stage: &'a Stage,
        model: &'static Model,
    ) -> Self {
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

    /// The problem on about `most` of its rows: the same number from each movement that moves,
    /// evenly, and at least eight, since fewer rows would say little beside the zero deviation that
    /// they share; two from each that does not.
    #[must_use]
    pub fn thinned(&self, most: usize) -> Self {
        let strides = self.strides(most);
        let mut rows = Vec::with_capacity(most);
        let mut groups = Vec::with_capacity(self.groups.len());
        for (group, stride) in self.groups.iter().zip(strides) {
            let from = rows.len();
            rows.extend(self.rows[group.rows.clone()].iter().step_by(stride));
            groups.push(Group {
                movement: group.movement,
                rows: from..rows.len(),
            });
        }
        Self {
            rows,
            groups,
            ..*self
        }
    }

    /// Of each movement one of so many rows is taken, so that about `most` are.
    fn strides(&self, most: usize) -> Vec<usize> {
        let rows_of = |group: &Group| &self.rows[group.rows.clone()];
        let moved: Vec<f64> = (self.groups.par_iter())
            .map(|group| moved(rows_of(group).iter().map(|row| row.reference_um)))
            .collect();
        let idle = IDLE_SHARE * moved.iter().copied().fold(0.0, f64::max);
        let moving = moved.iter().filter(|moved| **moved > idle).count();
        let quota = (most / moving.max(1)).max(MOVING_ROWS_MIN);
        let stride = |(group, moved): (&Group, f64)| {
            let wanted = if moved > idle { quota } else { IDLE_ROWS };
            group.rows.len().div_ceil(wanted).max(1)
        };
        self.groups.iter().zip(moved).map(stride).collect()
    }

    /// The fitness of the paper, as this project defines it: the root of the mean over rows and
    /// axes of the weighted squared error (um, um, urad), from the sum of them. Of an exact fit
    /// rounding may leave a sum below zero.
    pub fn fitness(&self, cost: f64) -> f64 {
        let cost = if cost < 0.0 { 0.0 } else { cost };
        (cost / (3.0 * self.rows.len() as f64)).sqrt()
    }
}

/// How far a movement moves: the largest range of X, Y (um) and Rz (urad) by the reference.
fn moved(reference_um: impl Iterator<Item = [f64; 3]> + Clone) -> f64 {
    let of_axis = |axis: usize| reference_um.clone().map(move |reference| reference[axis]);
    let span = |axis| stage::Range::around(of_axis(axis)).width();
    (0..3).map(span).fold(0.0, f64::max)
}

impl TrainRow {
    fn new(row: &Row) -> Self {
        Self {
            signal_um: row.signal_m.map(|s| s * 1e6),
            vertical: row.vertical,
            reference_um: row.reference.map(|q| q * 1e6),
            weight: 1.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hallstage_input::dataset::Movement;
    use hallstage_input::shipped;
    use runtime::ModelKind;

    #[test]
    fn thinning_leaves_rows_to_every_movement_that_moves() {
        let stage = shipped::stage();
        let truth = parameters::Parameters::designed(&stage);
        let mut dataset = synthetic::Protocol::exact(truth, 20).dataset(&stage);
        // A stage that was left standing for ten times as long as all movements took.
        let moving = dataset.rows.len();
        dataset.rows.resize(11 * moving, dataset.rows[0]);
        for row in &mut dataset.rows[moving..] {
            row.movement = dataset.movements.len();
        }
        dataset.movements.push(Movement {
            log: 0,
            index: 57,
            rows: moving..11 * moving,
        });
        let all: Vec<usize> = (0..dataset.rows.len()).collect();
        let problem = Problem::new(&dataset, &all, &stage, Model::of(ModelKind::M31));
        let sizes = |most| -> Vec<usize> {
            let thinned = problem.thinned(most);
            thinned
                .groups
                .iter()
                .map(|group| group.rows.len())
                .collect()
        };
        // 2,000 rows are enough for all of the 57 that move; 100 are not, and are exceeded.
        assert_eq!(sizes(2000), [vec![20; 57], vec![2]].concat());
        assert_eq!(sizes(100), [vec![7; 57], vec![2]].concat());
    }
}
