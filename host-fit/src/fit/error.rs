//! Why a fit gives no calibration.

use crate::judge::identify::FitFailure;
use crate::solve::SolveError;
use crate::solve::field::error::FieldFitError;
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
    /// The stage file has no range for a parameter that is fitted.
    #[error(
        "the table [search] of stage.toml has no range `{key}`, which model ({model}) needs: add it"
    )]
    NoRange {
        /// Its key.
        key: &'static str,
        /// Name of the model.
        model: &'static str,
    },
    /// The model has terms that no decoder of this program has.
    #[error(
        "no decoder of this program has all terms of model ({model}): it can be fitted, but not judged or used"
    )]
    NoDecoder {
        /// Name of the model.
        model: &'static str,
    },
    /// The fitted parameters cannot serve a decoder.
    #[error(
        "the fitted parameters cannot be used: {0}. Check the vertical motion in the log and the search ranges"
    )]
    Unusable(ParameterError),
}
