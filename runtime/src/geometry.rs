//! Where the Hall probes sit and how they are turned: the plane matrix PM (equations 11, 32).
//!
//! A probe at p that senses along the unit vector u reads u . (q + Rz x p) for a motion
//! q = (X, Y) and a small Rz. So a row of PM is u and the lever arm u_y p_x - u_x p_y.
//!
//! theta is the angle of u, counterclockwise, from +Y for A and B and from +X for C. In the
//! paper's stage these are the designed directions and theta is the misalignment. A stage
//! with probes in other directions has other designed thetas: 180 degrees for a probe
//! mounted the other way round. Only theta depends on the direction, so a blob stores this
//! theta, and needs no entry for the designed directions.
//!
//! Two coordinates of a probe enter PM only through its lever arm, so no data can separate them.
//! A calibration holds lever arms and thetas; places are kept only as designed values.

use crate::real::Real;
use nalgebra::{Matrix3, Vector2};

/// Lever arms and angles of the probes A, B, C: all that PM depends on.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ProbeGeometry<T> {
    /// Third column of PM: displacement along the sensing axis per rad of Rz, m.
    pub lever_arm_m: [T; 3],
    /// theta: angle of each sensing axis from +Y (A, B) or +X (C), rad.
    pub misalignment_rad: [T; 3],
}

/// Unit vectors u = (x, y) along which the probes A, B, C sense: the rows of PM without the arms.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SensingAxes<T>(pub [[T; 2]; 3]);

impl<T: Real> SensingAxes<T> {
    /// The axes at the given thetas.
    #[inline(always)]
    pub fn at(misalignment_rad: [T; 3]) -> Self {
        let [(sin_a, cos_a), (sin_b, cos_b), (sin_c, cos_c)] = misalignment_rad.map(T::sin_cos);
        Self([[-sin_a, cos_a], [-sin_b, cos_b], [cos_c, sin_c]])
    }

    /// The derivative of each axis by its theta, per rad. It is also the unit vector
    /// across the axis: the axis turned by a right angle.
    #[cfg(feature = "host")]
    #[inline(always)]
    pub fn across(&self) -> [[T; 2]; 3] {
        self.0.map(|[x, y]| [-y, x])
    }

    /// The derivatives (u_y, -u_x) of each lever arm by x and y of its probe.
    #[inline(always)]
    pub fn arm_factors(&self) -> [[T; 2]; 3] {
        self.0.map(|[x, y]| [y, -x])
    }

    /// Lever arms of probes at these places (x, y): the third column of PM (equation 11), m.
    #[inline(always)]
    pub fn lever_arms_m(&self, places_m: [[T; 2]; 3]) -> [T; 3] {
        let [a, b, c] = self.arm_factors().map(Vector2::from);
        let [at_a, at_b, at_c] = places_m.map(Vector2::from);
        [a.dot(&at_a), b.dot(&at_b), c.dot(&at_c)]
    }

    /// PM (equations 11, 32): displacement sensed by A, B, C, in m, per (m, m, rad) of
    /// (X, Y, Rz).
    #[inline(always)]
    pub fn plane(&self, lever_arm_m: [T; 3]) -> Matrix3<T> {
        let [a, b, c] = self.0;
        let [arm_a, arm_b, arm_c] = lever_arm_m;
        #[rustfmt::skip]
        let plane = Matrix3::new(
            a[0], a[1], arm_a,
            b[0], b[1], arm_b,
            c[0], c[1], arm_c,
        );
        plane
    }
}

impl SensingAxes<f32> {
    /// The axes and the lever arms, m, in PM: the inverse of [`SensingAxes::plane`].
    pub fn from_plane(plane: &Matrix3<f32>) -> (Self, [f32; 3]) {
        let [[ax, bx, cx], [ay, by, cy], arms]: [[f32; 3]; 3] = (*plane).into();
        (Self([[ax, ay], [bx, by], [cx, cy]]), arms)
    }

    /// theta of each axis, -pi to pi, whatever its length: the inverse of
    /// [`SensingAxes::at`]. By `libm` in `f32` alone; its sine and cosine would take 7 KB of a
    /// Cortex-M4F's flash, for they use `f64`.
    pub fn misalignment_rad(&self) -> [f32; 3] {
        let [a, b, c] = self.0;
        [
            libm::atan2f(-a[0], a[1]),
            libm::atan2f(-b[0], b[1]),
            libm::atan2f(c[1], c[0]),
        ]
    }
}

impl<T: Real> ProbeGeometry<T> {
    /// The geometry of probes that stand at these places (x, y).
    pub fn from_places(places_m: [[T; 2]; 3], misalignment_rad: [T; 3]) -> Self {
        Self {
            lever_arm_m: SensingAxes::at(misalignment_rad).lever_arms_m(places_m),
            misalignment_rad,
        }
    }

    /// PM (equations 11, 32): displacement sensed by A, B, C, in m, per (m, m, rad) of
    /// (X, Y, Rz).
    pub fn plane(&self) -> Matrix3<T> {
        SensingAxes::at(self.misalignment_rad).plane(self.lever_arm_m)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;
    use proptest::prelude::*;

    /// The places of the paper's stage.
    const PLACES_M: [[f64; 2]; 3] = [[0.1975, 0.40], [-0.1975, 0.42], [0.1975, 0.36]];

    /// A rigid body turned by a small Rz moves a probe at p by Rz x p. Worked from vectors,
    /// not from equation 11.
    #[test]
    fn a_probe_reads_the_sensed_part_of_a_rigid_motion_wherever_it_stands_and_points() {
        let half_turn = core::f64::consts::PI;
        for theta in [[0.03, -0.05, 0.08], [half_turn, 1.9, 0.5 - half_turn]] {
            for place in [[0.4, -0.1], [0.1, 0.3]] {
                let [x, y, rz] = [3e-4, -2e-4, 1e-4];
                let plane = ProbeGeometry::from_places([place; 3], theta).plane();
                let read = plane * Vector3::new(x, y, rz);
                for (k, read) in read.iter().enumerate() {
                    let standard = if k < 2 { half_turn / 2.0 } else { 0.0 };
                    let axis = ((standard + theta[k]).cos(), (standard + theta[k]).sin());
                    let moved = (x - rz * place[1], y + rz * place[0]);
                    let expected = axis.0 * moved.0 + axis.1 * moved.1;
                    assert!((read - expected).abs() < 1e-18, "probe {k}");
                }
            }
        }
    }

    proptest! {
        /// Derivatives by differences: of the axes by the misalignment, of the arms by the coordinates.
        #[test]
        fn derivatives_are_those_of_axes_and_arms(t in prop::array::uniform3(-0.14..0.14f64)) {
            let (axes, step) = (SensingAxes::at(t), 1e-6);
            let (ahead, back) = (SensingAxes::at(t.map(|t| t + step)), SensingAxes::at(t.map(|t| t - step)));
            for probe in 0..3 {
                for part in 0..2 {
                    let slope = (ahead.0[probe][part] - back.0[probe][part]) / (2.0 * step);
                    prop_assert!((axes.across()[probe][part] - slope).abs() < 1e-9);
                    let mut moved = PLACES_M;
                    moved[probe][part] += 1.0;
                    let gain = axes.lever_arms_m(moved)[probe] - axes.lever_arms_m(PLACES_M)[probe];
                    prop_assert!((axes.arm_factors()[probe][part] - gain).abs() < 1e-14);
                }
            }
        }

        #[test]
        fn misalignments_and_arms_can_be_read_from_pm(t in prop::array::uniform3(-3.1..3.1f32),
                                                      arms in prop::array::uniform3(-0.5..0.5f32)) {
            let (axes, found) = SensingAxes::from_plane(&SensingAxes::at(t).plane(arms));
            prop_assert_eq!(found, arms);
            for (have, want) in axes.misalignment_rad().iter().zip(t) { prop_assert!((have - want).abs() < 3e-7); }
        }
    }
}
