//! Why a fit gives no calibration.

use crate::judge::identify::FitFailure;
use hallstage_solver::estimator::error::FieldFitError;
use hallstage_solver::solve::SolveError;
use runtime::parameters::ParameterError;

/// Why there is no calibration.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FitError {
    /// The log cannot determine the model, or the model does not describe the log.
    Failed(#[from] FitFailure),
    /// The solver found nothing.
    Solver(#[from] SolveError),
    /// The field model cannot be fitted to the log, or not so that it serves.
    Field(#[from] FieldFitError),
    /// The fitted parameters put a row of the log next to a pole of 1/phi.
    AtPole {
        /// Name of the solver.
        solver: &'static str,
    },
    /// The fitted parameters cannot serve a decoder.
    Unusable(ParameterError),
}
