//! The run to make for the field model, and the errors to expect, before anything is measured.
//!
//! | file | content |
//! |---|---|
//! | [`run`] | a slow and a fast sine for each axis between smooth ends |
//! | [`mod@forecast`] | the forecast of a fit to a run |
//! | [`search`] | the choice of the frequencies |
//! | [`temperature`] | the logs that determine the temperature coefficients |
//!
//! ```
//! # use hallstage_input::shipped::STAGE_TOML;
//! # use hallstage_input::stage::Stage;
//! # let stage = Stage::from_toml(STAGE_TOML, "stage.toml".as_ref())?;
//! let plan = hallstage_calibration::plan::plan(&stage, 8.0)?;
//! assert_eq!(plan.run.seconds, 8.0);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod forecast;
pub mod run;
pub mod search;
pub mod temperature;
#[cfg(test)]
mod tests;

use forecast::{forecast, forecaster};
use hallstage_input::axis::AXES;
use hallstage_input::stage::Stage;
use hallstage_solver::estimator::forecast::{Forecast, Forecaster};
use run::PlannedRun;

/// Largest predicted error in service over the noise floor of an accepted run: the sensors, not the run,
/// then limit the stage.
pub const RATIO_MAX: f64 = 1.03;
/// Longest run, s: nothing is gained beyond a few minutes.
pub const SECONDS_MAX: f64 = 600.0;
/// Maximum number of servo periods of a run.
pub const PERIODS_MAX: f64 = 2e6;
/// Length of the ends, s, where the limits allow it.
const TAPER_S: f64 = 0.5;
/// Longest ends, as a share of the run.
const TAPER_MAX: f64 = 0.25;
/// Maximum number of rows in the final forecast.
const ROWS_MAX: f64 = 20_000.0;

/// A run and its forecast.
#[derive(Clone, Debug)]
pub struct Plan {
    /// The run.
    pub run: PlannedRun,
    /// The forecast of a fit to the run, for a stage as designed.
    pub forecast: Forecast,
}

/// Why there is no plan.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PlanError {
    /// An axis cannot reach its amplitude within its limits.
    TooFast {
        /// Its key in `[motion]`.
        axis: &'static str,
        /// Its amplitude, m or rad.
        amplitude: f64,
        /// The length, s.
        seconds: f64,
    },
    /// There are fewer than six different frequencies for the axes.
    TooFewFrequencies {
        /// The length, s.
        seconds: f64,
    },
    /// The designed probes do not determine a pose of the service.
    NoPose,
    /// The run does not determine the field model.
    NotDetermined {
        /// The length, s.
        seconds: f64,
        /// Errors in service over the noise floor, X, Y, Rz.
        ratios: [f64; 3],
        /// Keys of the axes that do not move over their whole range of service.
        short_axes: Vec<&'static str>,
    },
}

/// The best run of this length for a stage before its calibration.
///
/// # Errors
/// Every variant of [`PlanError`].
pub fn plan(stage: &Stage, seconds: f64) -> Result<Plan, PlanError> {
    let mut taper_s = TAPER_S.min(TAPER_MAX * seconds);
    let allowed = loop {
        let allowed: [Vec<f64>; 6] = std::array::from_fn(|axis| {
            search::allowed_cycles(&stage.motion.axes[axis], axis, seconds, taper_s)
        });
        let Some(axis) = allowed.iter().position(Vec::is_empty) else {
            break allowed;
        };
        // With longer ends speed and acceleration are lower.
        if taper_s >= TAPER_MAX * seconds {
            return Err(PlanError::TooFast {
                axis: AXES[axis].key,
                amplitude: stage.motion.axes[axis].amplitude,
                seconds,
            });
        }
        taper_s = (2.0 * taper_s).min(TAPER_MAX * seconds);
    };
    let forecaster = forecaster(stage).ok_or(PlanError::NoPose)?;
    let run = search::best(stage, &forecaster, seconds, taper_s, &allowed)
        .ok_or(PlanError::TooFewFrequencies { seconds })?;
    judged(stage, &forecaster, run)
}

/// A run with its forecast, if the predicted errors are small enough.
///
/// # Errors
/// [`PlanError::NotDetermined`].
pub fn judged(stage: &Stage, forecaster: &Forecaster, run: PlannedRun) -> Result<Plan, PlanError> {
    let step_s = stage.servo_period_s.max(run.seconds / ROWS_MAX);
    let refused = |ratios| {
        Err(PlanError::NotDetermined {
            seconds: run.seconds,
            ratios,
            short_axes: short_axes(stage, &run),
        })
    };
    let Some(forecast) = forecast(forecaster, &run, stage.servo_period_s, step_s) else {
        return refused([f64::INFINITY; 3]);
    };
    let ratios = forecast.service.ratios();
    if ratios.iter().all(|&ratio| ratio <= RATIO_MAX) {
        Ok(Plan { run, forecast })
    } else {
        refused(ratios)
    }
}

/// Keys of the axes that do not move over their whole range of service.
fn short_axes(stage: &Stage, run: &PlannedRun) -> Vec<&'static str> {
    let axes = AXES.iter().zip(&stage.motion.axes).zip(run.amplitudes);
    axes.filter(|((_, motion), amplitude)| *amplitude < motion.service)
        .map(|((axis, _), _)| axis.key)
        .collect()
}
