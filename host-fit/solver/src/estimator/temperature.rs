//! What logs determine of k and h: which temperatures count, what is known before, and what errors of the
//! temperature sensors leave.

use super::parameters::HELD;
use super::terms::COUNT;
use hallstage_input::dataset::Dataset;
use hallstage_input::stage::Stage;
use nalgebra::{DMatrix, Matrix3, Vector3};
use runtime::Temperature;
use std::ops::Range;

/// A coefficient of temperature: k (sensor 0, of the mount) or h (sensor 1, of the body) of a probe.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Coefficient {
    /// The probe, 0 to 2 for A to C.
    pub probe: usize,
    /// The sensor.
    pub sensor: usize,
}

impl Coefficient {
    /// (k, h) of A, B and C, in the order of every list and matrix.
    pub const ALL: [Self; 6] = [
        Self::new(0, 0),
        Self::new(0, 1),
        Self::new(1, 0),
        Self::new(1, 1),
        Self::new(2, 0),
        Self::new(2, 1),
    ];

    /// Rows of the covariance of a posterior with k and h.
    pub const ROWS: usize = COUNT + Self::ALL.len();

    /// The coefficient of a probe and a sensor.
    pub const fn new(probe: usize, sensor: usize) -> Self {
        Self { probe, sensor }
    }

    /// Its place among the six.
    const fn place(self) -> usize {
        2 * self.probe + self.sensor
    }

    /// Its place among the unknowns of a fit and in the covariance of a posterior.
    pub const fn row(self) -> usize {
        COUNT + self.place()
    }

    /// Its name, for instance `k_a`.
    pub fn name(self) -> String {
        format!(
            "{}_{}",
            ["k", "h"][self.sensor],
            ["a", "b", "c"][self.probe]
        )
    }
}

/// k and h as a fit found them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TemperatureFit {
    /// k, h and T0.
    pub temperature: Temperature<f64>,
    /// Standard errors of (k, h) of A, B, C, 1/K; from the prior where the log does not determine them.
    pub error_per_k: [[f64; 2]; 3],
    /// The spans of the temperatures of mount and body that determine k and h, K; 0 where only the prior does.
    pub spans_k: [f64; 2],
}

/// A single log with a smaller span, K, does not determine k: the reference drifts as well.
const SPAN_MIN_K: f64 = 2.0;
/// Error of a log's gain by the errors of its temperatures. With two logs the error of k is 4e-5 over their distance
/// in K.
pub(super) const OF_SENSORS: f64 = 2.8e-5;

/// Errors of k and of h by the form of the model, 1/K: expansion moves a probe over its magnet, where the field
/// differs. Standard deviation over simulated stages where one temperature changes.
const OF_FORM: f64 = 3.5e-5;
/// Error of k + h by the form, 1/K: both temperatures change alike, stage and framework grow together.
const OF_FORM_TOGETHER: f64 = 1.3e-5;

/// The sensors of temperature of some logs.
#[derive(Clone, Debug)]
pub struct Sensors {
    /// Whether mount and body have one.
    pub is_there: [bool; 2],
    /// See [`TemperatureFit::spans_k`].
    pub spans_k: [f64; 2],
    /// Rows and mean changes of temperature from T0, K, of each log; of one alone, of its halves.
    pub by_log: Vec<(f64, [f64; 2])>,
    /// k and h before a log is seen: mean and standard deviation, 1/K.
    pub prior_per_k: [[f64; 2]; 2],
}

impl Sensors {
    /// The sensors of a dataset.
    pub fn new(dataset: &Dataset, stage: &Stage) -> Self {
        let prior_per_k = stage.temperature.prior_per_k;
        Self {
            is_there: dataset.temperature.reach_mk.map(|reach| reach != 0),
            spans_k: [0, 1].map(|sensor| span_k(dataset, sensor, prior_per_k[sensor][1])),
            by_log: by_log(dataset),
            prior_per_k,
        }
    }

    /// Standard deviations of k and h about their means for the fit, 1/K.
    pub(super) fn deviations(&self) -> [f64; 2] {
        [0, 1].map(|k| match self.spans_k[k] > 0.0 {
            true => self.prior_per_k[k][1],
            false => HELD,
        })
    }

    /// Completes the covariance of k and h in the covariance of a fit. It adds the errors of the sensors (one
    /// for each log, the same for all probes) and of the form, and takes the prior where they were held in the fit. The gain of a
    /// log follows 1, dM and dH, and is known by its rows: `signal_to_noise` is the mean square of a row's signal over
    /// its noise.
    pub(super) fn complete(&self, covariance: &mut DMatrix<f64>, signal_to_noise: f64) {
        let along = |change_k: [f64; 2]| Vector3::new(1.0, change_k[0], change_k[1]);
        let [k, h] = self
            .deviations()
            .map(|deviation| 1.0 / (deviation * deviation));
        let mut normal = Matrix3::from_diagonal(&Vector3::new(1.0, k, h));
        for (rows, change_k) in &self.by_log {
            let along = along(*change_k);
            normal += along * along.transpose() * (rows * signal_to_noise);
        }
        let inverse = normal.try_inverse().unwrap_or_else(Matrix3::zeros);
        let mut sensor_noise = Matrix3::zeros();
        for (rows, change_k) in &self.by_log {
            let error = inverse * along(*change_k) * (rows * signal_to_noise * OF_SENSORS);
            sensor_noise += error * error.transpose();
        }
        for coefficient in Coefficient::ALL {
            let (i, sensor) = (coefficient.row(), coefficient.sensor);
            for other in Coefficient::ALL {
                let j = other.row();
                covariance[(i, j)] += sensor_noise[(1 + sensor, 1 + other.sensor)];
            }
            let other = Coefficient::new(coefficient.probe, 1 - sensor).row();
            let together = OF_FORM_TOGETHER * OF_FORM_TOGETHER;
            match [sensor, 1 - sensor].map(|sensor| self.spans_k[sensor] > 0.0) {
                [true, true] => {
                    covariance[(i, i)] += OF_FORM * OF_FORM;
                    covariance[(i, other)] += 0.5 * together - OF_FORM * OF_FORM;
                }
                [true, false] => covariance[(i, i)] += together,
                [false, _] => {}
            }
            if self.is_there[sensor] && self.spans_k[sensor] == 0.0 {
                covariance[(i, i)] = self.prior_per_k[sensor][1] * self.prior_per_k[sensor][1];
            }
        }
    }
}

/// The range of a log that spans enough, else of the means of several logs. 0 where the errors of the sensors are
/// too large to improve on the prior, `deviation`.
fn span_k(dataset: &Dataset, sensor: usize, deviation: f64) -> f64 {
    let log_rows = || dataset.logs.iter().map(|log| log.rows.clone());
    let range_k = |ends: Option<[i32; 2]>| ends.map_or(0.0, |[a, b]| f64::from(b - a) * 1e-3);
    let within = log_rows().map(|rows| range_k(dataset.temperature_range_mc(sensor, rows)));
    let means = log_rows().filter_map(|rows| dataset.temperature_mean_mc(sensor, rows));
    let ends = means.fold([i32::MAX, i32::MIN], |[low, high], mean| {
        [low.min(mean), high.max(mean)]
    });
    let span_k = if within.fold(0.0, f64::max) >= SPAN_MIN_K {
        range_k(dataset.temperature_range_mc(sensor, 0..dataset.rows.len()))
    } else {
        range_k(Some(ends).filter(|[low, high]| low < high))
    };
    let two_logs = OF_SENSORS * f64::sqrt(2.0);
    if two_logs < deviation * span_k {
        span_k
    } else {
        0.0
    }
}

fn by_log(dataset: &Dataset) -> Vec<(f64, [f64; 2])> {
    let parts: Vec<Range<usize>> = match dataset.logs.as_slice() {
        [log] => {
            let middle = usize::midpoint(log.rows.start, log.rows.end);
            vec![log.rows.start..middle, middle..log.rows.end]
        }
        logs => logs.iter().map(|log| log.rows.clone()).collect(),
    };
    let one = |rows: Range<usize>| {
        let zero_mc = dataset.temperature.zero_mc;
        let mean_mc = |k: usize| dataset.temperature_mean_mc(k, rows.clone());
        let mean_mc = [0, 1].map(|k| mean_mc(k).unwrap_or(zero_mc[k]));
        (rows.len() as f64, dataset.temperature.changes_k(mean_mc))
    };
    parts.into_iter().map(one).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_logs_leave_k_as_uncertain_as_their_sensors_over_their_distance() {
        for distance_k in [1.0, 3.0, 8.0] {
            let sensors = Sensors {
                is_there: [true, false],
                spans_k: [distance_k, 0.0],
                by_log: vec![(15_000.0, [0.0; 2]), (4_000.0, [distance_k, 0.0])],
                prior_per_k: [[-1.2e-3, 3e-4], [0.0, 2e-4]],
            };
            let mut covariance = DMatrix::zeros(Coefficient::ROWS, Coefficient::ROWS);
            sensors.complete(&mut covariance, 3e5);
            let expected = (4e-5 / distance_k).hypot(OF_FORM_TOGETHER);
            for probe in 0..3 {
                let k = Coefficient::new(probe, 0).row();
                let error = covariance[(k, k)].sqrt();
                assert!(
                    (error / expected - 1.0).abs() < 0.03,
                    "{error:e} {expected:e}"
                );
            }
            // The sensors' part is the same for all probes, and h is held.
            let [a, c] = [0, 2].map(|probe| Coefficient::new(probe, 0).row());
            let shared = covariance[(a, c)].sqrt() * distance_k;
            assert!((shared / 4e-5 - 1.0).abs() < 0.03, "{shared:e}");
            let h = Coefficient::new(0, 1).row();
            assert!(covariance[(h, h)] < 1e-20);
        }
    }
}
