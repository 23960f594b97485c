//! Why a fit gives no calibration.

use crate::judge::identify::FitFailure;
use hallstage_solver::estimator::error::FieldFitError;
use hallstage_solver::solve::SolveError;
use runtime::parameters::ParameterError;

/// Why there is no calibration.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FitError {
    /// The log cannot determine the model, or the model does not describe the log.
    #[error(transparent)]
    Failed(#[from] FitFailure),
    /// The solver found nothing.
    #[error(transparent)]
    Solver(#[from] SolveError),
    /// The field model cannot be fitted to the log, or not so that it serves.
    #[error("{0}")]
    Field(#[from] FieldFitError),
    /// The fitted parameters put a row of the log next to a pole of 1/phi.
    #[error(
        "the {solver} search ended with a row of the log next to a pole of 1/phi, where nothing can be judged: let it run longer (--generations, --population), use --project delta or linear, or take the default solver"
    )]
    AtPole {
        /// Name of the solver.
        solver: &'static str,
    },
    /// The fitted parameters cannot serve a decoder.
    #[error(
        "the fitted parameters cannot be used: {0}. Check the vertical motion in the log and the search ranges"
    )]
    Unusable(ParameterError),
}
