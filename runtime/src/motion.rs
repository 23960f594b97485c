//! Errors of a moving stage that follow its commanded velocity and acceleration.
//!
//! A late probe, the stray field of a motor coil and an arm that bends change the signals of the probes
//! A, B, C: s_i = f_i + k_i . a - tau_i ds_i/dt. The corrected pose is
//!
//! q' = q + A a + L v,
//!
//! A = -PM^-1 diag(1/eta) K, L = PM^-1 diag(tau - mean tau) PM,
//!
//! where v is the velocity of (X, Y, Rz), a the acceleration of (X, Y, Rz, Z, Rx, Ry), and K has the rows k_i.
//! The host computes A and L.
//!
//! The trajectory generator gives v and a, for the instant of the pose. Derivatives of measured poses are
//! too late or too noisy. The README shows the cost of a late command.
//!
//! ```
//! use runtime::motion::{MotionCorrection, CommandedMotion};
//! use runtime::PlanarPose;
//!
//! // All probes read X 7 um too large per m/s2.
//! let mut correction = MotionCorrection::default();
//! correction.acceleration_s2[0][0] = -7e-6;
//! let pose = PlanarPose { x_m: 14e-6, y_m: 0.0, rz_rad: 0.0 };
//! let commanded = CommandedMotion { velocity: [0.0; 3], acceleration: [2.0, 0.0, 0.0, 0.0, 0.0, 0.0] };
//! assert_eq!(correction.correct(pose, &commanded), Some(PlanarPose::ZERO));
//! ```

use crate::pose::PlanarPose;

/// A and L of a stage: q' = q + A a + L v.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C)]
pub struct MotionCorrection {
    /// A: rows X, Y, Rz in m, m, rad per m/s2 or rad/s2 of the acceleration of X, Y, Rz, Z, Rx, Ry.
    pub acceleration_s2: [[f32; 6]; 3],
    /// L: rows X, Y, Rz in m, m, rad per m/s or rad/s of the velocity of X, Y, Rz.
    pub velocity_s: [[f32; 3]; 3],
}

/// Commanded velocity and acceleration at the instant of a pose.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C)]
pub struct CommandedMotion {
    /// Of X, Y, Rz: m/s, m/s, rad/s.
    pub velocity: [f32; 3],
    /// Of X, Y, Rz, Z, Rx, Ry: m/s2, m/s2, rad/s2, m/s2, rad/s2, rad/s2.
    pub acceleration: [f32; 6],
}

impl MotionCorrection {
    /// The pose without the errors that follow the commanded motion: q + A a + L v, m, m, rad.
    /// Without branch or loop.
    ///
    /// `None` for a result that is not finite: pose or command hold a NaN or an infinity.
    #[inline(always)]
    #[expect(clippy::eq_op, reason = "a number less itself is 0 or NaN")]
    pub fn correct(
        &self,
        pose: PlanarPose<f32>,
        commanded: &CommandedMotion,
    ) -> Option<PlanarPose<f32>> {
        let v = commanded.velocity;
        let [a_x, a_y, a_rz, a_z, a_rx, a_ry] = commanded.acceleration;
        let corrected = |x, [by_x, by_y, by_rz, by_z, by_rx, by_ry]: [f32; 6], by_v| {
            let x = plus_dot(x, [by_x, by_y, by_rz], [a_x, a_y, a_rz]);
            plus_dot(
                plus_dot(x, [by_z, by_rx, by_ry], [a_z, a_rx, a_ry]),
                by_v,
                v,
            )
        };
        let [by_a_x, by_a_y, by_a_rz] = self.acceleration_s2;
        let [by_v_x, by_v_y, by_v_rz] = self.velocity_s;
        let x_m = corrected(pose.x_m, by_a_x, by_v_x);
        let y_m = corrected(pose.y_m, by_a_y, by_v_y);
        let rz_rad = corrected(pose.rz_rad, by_a_rz, by_v_rz);
        // 0 if all three are finite, else NaN. Asked of its bits, this is no branch.
        let sum = (x_m + y_m) + rz_rad;
        let is_finite = (sum - sum).to_bits() == 0;
        is_finite.then_some(PlanarPose { x_m, y_m, rz_rad })
    }
}

/// A number and the product of a row and a column of three, summed from the left: a core with a
/// multiply-and-add needs three instructions.
#[inline(always)]
fn plus_dot(x: f32, row: [f32; 3], column: [f32; 3]) -> f32 {
    ((x + row[0] * column[0]) + row[1] * column[1]) + row[2] * column[2]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::matrix::{inverse, to_rows};
    use crate::sample::{self, MOTION};
    use nalgebra::{Matrix3, Matrix3x6, Vector3, Vector6};
    use proptest::prelude::*;

    /// Probes that are late by tau and add k a, on a stage in uniformly accelerated motion: the
    /// corrected pose is the true one, but for a lag that all probes share.
    #[test]
    fn late_probes_and_a_coil_are_corrected() {
        let plane = sample::calibration().geometry.plane();
        let plane_inverse = inverse(&plane).expect("a sound stage");
        let eta = Matrix3::from_diagonal(&Vector3::new(0.87, 0.7, 0.86));
        let decode = plane_inverse * inverse(&eta).expect("a sound stage");
        let tau = Matrix3::from_diagonal(&Vector3::new(3e-4, -1e-4, -2e-4));
        #[rustfmt::skip]
        let k = Matrix3x6::new(
            7e-6, 1e-6, 0.0, 2e-6, 1e-6, -4e-7,
            0.0, -2e-6, 5e-7, 6e-6, -7e-7, 0.0,
            -3e-6, 0.0, 1e-6, -4e-6, 0.0, 9e-7,
        );
        let by_a = -decode * k;
        let by_v = plane_inverse * tau * plane;
        let correction = MotionCorrection {
            acceleration_s2: [0, 1, 2]
                .map(|row| by_a.row(row).transpose().map(|x| x as f32).into()),
            velocity_s: to_rows(&by_v.map(|x| x as f32)),
        };
        let v = Vector3::new(6e-3, -9e-3, 4e-3);
        let a = Vector6::new(1.2, -0.8, 1.5, 0.7, -2.0, 1.8);
        let q = Vector3::new(3e-4, -2e-4, 1e-4);
        let signals = eta * (plane * q - tau * plane * v) + k * a;
        let decoded = decode * signals;
        let pose = |q: Vector3<f64>| PlanarPose::from_array(q.map(|x| x as f32).into());
        let commanded = CommandedMotion {
            velocity: v.map(|x| x as f32).into(),
            acceleration: a.map(|x| x as f32).into(),
        };
        assert!((decoded - q).amax() > 5e-6);
        let corrected = correction
            .correct(pose(decoded), &commanded)
            .expect("finite");
        for (have, want) in corrected.to_array().into_iter().zip(pose(q).to_array()) {
            assert!((have - want).abs() < 1e-10, "{have:e} {want:e}");
        }
    }

    proptest! {
        /// Whatever comes in, what leaves is finite.
        #[test]
        fn a_command_or_a_pose_that_is_not_finite_gives_no_pose(
            at in 0..12usize,
            bad in prop::sample::select(&[f32::NAN, f32::INFINITY, f32::NEG_INFINITY][..]),
            numbers in prop::array::uniform12(-1.0..1.0f32),
        ) {
            let of = |[x, y, rz, a, b, c, acceleration @ ..]: [f32; 12]| {
                let commanded = CommandedMotion { velocity: [a, b, c], acceleration };
                MOTION.correct(PlanarPose::from_array([x, y, rz]), &commanded)
            };
            prop_assert!(of(numbers).is_some());
            let mut numbers = numbers;
            numbers[at] = bad;
            prop_assert_eq!(of(numbers), None);
        }
    }
}
