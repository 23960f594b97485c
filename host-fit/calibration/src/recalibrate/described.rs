//! Does the change explain the log of a recalibration?

use super::{OPEN_MAX_ALL, RecalibrateError, StoredPosterior};
use hallstage_solver::estimator::update::{Change, Update};

/// Chi-square may be this part larger than for the old log, since the model is not exact.
const MISFIT_MAX: f64 = 0.02;
/// Chi-square may be larger by chance, by this many standard deviations.
const CHANCE_MAX: f64 = 3.0;
/// The same for the changes in terms of what the prior allows for.
const FAR_MAX: f64 = 4.0;

/// Refuses a log with residuals that the change does not explain, or that only a change far beyond the prior
/// explains.
pub(super) fn check_described(
    update: &Update,
    known: Option<&StoredPosterior>,
    change: Change,
) -> Result<(), RecalibrateError> {
    let count = update.residuals.max(1) as f64;
    let misfit = known.map_or(1.0, |known| known.misfit.max(1.0));
    let limit = match change {
        Change::Gain | Change::Gains | Change::Temperature => {
            misfit * (1.0 + MISFIT_MAX) + CHANCE_MAX * (2.0 / count).sqrt()
        }
        // All parameters are free: what they don't describe is no other change of the stage.
        Change::All => misfit + OPEN_MAX_ALL * 3.0 * update.rows as f64 / count,
    };
    let ratio = update.chi_squared / count;
    if ratio > limit {
        return Err(RecalibrateError::NotDescribed {
            change,
            ratio,
            limit,
        });
    }
    // Among thousands of residuals a few wild changes would not show.
    let changes = update.changes as f64;
    let far = changes + FAR_MAX * (2.0 * changes).sqrt();
    if update.prior > far {
        return Err(RecalibrateError::TooFar {
            change,
            prior: update.prior,
            limit: far,
        });
    }
    Ok(())
}
