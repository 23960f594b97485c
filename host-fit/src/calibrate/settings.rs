//! Which settings of a fit go together: only least squares has weights, and the field model has one way to
//! be fitted.

use hallstage_calibration::fit::ModelChoice;
use hallstage_solver::estimator::robust::Loss;
use hallstage_solver::solve::{Projection, Solver};
use runtime::ModelKind;

/// A setting that does not go with the others.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{argument}: {problem}")]
pub struct Mismatch {
    /// Which: `loss`, `solver` or `project`.
    pub argument: &'static str,
    /// Why, and what to do.
    pub problem: String,
}

/// The loss of a fit: that asked for, else the usual one of its solver.
///
/// # Errors
/// [`Mismatch`] where settings do not go together.
pub fn choose_loss(
    loss: Option<Loss>,
    model: ModelChoice,
    solver: Solver,
    projection: Projection,
) -> Result<Loss, Mismatch> {
    let is_field = matches!(model, ModelChoice::Named(model) if model.kind == ModelKind::Field);
    let (argument, problem) = match (solver, loss) {
        (Solver::Search(_), Some(Loss::Huber | Loss::Cauchy)) => (
            "loss",
            format!(
                "a search counts all rows alike: leave --solver {} out, or take --loss none",
                solver.name()
            ),
        ),
        (Solver::Search(_), _) if is_field => (
            "solver",
            "--model field has a solver of its own; leave --solver out".to_owned(),
        ),
        _ if is_field && projection != Projection::Linear => (
            "project",
            "--model field has a projection of its own; leave --project out".to_owned(),
        ),
        (_, Some(loss)) => return Ok(loss),
        (Solver::Search(_), None) => return Ok(Loss::None),
        (Solver::LeastSquares, None) => return Ok(Loss::Cauchy),
    };
    Err(Mismatch { argument, problem })
}
