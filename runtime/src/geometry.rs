//! Where the Hall probes sit and how they are turned: the plane matrix PM (equations 11, 32).
//!
//! A probe at p that senses along the unit vector u reads u . (q + Rz x p) for a motion
//! q = (X, Y) and a small Rz. So a row of PM is u and the lever arm u_y p_x - u_x p_y.
//!
//! theta is the angle of u, counterclockwise, from +Y for A and B and from +X for C. In the
//! paper's stage these are the designed directions and theta is the misalignment. A stage
//! whose probes are mounted in other directions has other designed thetas: 180 degrees for a
//! probe mounted the other way round. Nothing else depends on the direction, so a blob
//! stores theta as it is here, and needs no entry for the designed directions.
//!
//! Two coordinates of a probe enter PM only through its lever arm, so no data can separate them
//! A calibration holds lever arms and thetas; places are kept only as designed values.
//!
//! Everything here runs on any [`Number`], so that the target's `f32`, the host's `f64` and
//! the lanes of a SIMD register use the same functions. Sums and products are written out:
//! closures over arrays are not always inlined, and would then go through memory.

use crate::real::Number;
#[cfg(feature = "host")]
use crate::real::Real;

/// Lever arms and angles of the probes A, B, C: all that PM depends on.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ProbeGeometry<T> {
    /// Third column of PM: displacement along the sensing axis per rad of Rz, m.
    pub lever_arm_m: [T; 3],
    /// theta: angle of each sensing axis from +Y (A, B) or +X (C), rad.
    pub misalignment_rad: [T; 3],
}

/// Unit vectors (x, y) along which the probes A, B, C sense: the rows of PM without the arms.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SensingAxes<T>(pub [[T; 2]; 3]);

impl<T: Number> SensingAxes<T> {
    /// The axes at the given thetas.
    #[inline(always)]
    pub fn at(misalignment_rad: [T; 3]) -> Self {
        let [a, b, c] = misalignment_rad;
        let ((sin_a, cos_a), (sin_b, cos_b), (sin_c, cos_c)) =
            (a.sin_cos(), b.sin_cos(), c.sin_cos());
        Self([[-sin_a, cos_a], [-sin_b, cos_b], [cos_c, sin_c]])
    }

    /// The derivative of each axis by its theta, per rad. It is also the unit vector
    /// across the axis: the axis turned by a right angle.
    #[inline(always)]
    pub fn across(&self) -> [[T; 2]; 3] {
        let [a, b, c] = self.0;
        [[-a[1], a[0]], [-b[1], b[0]], [-c[1], c[0]]]
    }

    /// The derivatives of each lever arm by x and y of its probe.
    #[inline(always)]
    pub fn arm_factors(&self) -> [[T; 2]; 3] {
        let [a, b, c] = self.0;
        [[a[1], -a[0]], [b[1], -b[0]], [c[1], -c[0]]]
    }

    /// Lever arms of probes at these places (x, y): the third column of PM (equation 11), m.
    #[inline(always)]
    pub fn lever_arms_m(&self, places_m: [[T; 2]; 3]) -> [T; 3] {
        let [a, b, c] = self.arm_factors();
        let [at_a, at_b, at_c] = places_m;
        [
            a[0] * at_a[0] + a[1] * at_a[1],
            b[0] * at_b[0] + b[1] * at_b[1],
            c[0] * at_c[0] + c[1] * at_c[1],
        ]
    }

    /// The rows of PM (equations 11, 32): displacement sensed by A, B, C, in m, per
    /// (m, m, rad) of (X, Y, Rz).
    #[inline(always)]
    pub fn plane_rows(&self, lever_arm_m: [T; 3]) -> [[T; 3]; 3] {
        let [a, b, c] = self.0;
        let [arm_a, arm_b, arm_c] = lever_arm_m;
        [
            [a[0], a[1], arm_a],
            [b[0], b[1], arm_b],
            [c[0], c[1], arm_c],
        ]
    }
}

impl SensingAxes<f32> {
    /// The axes that rows of PM hold, and the lever arms in them, m: the inverse of
    /// [`SensingAxes::plane_rows`].
    pub const fn of_rows(rows: &[[f32; 3]; 3]) -> (Self, [f32; 3]) {
        let [[ax, ay, arm_a], [bx, by, arm_b], [cx, cy, arm_c]] = *rows;
        (Self([[ax, ay], [bx, by], [cx, cy]]), [arm_a, arm_b, arm_c])
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

impl<T: Number> ProbeGeometry<T> {
    /// The geometry of probes that stand at these places (x, y).
    pub fn of_places(places_m: [[T; 2]; 3], misalignment_rad: [T; 3]) -> Self {
        Self {
            lever_arm_m: SensingAxes::at(misalignment_rad).lever_arms_m(places_m),
            misalignment_rad,
        }
    }

    /// The rows of PM (equations 11, 32): displacement sensed by A, B, C, in m, per
    /// (m, m, rad) of (X, Y, Rz).
    pub fn plane_rows(&self) -> [[T; 3]; 3] {
        SensingAxes::at(self.misalignment_rad).plane_rows(self.lever_arm_m)
    }
}

/// The inverse of a 3x3 matrix by its adjugate, in a written order, and its determinant.
/// Where that is zero, the inverse is not finite.
#[inline(always)]
pub fn inverse_and_determinant<T: Number>(m: &[[T; 3]; 3]) -> ([[T; 3]; 3], T) {
    let [[a, b, c], [d, e, f], [g, h, i]] = *m;
    let cofactor_a = e * i - f * h;
    let cofactor_b = f * g - d * i;
    let cofactor_c = d * h - e * g;
    let determinant = (a * cofactor_a + b * cofactor_b) + c * cofactor_c;
    let r = T::ONE / determinant;
    let inverse = [
        [cofactor_a * r, (c * h - b * i) * r, (b * f - c * e) * r],
        [cofactor_b * r, (a * i - c * g) * r, (c * d - a * f) * r],
        [cofactor_c * r, (b * g - a * h) * r, (a * e - b * d) * r],
    ];
    (inverse, determinant)
}

/// The inverse of a 3x3 matrix by its adjugate; `None` when the determinant is zero,
/// subnormal (as `f32`) or not finite.
#[cfg(feature = "host")]
pub fn inverse_rows<T: Real>(m: &[[T; 3]; 3]) -> Option<[[T; 3]; 3]> {
    let (inverse, determinant) = inverse_and_determinant(m);
    let size = determinant.to_f64().abs();
    (size.is_finite() && size > f64::from(f32::MIN_POSITIVE)).then_some(inverse)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::dot;
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
                let rows = ProbeGeometry::of_places([place; 3], theta).plane_rows();
                for (k, row) in rows.iter().enumerate() {
                    let standard = if k < 2 { half_turn / 2.0 } else { 0.0 };
                    let axis = ((standard + theta[k]).cos(), (standard + theta[k]).sin());
                    let [x, y, rz] = [3e-4, -2e-4, 1e-4];
                    let moved = (x - rz * place[1], y + rz * place[0]);
                    let expected = axis.0 * moved.0 + axis.1 * moved.1;
                    let read = row[0] * x + row[1] * y + row[2] * rz;
                    assert!((read - expected).abs() < 1e-18, "probe {k}");
                }
            }
        }
    }

    proptest! {
        #[test]
        fn inverse_times_matrix_is_identity(t in prop::array::uniform3(-0.14..0.14f64),
                                            arms in prop::array::uniform3(0.1..0.5f64)) {
            let geometry = ProbeGeometry { lever_arm_m: [arms[0], -arms[1], -arms[2]], misalignment_rad: t };
            let rows = geometry.plane_rows();
            let inverse = inverse_rows(&rows).expect("a sound geometry");
            for (i, row) in inverse.iter().enumerate() {
                for j in 0..3 {
                    let product = dot(row, rows.map(|row| row[j]));
                    prop_assert!((product - f64::from(u8::from(i == j))).abs() < 1e-12);
                }
            }
        }

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
        fn misalignments_and_arms_can_be_read_from_the_rows_of_pm(t in prop::array::uniform3(-3.1..3.1f32),
                                                                  arms in prop::array::uniform3(-0.5..0.5f32)) {
            let rows = SensingAxes::at(t).plane_rows(arms);
            let (axes, found) = SensingAxes::of_rows(&rows);
            prop_assert_eq!(found, arms);
            for (have, want) in axes.misalignment_rad().iter().zip(t) { prop_assert!((have - want).abs() < 3e-7); }
        }
    }

    #[test]
    fn a_singular_matrix_has_no_inverse() {
        assert_eq!(
            inverse_rows(&[[1.0f64, 2.0, 3.0], [2.0, 4.0, 6.0], [0.0, 1.0, 0.0]]),
            None
        );
        assert_eq!(inverse_rows(&[[f32::NAN; 3]; 3]), None);
    }
}
