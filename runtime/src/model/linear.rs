//! Models (12), (15), (30) and (31) of the paper.
//!
//! With s the displacement read by a probe (designed scale), v = (Z, Rx, Ry) the vertical
//! pose and delta the zero deviation of a movement:
//!
//! | model | pose (X, Y, Rz) | equation |
//! |---|---|---|
//! | (12) | PM^-1 s | 12 |
//! | (15) | PM^-1 (s / eta) | 15 |
//! | (30) | PM^-1 ((s - delta) / eta) | 30 |
//! | (31) | PM^-1 (s / phi(v) - delta / phi(0)), phi(v) = eta + a Z + b Rx + c Ry | 31, 33 |
//!
//! Each is a special case of (31): a = b = c = 0 gives (30), and delta = 0 then gives (15),
//! and eta = 1 gives (12). So one function decodes them all, and in service, where delta is
//! zero or what a re-zero measured, the models differ only in their constants.

use super::{Model, apply_gain, dot_less};
use crate::pose::{PlanarPose, VerticalPose};
use crate::real::Real;
use nalgebra::{Matrix3, Vector3};

/// Models (12), (15), (30) and (31): phi is linear in the vertical pose (equation 33), and
/// the pose is linear in signal / phi.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LinearModel {}

impl Model for LinearModel {
    type Probe<T: Real> = Sensitivity<T>;

    #[inline(always)]
    fn planar_pose<T: Real>(
        probes: &[Sensitivity<T>; 3],
        pose_rows: &[[T; 3]; 3],
        signal: [T; 3],
        gain_change: [T; 3],
        vertical: &VerticalPose<T>,
        zero: &PlanarPose<T>,
    ) -> ([T; 3], PlanarPose<T>) {
        let phi = [
            apply_gain(sensitivity_at(&probes[0], vertical), gain_change[0]),
            apply_gain(sensitivity_at(&probes[1], vertical), gain_change[1]),
            apply_gain(sensitivity_at(&probes[2], vertical), gain_change[2]),
        ];
        (phi, planar_pose(pose_rows, signal, phi, zero))
    }
}

/// Sensitivity of one probe and its change with the vertical pose (equation 33).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C)]
pub struct Sensitivity<T> {
    /// eta: sensitivity at the zero of the vertical pose, relative to the designed one.
    pub eta: T,
    /// a: its change per m of Z, 1/m.
    pub per_z_m: T,
    /// b: its change per rad of Rx, 1/rad.
    pub per_rx_rad: T,
    /// c: its change per rad of Ry, 1/rad.
    pub per_ry_rad: T,
}

impl<T: Real> Sensitivity<T> {
    /// A sensitivity that does not depend on the vertical pose (Models (15), (30)).
    pub const fn constant(eta: T) -> Self {
        Self {
            eta,
            per_z_m: T::ZERO,
            per_rx_rad: T::ZERO,
            per_ry_rad: T::ZERO,
        }
    }

    /// Each coefficient as another type of number, rounded to the nearest.
    #[must_use]
    pub fn rounded<U: Real>(&self) -> Sensitivity<U> {
        let round = |x: T| U::from_f64(x.to_f64());
        Sensitivity {
            eta: round(self.eta),
            per_z_m: round(self.per_z_m),
            per_rx_rad: round(self.per_rx_rad),
            per_ry_rad: round(self.per_ry_rad),
        }
    }
}

/// phi: sensitivity of one probe at a vertical pose (equation 33).
#[inline(always)]
pub fn sensitivity_at<T: Real>(probe: &Sensitivity<T>, vertical: &VerticalPose<T>) -> T {
    ((probe.eta + probe.per_z_m * vertical.z_m) + probe.per_rx_rad * vertical.rx_rad)
        + probe.per_ry_rad * vertical.ry_rad
}

/// The planar pose of equations 12, 15, 30 and 31: `pose_rows` (rows X, Y, Rz of PM^-1, with
/// the scale of `signal` in them) times signal / phi, less `zero`.
///
/// `zero` is the zero deviation as a pose, PM^-1 (delta / eta); see [`zero_pose`].
#[inline(always)]
pub fn planar_pose<T: Real>(
    pose_rows: &[[T; 3]; 3],
    signal: [T; 3],
    phi: [T; 3],
    zero: &PlanarPose<T>,
) -> PlanarPose<T> {
    let ratio = [signal[0] / phi[0], signal[1] / phi[1], signal[2] / phi[2]];
    PlanarPose {
        x_m: dot_less(&pose_rows[0], ratio, zero.x_m),
        y_m: dot_less(&pose_rows[1], ratio, zero.y_m),
        rz_rad: dot_less(&pose_rows[2], ratio, zero.rz_rad),
    }
}

/// The zero deviation `delta_m` of the probes as a pose: PM^-1 (delta / eta), the last
/// term of equation 31.
pub fn zero_pose<T: Real>(
    plane_inverse: &Matrix3<T>,
    eta: [T; 3],
    delta_m: [T; 3],
) -> PlanarPose<T> {
    let ratio = Vector3::from(delta_m).component_div(&Vector3::from(eta));
    PlanarPose::from_array((plane_inverse * ratio).into())
}

/// The zero deviation delta = eta * (PM o), in m at each probe, of a pose offset o:
/// the inverse of [`zero_pose`].
pub fn zero_deviation_m<T: Real>(
    plane: &Matrix3<T>,
    eta: [T; 3],
    offset: &PlanarPose<T>,
) -> [T; 3] {
    let read = plane * Vector3::from(offset.to_array());
    Vector3::from(eta).component_mul(&read).into()
}

/// The forward model: the displacement that each probe reads at a pose, in m,
/// s = phi(v) (PM q + delta / eta). The inverse of Model (31).
pub fn probe_displacement_m<T: Real>(
    plane: &Matrix3<T>,
    sensitivity: &[Sensitivity<T>; 3],
    planar: &PlanarPose<T>,
    vertical: &VerticalPose<T>,
    delta_m: [T; 3],
) -> [T; 3] {
    let moved = plane * Vector3::from(planar.to_array());
    [0, 1, 2].map(|k| {
        let probe = &sensitivity[k];
        sensitivity_at(probe, vertical) * (moved[k] + delta_m[k] / probe.eta)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::ProbeGeometry;
    use crate::matrix::{from_rows, inverse, to_rows};
    use proptest::prelude::*;

    fn probe(eta: f64, a: f64, b: f64, c: f64) -> Sensitivity<f64> {
        Sensitivity {
            eta,
            per_z_m: a,
            per_rx_rad: b,
            per_ry_rad: c,
        }
    }

    proptest! {
        /// Equation 31 undoes the forward model at any pose, sensitivity and zero deviation.
        #[test]
        fn decoding_undoes_the_forward_model(
            q in prop::array::uniform3(-1e-3..1e-3f64),
            v in prop::array::uniform3(-5e-4..5e-4f64),
            delta in prop::array::uniform3(-1e-5..1e-5f64),
            t in prop::array::uniform3(-0.14..0.14f64),
        ) {
            let geometry = ProbeGeometry { lever_arm_m: [0.19, -0.21, -0.34], misalignment_rad: t };
            let plane = geometry.plane();
            let inverse = inverse(&plane).expect("sound");
            let probes = [probe(0.87, -190.0, -70.0, 15.0), probe(0.70, -160.0, -57.0, -55.0), probe(0.86, -180.0, -63.0, 13.0)];
            let vertical = VerticalPose::from_array(v);
            let s = probe_displacement_m(&plane, &probes, &PlanarPose::from_array(q), &vertical, delta);
            let phi = [0, 1, 2].map(|k| sensitivity_at(&probes[k], &vertical));
            let zero = zero_pose(&inverse, probes.map(|p| p.eta), delta);
            let back = planar_pose(&to_rows(&inverse), s, phi, &zero).to_array();
            for (have, want) in back.iter().zip(q) { prop_assert!((have - want).abs() < 1e-16); }
            let deviation = zero_deviation_m(&plane, probes.map(|p| p.eta), &zero);
            for (have, want) in deviation.iter().zip(delta) { prop_assert!((have - want).abs() < 1e-18); }
        }
    }

    /// Worked by hand: aligned probes, arms 0.2, -0.2, -0.4 m, eta 1/2, a Z = 1/2 on probe A.
    #[test]
    fn model_31_gives_a_pose_worked_by_hand() {
        let plane = from_rows(&[[0.0, 1.0, 0.2], [0.0, 1.0, -0.2], [1.0, 0.0, -0.4]]);
        let inverse = inverse(&plane).expect("sound");
        let vertical = VerticalPose {
            z_m: 2.5e-4,
            rx_rad: 0.0,
            ry_rad: 0.0,
        };
        let a = sensitivity_at(&probe(0.5, 2000.0, 7.0, 9.0), &vertical);
        assert_eq!(a, 1.0);
        // A reads 40 um at phi 1, B 10 um at phi 1/2 (20 um), C 5 um at phi 1/2 (10 um):
        // Rz = (40 - 20) um / 0.4 m = 50 urad, Y = 30 um, X = 10 um + 0.4 m * 50 urad = 30 um.
        let pose = planar_pose::<f64>(
            &to_rows(&inverse),
            [40e-6, 10e-6, 5e-6],
            [1.0, 0.5, 0.5],
            &PlanarPose::ZERO,
        );
        assert!((pose.x_m - 30e-6).abs() < 1e-18);
        assert!((pose.y_m - 30e-6).abs() < 1e-18);
        assert!((pose.rz_rad - 50e-6).abs() < 1e-18);
    }
}
