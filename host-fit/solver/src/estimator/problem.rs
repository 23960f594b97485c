//! Stage, model and rows of a fit by the pose.
//!
//! ```
//! # use hallstage_input::shipped::STAGE_TOML;
//! # use hallstage_input::stage::Stage;
//! # let stage = Stage::from_toml(STAGE_TOML, "stage.toml".as_ref())?;
//! # use hallstage_input::log::{self, ReadOptions};
//! # use hallstage_input::shipped::LOG_GZ;
//! # let reading = log::read_bytes(LOG_GZ, "paper.csv.gz".as_ref(), &stage, &ReadOptions::FIT)?;
//! # let dataset = reading.dataset;
//! use hallstage_solver::estimator::problem::Problem;
//! use hallstage_solver::estimator::draw::{Draw, draw_rows};
//! use hallstage_solver::estimator::model::Model;
//! use runtime::ModelKind;
//!
//! let rows = draw_rows(&dataset, 200, Draw::Stratified, 1);
//! let problem = Problem::new(&dataset, &rows, &stage, Model::from_kind(ModelKind::M31));
//! assert_eq!((problem.rows.rows.len(), problem.rows.movements_of_log), (200, 57));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use super::model::Model;
use super::rows::Rows;
use hallstage_input::dataset::Dataset;
use hallstage_input::stage::Stage;
use std::sync::Arc;

/// A fitness counts errors of a pose in this unit, m and rad: um and urad, as in the paper.
pub const UNIT: f64 = 1e-6;

/// What a solver minimises: the sum of squared pose errors over some rows of a log.
#[derive(Clone, Debug)]
pub struct Problem<'a> {
    /// The stage: designed values and search ranges.
    pub stage: &'a Stage,
    /// The model.
    pub model: &'static Model,
    /// The rows.
    pub rows: Arc<Rows>,
}

impl<'a> Problem<'a> {
    /// The problem of fitting `model` to the rows `selected` (ascending) of `dataset`.
    pub fn new(
        dataset: &Dataset,
        selected: &[usize],
        stage: &'a Stage,
        model: &'static Model,
    ) -> Self {
        Self {
            stage,
            model,
            rows: Rows::new(dataset, selected).into(),
        }
    }

    /// The problem on about `most` of its rows: see [`Rows::thinned`].
    #[must_use]
    pub fn thinned(&self, most: usize) -> Self {
        Self {
            rows: self.rows.thinned(most).into(),
            ..*self
        }
    }

    /// The fitness of the paper, as this project defines it: the root of the mean over rows and
    /// axes of the squared error (um, um, urad), from their sum `cost`.
    /// Rounding may make the sum of an exact fit negative.
    pub fn fitness(&self, cost: f64) -> f64 {
        let cost = if cost < 0.0 { 0.0 } else { cost };
        (cost / (3.0 * self.rows.rows.len() as f64)).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimator::paper::Parameters;
    use crate::estimator::synthetic_for_tests::Protocol;
    use hallstage_input::dataset::Movement;
    use hallstage_input::shipped;
    use runtime::ModelKind;

    #[test]
    fn thinning_leaves_rows_to_every_movement_that_moves() {
        let stage = shipped::stage();
        let truth = Parameters::designed(&stage);
        let mut dataset = Protocol::exact(truth, 20).dataset(&stage);
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
        let problem = Problem::new(&dataset, &all, &stage, Model::from_kind(ModelKind::M31));
        let sizes = |most| -> Vec<usize> {
            let thinned = problem.thinned(most);
            let rows = thinned.rows.movement_rows();
            rows.map(|rows| rows.len()).collect()
        };
        // 2,000 rows are enough for all of the 57 that move; 100 are not, and are exceeded.
        assert_eq!(sizes(2000), [vec![20; 57], vec![2]].concat());
        assert_eq!(sizes(100), [vec![7; 57], vec![2]].concat());
    }
}
