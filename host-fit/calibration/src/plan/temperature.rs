//! The logs that determine k and h, and the errors to expect at other temperatures after each.
//!
//! A cold run comes first, a short run in warm state last. Where the body has a sensor, a short run soon
//! after work begins comes between them: the body is warm then, and the mount is cold.

use super::forecast::{forecaster, rows};
use super::{PlanError, plan};
use hallstage_input::stage::Stage;
use hallstage_solver::estimator::temperature::Sensors;

/// Usual length of the cold run, s.
pub const COLD_S: f64 = 30.0;
/// Length of the later runs, s.
const SHORT_S: f64 = 8.0;
/// Temperatures above the cold run, K, equal for all parts.
const DISTANCES_K: [f64; 2] = [5.0, 10.0];
/// Rows of a run in a forecast.
const ROWS: f64 = 1000.0;

/// A log of the protocol.
#[derive(Clone, Debug, PartialEq)]
pub struct WarmLog {
    /// Its name.
    pub name: &'static str,
    /// When to record it.
    pub when: &'static str,
    /// Length, s.
    pub seconds: f64,
    /// Temperatures of mount and body above the first log, K.
    pub warmer_k: [f64; 2],
    /// Standard errors of k and h of the worst probe, from all logs up to here, 1/K.
    pub error_per_k: [f64; 2],
    /// Errors in service over the noise floor, X, Y, Rz, 5 and 10 K away from the cold run.
    pub ratios: Vec<[f64; 3]>,
}

/// The protocol with a cold run of this length in s.
///
/// # Errors
/// See [`plan()`].
pub fn protocol(stage: &Stage, seconds: f64) -> Result<Vec<WarmLog>, PlanError> {
    let is_there = [true, stage.temperature.columns[1].is_some()];
    let (long, short) = (plan(stage, seconds)?.run, plan(stage, SHORT_S)?.run);
    let log = |name, when, seconds, warmer_k| WarmLog {
        name,
        when,
        seconds,
        warmer_k,
        error_per_k: [0.0; 2],
        ratios: Vec::new(),
    };
    let early = "ten minutes after work begins";
    let warm = "an hour after that or later, when the mount is 3 K warmer or more";
    let warm_body_k = if is_there[1] { 6.0 } else { 0.0 };
    let mut logs = vec![
        log("cold", "before work", seconds, [0.0; 2]),
        log("early", early, SHORT_S, [0.3, 2.0]),
        log("warm", warm, SHORT_S, [3.0, warm_body_k]),
    ];
    // Without a sensor on the body the early log adds nothing to the cold one.
    logs.retain(|log| is_there[1] || log.name != "early");
    let forecaster = forecaster(stage).ok_or(PlanError::NoPose)?;
    let step_s = (seconds / ROWS).max(stage.servo_period_s);
    for last in 0..logs.len() {
        let made = &logs[..=last];
        let all_s: f64 = made.iter().map(|log| log.seconds).sum();
        // T0 is the mean over the rows.
        let zero = [0, 1].map(|k| {
            let sums = made.iter().map(|log| log.seconds * log.warmer_k[k]);
            sums.sum::<f64>() / all_s
        });
        let change = |log: &WarmLog| [0, 1].map(|k| log.warmer_k[k] - zero[k]);
        let runs: Vec<_> = (made.iter().enumerate())
            .map(|(index, log)| (if index == 0 { &long } else { &short }, change(log)))
            .collect();
        let most = |k: usize| made.iter().map(|log| log.warmer_k[k]).fold(0.0, f64::max);
        let count = |log: &WarmLog| log.seconds / stage.servo_period_s;
        let sensors = Sensors {
            is_there,
            spans_k: [most(0), most(1)],
            by_log: made.iter().map(|log| (count(log), change(log))).collect(),
            prior_per_k: stage.temperature.prior_per_k,
        };
        let at = DISTANCES_K.map(|distance| [0, 1].map(|k| distance - zero[k]));
        let weight = step_s / stage.servo_period_s;
        let rows = rows(&runs, step_s);
        let expected = forecaster.forecast_temperatures(&rows, weight, &sensors, &at);
        let expected = expected.ok_or(PlanError::NoPose)?;
        let errors = expected.error_per_k;
        let worst = |k: usize| errors.iter().map(|error| error[k]).fold(0.0, f64::max);
        logs[last].error_per_k = [worst(0), worst(1)];
        logs[last].ratios = expected.ratios;
    }
    Ok(logs)
}
