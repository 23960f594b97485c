//! What the user of a fit chooses.

use hallstage_solver::estimator::draw::Draw;
use hallstage_solver::estimator::model::Model;
use hallstage_solver::estimator::robust::Loss;
use hallstage_solver::solve::{Projection, Solver, SolverOptions};
use runtime::parameters::Text;

/// Which model is fitted.
#[derive(Clone, Copy, Debug)]
pub enum ModelChoice {
    /// The field model where the log can carry it, else Model (31).
    Auto,
    /// This one.
    Named(&'static Model),
}

/// What the user chose.
#[derive(Clone, Debug)]
pub struct FitSettings {
    /// The model.
    pub model: ModelChoice,
    /// Rows to use; all if `None`.
    pub train: Option<usize>,
    /// How they are drawn.
    pub draw: Draw,
    /// How the problem is solved.
    pub solver: Solver,
    /// How much rows count that the model does not explain; a search counts all alike.
    pub loss: Loss,
    /// For the solver; its seed also draws the rows.
    pub options: SolverOptions,
    /// Serial number of the stage, for the blob.
    pub serial: Text,
    /// Creation time, for the blob.
    pub created: Text,
    /// Keep a fit that does not explain most of the motion, or with parameters that the log does not determine.
    /// Without it such a fit is an error.
    pub force: bool,
}

impl FitSettings {
    /// All rows by robust least squares, with seed 1, for a blob without serial number and creation time.
    pub fn new(model: ModelChoice) -> Self {
        Self {
            model,
            train: None,
            draw: Draw::Stratified,
            solver: Solver::LeastSquares,
            loss: Loss::Cauchy,
            options: SolverOptions::new(Projection::Linear, 1),
            serial: Text::default(),
            created: Text::default(),
            force: false,
        }
    }
}
