//! The forecast of a fit to a run, before anything is measured.

use super::run::{PlannedRun, TONES_HZ};
use hallstage_input::stage::Stage;
use hallstage_simulate::sensors::SensorErrors;
use hallstage_solver::estimator::dynamics::ARMS_M;
use hallstage_solver::estimator::forecast::{Forecast, Forecaster};
use hallstage_solver::estimator::rows::{FieldRow, Rows};
use hallstage_solver::estimator::whiten::Noise;
use std::f64::consts::TAU;

/// The forecaster for a stage before its calibration: as designed, with the noise of the given logs.
/// `None` where the probes do not determine a pose of the service.
pub fn forecaster(stage: &Stage) -> Option<Forecaster> {
    let sensors = SensorErrors::USUAL;
    let noise = Noise {
        white_m: [sensors.hall_m; 3],
        drift: sensors.drift_per_root_s,
    };
    let [x, y, rz, z, rx, ry] = stage.motion.axes.map(|axis| axis.service);
    Forecaster::new(stage, &noise, ([x, y, rz], [z, rx, ry]))
}

/// The forecast for a run that is recorded every `period_s` and sampled here every `step_s`; `None` where
/// the run does not determine the parameters.
pub fn forecast(
    forecaster: &Forecaster,
    run: &PlannedRun,
    period_s: f64,
    step_s: f64,
) -> Option<Forecast> {
    forecaster.forecast(&rows(&[(run, [0.0; 2])], step_s), step_s / period_s)
}

/// Standard error of the change of a probe's signal by the acceleration of an axis, as the fast tone of a run
/// determines it, m per m/s2, rotations at 0.25 m: sigma sqrt(2 / N) / (B w^2), with the noise sigma of N rows and
/// the rate w of the tone. Infinite without a tone.
pub fn acceleration_error(run: &PlannedRun, axis: usize, period_s: f64) -> f64 {
    let rate = TAU * TONES_HZ[axis];
    let acceleration = ARMS_M[axis] * run.tones[axis] * rate * rate;
    SensorErrors::USUAL.hall_m * (2.0 / run.rows(period_s) as f64).sqrt() / acceleration
}

/// Rows of runs, sampled every `step_s`. Each run is a movement at a distance (mount, body) from T0 in K.
pub(super) fn rows(runs: &[(&PlannedRun, [f64; 2])], step_s: f64) -> Rows {
    let (mut rows, mut movements) = (Vec::new(), Vec::new());
    for (run, change_k) in runs {
        let start = rows.len();
        let row = |k: usize| {
            let time_s = (k as f64 + 0.5) * step_s;
            let at: [[f64; 3]; 6] = std::array::from_fn(|axis| run.axis_at(axis, time_s));
            FieldRow {
                temperature_k: [*change_k; 3],
                weight: 1.0,
                time_s,
                signal_m: [0.0; 3],
                vertical: [at[3][0], at[4][0], at[5][0]],
                reference: [at[0][0], at[1][0], at[2][0]],
                rate: at.map(|[_, rate, _]| rate),
                acceleration_m_s2: std::array::from_fn(|axis| at[axis][2] * ARMS_M[axis]),
            }
        };
        rows.extend((0..(run.seconds / step_s).floor() as usize).map(row));
        movements.push(start..rows.len());
    }
    Rows::from_movements(rows, movements)
}
