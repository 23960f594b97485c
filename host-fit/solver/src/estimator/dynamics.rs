//! What motion adds to the readings of the probes, and to the errors of the pose in service.
//!
//! Probe i reads s_i(t) = f_i(q(t - tau_i), V(t - tau_i)) + k_i . a(t). Only differences of tau belong to the probes: a lag
//! of all probes cannot be told from a reference that is late. An acceleration moves an arm that bends, and its
//! current in a motor coil adds a field. A controller that knows the commanded speed v and acceleration a corrects a
//! pose: q' = q - G k a + L v with G = J^-1 and L = J^-1 diag(tau) J, J the derivatives of the readings by the pose.

use super::parameters::FieldParameters;
use super::probe::probes;
use super::whiten::{ACCELERATIONS, LAG, PROBE_LAGS};
use nalgebra::{Cholesky, Const, DMatrix, Matrix2, Matrix3, SMatrix, Vector2, Vector3};
use runtime::MotionCorrection;
use runtime::matrix::{from_rows, inverse};
use std::array::from_fn;

/// Rotations count at this arm, m: an acceleration in rad/s2 times the arm is in m/s2.
pub const ARM_M: f64 = 0.25;
/// From m/s2 and rad/s2 to m/s2, by axis.
pub const ARMS_M: [f64; 6] = [1.0, 1.0, ARM_M, 1.0, ARM_M, ARM_M];
/// Standard deviation of the lag of a probe behind the others before a log is seen, s.
pub const PROBE_LAG_S: f64 = 1e-3;
/// The same of a probe in time: a converter's sample whose instant is not known to this is refused, s.
const IN_TIME_S: f64 = 10e-6;
/// Standard deviation of a reading's change by acceleration before a log is seen, m per m/s2. A motor coil 5 cm away has
/// 7e-6, an arm with a resonance at 120 Hz 1e-6 to 4e-6.
pub const PER_ACCELERATION: f64 = 3e-6;
/// A log that leaves a smaller standard error, m per m/s2, shows what acceleration adds. Without that it is held at zero.
pub const ACCELERATION_ERROR_MAX: f64 = 1e-6;

/// Lags, and changes of the readings by acceleration.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Dynamics {
    /// Lag of the reference behind the mean of the probes, s.
    pub lag_s: f64,
    /// Lag of A, B, C behind their mean, s.
    pub probe_lag_s: [f64; 3],
    /// Change of the readings of A, B, C by the acceleration along X, Y, of Rz at [`ARM_M`], along Z, of Rx and Ry there, m
    /// per m/s2.
    pub m_per_m_s2: [[f64; 6]; 3],
}

impl Dynamics {
    /// From the values of a fit of the field model.
    pub fn from_values(values: &[f64]) -> Self {
        let [a, b] = [values[PROBE_LAGS], values[PROBE_LAGS + 1]];
        Self {
            lag_s: values[LAG],
            probe_lag_s: [a, b, -a - b],
            m_per_m_s2: [0, 1, 2].map(|probe| from_fn(|axis| values[column(probe, axis)])),
        }
    }

    /// What acceleration adds to the reading of a probe, m.
    #[inline(always)]
    pub fn added_m(&self, probe: usize, acceleration_m_s2: [f64; 6]) -> f64 {
        let pairs = self.m_per_m_s2[probe].iter().zip(acceleration_m_s2);
        pairs.fold(0.0, |sum, (by, acceleration)| sum + by * acceleration)
    }
}

/// What a log says about motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotionFit {
    /// The lags, and the changes by acceleration: zero unless the log determines them.
    pub dynamics: Dynamics,
    /// Covariance of the lags of A, B, C behind their mean, s2.
    pub probe_lag_covariance: Matrix3<f64>,
    /// Covariance of the changes of A, B, C by the acceleration of each axis, (m per m/s2)^2.
    pub acceleration_covariance: [Matrix3<f64>; 6],
    /// Whether the log shows the changes by acceleration: the limit is [`ACCELERATION_ERROR_MAX`].
    pub shows_acceleration: bool,
}

/// How fast service moves, rms.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ServiceMotion {
    /// Speed of X, Y, Rz: m/s, m/s, rad/s.
    pub speed: [f64; 3],
    /// Acceleration of X, Y, Rz, Z, Rx, Ry: m/s2, rad/s2.
    pub acceleration: [f64; 6],
}

impl MotionFit {
    /// What is known of motion before a log is seen.
    pub fn unknown() -> Self {
        Self {
            dynamics: Dynamics::default(),
            probe_lag_covariance: three_lags(lag_prior().l() * lag_prior().l().transpose()),
            acceleration_covariance: [Matrix3::identity() * (PER_ACCELERATION * PER_ACCELERATION);
                6],
            shows_acceleration: false,
        }
    }

    /// The lags of A and B behind the mean of the probes, s, with their covariance.
    pub(super) fn with_probe_lags([a, b]: [f64; 2], covariance: Matrix2<f64>) -> Self {
        Self {
            dynamics: Dynamics {
                probe_lag_s: [a, b, -a - b],
                ..Dynamics::default()
            },
            probe_lag_covariance: three_lags(covariance),
            ..Self::unknown()
        }
    }

    /// From the values and the covariance of a fit of the field model.
    pub fn new(values: &[f64], covariance: &DMatrix<f64>, shows_acceleration: bool) -> Self {
        let lags = covariance.fixed_view::<2, 2>(PROBE_LAGS, PROBE_LAGS);
        let axis_covariance =
            |axis: usize| Matrix3::from_fn(|i, k| covariance[(column(i, axis), column(k, axis))]);
        Self {
            dynamics: Dynamics::from_values(values),
            probe_lag_covariance: three_lags(lags.into()),
            acceleration_covariance: match shows_acceleration {
                true => from_fn(axis_covariance),
                false => Self::unknown().acceleration_covariance,
            },
            shows_acceleration,
        }
    }

    /// Whether a log with this covariance of its fit shows the changes by the acceleration of X, Y, Rz.
    pub(super) fn is_shown_by(covariance: &DMatrix<f64>) -> bool {
        let columns = (0..3).flat_map(|probe| [0, 1, 2].map(|axis| column(probe, axis)));
        let mut variances = columns.map(|k| covariance[(k, k)]);
        variances.all(|variance| variance < ACCELERATION_ERROR_MAX * ACCELERATION_ERROR_MAX)
    }

    /// Standard errors of the lags of A, B, C behind their mean, s.
    pub fn probe_lag_errors_s(&self) -> [f64; 3] {
        [0, 1, 2].map(|k| self.probe_lag_covariance[(k, k)].sqrt())
    }

    /// Standard errors of [`Dynamics::m_per_m_s2`].
    pub fn acceleration_errors(&self) -> [[f64; 6]; 3] {
        [0, 1, 2].map(|probe| {
            let variance = |axis: usize| self.acceleration_covariance[axis][(probe, probe)];
            from_fn(|axis| variance(axis).sqrt())
        })
    }

    /// The same with other lags of the probes, s, as well known; they count from their mean.
    #[must_use]
    pub fn with_other_lags(mut self, lag_s: [f64; 3]) -> Self {
        let mean_s = lag_s.iter().sum::<f64>() / 3.0;
        self.dynamics.probe_lag_s = lag_s.map(|lag_s| lag_s - mean_s);
        self
    }

    /// The same, where an effect of acceleration that it does not determine is zero.
    #[must_use]
    pub fn without_prior(mut self) -> Self {
        if !self.shows_acceleration {
            self.acceleration_covariance = [Matrix3::zeros(); 6];
        }
        self
    }

    /// Lags of A, B, C behind the middle probe, s: in service one late probe makes no other probe early.
    pub fn lags_behind_middle_s(&self) -> [f64; 3] {
        let mut sorted = self.dynamics.probe_lag_s;
        sorted.sort_by(f64::total_cmp);
        self.dynamics.probe_lag_s.map(|lag_s| lag_s - sorted[1])
    }

    /// The correction by commanded speed and acceleration: -G k and L. `None` unless the log shows what acceleration
    /// adds, and where the probes do not determine the pose.
    pub fn correction(&self, parameters: &FieldParameters) -> Option<MotionCorrection> {
        let (readings, poses) = jacobian(parameters).filter(|_| self.shows_acceleration)?;
        let k = |probe: usize, axis: usize| self.dynamics.m_per_m_s2[probe][axis] * ARMS_M[axis];
        let by_acceleration = -poses * SMatrix::<f64, 3, 6>::from_fn(k);
        let lags = Matrix3::from_diagonal(&self.lags_behind_middle_s().into());
        let by_speed = poses * lags * readings;
        Some(MotionCorrection {
            acceleration_s2: from_fn(|row| from_fn(|axis| by_acceleration[(row, axis)] as f32)),
            velocity_s: from_fn(|row| from_fn(|axis| by_speed[(row, axis)] as f32)),
        })
    }

    /// Second moment of the lags of A, B, C in service, s2. The probes are late, or all in time: even odds, and the
    /// evidence of the log. So a log that hardly moves does not count as a log of late probes.
    fn lag_moment(&self) -> Matrix3<f64> {
        let moment = |covariance: Matrix3<f64>, lags_s: [f64; 3]| {
            let lags_s = Vector3::from(lags_s);
            covariance + lags_s * lags_s.transpose()
        };
        let late = moment(self.probe_lag_covariance, self.lags_behind_middle_s());
        let known: Matrix2<f64> = self.probe_lag_covariance.fixed_view::<2, 2>(0, 0).into();
        let Some(known) = known.cholesky() else {
            return late;
        };
        let [a, b, _] = self.dynamics.probe_lag_s;
        let lags = Vector2::new(a, b);
        let prior = lag_prior().inverse();
        let narrow = prior * (PROBE_LAG_S / IN_TIME_S).powi(2);
        let Some(in_time) = (known.inverse() - prior + narrow).cholesky() else {
            return late;
        };
        let weighted = known.solve(&lags);
        let left = in_time.solve(&weighted);
        let squares = lags.dot(&weighted) - left.dot(&weighted);
        let widths = known.determinant() * prior.determinant() * in_time.determinant();
        let odds = (widths / narrow.determinant()).sqrt() * libm::exp(0.5 * squares);
        let is_late = 1.0 - 1.0 / (1.0 + odds);
        let [a, b] = left.into();
        late * is_late + moment(three_lags(in_time.inverse()), [a, b, -a - b]) * (1.0 - is_late)
    }

    /// Variances that motion adds to X, Y, Rz in service (m2, m2, rad2): speeds and accelerations of the axes are
    /// independent. The correction leaves the errors of the fit. `None` where the probes do not determine the pose.
    pub fn variance(
        &self,
        parameters: &FieldParameters,
        motion: &ServiceMotion,
        is_corrected: bool,
    ) -> Option<[f64; 3]> {
        let (readings, poses) = jacobian(parameters)?;
        let left = if is_corrected { 0.0 } else { 1.0 };
        let second_moment = |covariance: Matrix3<f64>, known: [f64; 3]| {
            let known = left * Vector3::from(known);
            covariance + known * known.transpose()
        };
        let mut sum = Matrix3::zeros();
        for (axis, acceleration) in motion.acceleration.into_iter().enumerate() {
            let known = self.dynamics.m_per_m_s2.map(|by| by[axis]);
            let k = second_moment(self.acceleration_covariance[axis], known);
            sum += poses * k * poses.transpose() * (ARMS_M[axis] * acceleration).powi(2);
        }
        let lags = match is_corrected {
            true => self.probe_lag_covariance,
            false => self.lag_moment(),
        };
        for (axis, speed) in motion.speed.into_iter().enumerate() {
            // J^-1 diag(J v): what a lag of each probe does to the pose.
            let by_lag = poses * Matrix3::from_diagonal(&readings.column(axis).into_owned());
            sum += by_lag * lags * by_lag.transpose() * (speed * speed);
        }
        Some([0, 1, 2].map(|axis| sum[(axis, axis)]))
    }
}

/// Factor of the prior covariance of the lags of A and B behind the mean of the probes: the lags of the three are
/// independent, with the deviation [`PROBE_LAG_S`].
pub(super) fn lag_prior() -> Cholesky<f64, Const<2>> {
    // L L' = (2, -1; -1, 2) / 3.
    let [a, b, c] = [2.0 / 3.0, 1.0 / 6.0, 0.5].map(f64::sqrt);
    Cholesky::pack_dirty(Matrix2::new(a, 0.0, -b, c) * PROBE_LAG_S)
}

/// The unknown of a fit for a probe and the acceleration of an axis.
const fn column(probe: usize, axis: usize) -> usize {
    ACCELERATIONS + 6 * probe + axis
}

/// The covariance of the lags of A, B, C from the covariance of A and B: their sum is zero.
fn three_lags(two: Matrix2<f64>) -> Matrix3<f64> {
    let by_two = SMatrix::<f64, 3, 2>::new(1.0, 0.0, 0.0, 1.0, -1.0, -1.0);
    by_two * two * by_two.transpose()
}

/// The readings by the pose at rest, and the pose by the readings.
fn jacobian(parameters: &FieldParameters) -> Option<(Matrix3<f64>, Matrix3<f64>)> {
    let probes = probes(parameters);
    let readings = from_rows(&probes.map(|probe| probe.read([0.0; 3], [0.0; 3]).by_pose));
    Some((readings, inverse(&readings)?))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Lags of which the log leaves this deviation, against their squares alone.
    fn counted(deviation_s: f64) -> f64 {
        let covariance = Matrix2::identity() * deviation_s.powi(2);
        let fit = MotionFit::with_probe_lags([4e-4, -2e-4], covariance);
        fit.lag_moment()[(0, 0)] / 6e-4_f64.powi(2)
    }

    #[test]
    fn lags_that_a_log_shows_count_in_full_and_others_little() {
        assert!((counted(1e-5) - 1.0).abs() < 1e-3);
        assert!(counted(3e-4) < 0.5);
        let in_time = MotionFit::with_probe_lags([0.0; 2], Matrix2::identity() * 1e-10);
        assert!(in_time.lag_moment()[(0, 0)] < 1e-10);
    }
}
