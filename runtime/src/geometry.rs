//! Where the Hall probes sit and how they are turned: the plane matrix PM (equations 11, 32).
//!
//! A probe at p that senses along the unit vector u reads u . (q + Rz x p) for a motion
//! q = (X, Y) and a small Rz. So a row of PM is u and the lever arm u_y p_x - u_x p_y. Aligned,
//! A and B sense +Y and C senses +X; a misalignment turns them counterclockwise.
//!
//! The six coordinates enter PM only through three lever arms, its third column. `H1x` and
//! `H1y` cannot be told apart by any data, nor can the other pairs, so a calibration holds
//! lever arms and misalignments; coordinates are kept only as designed values.
//!
//! Everything here runs on any [`Number`], so that the target's `f32`, the host's `f64` and
//! the lanes of a SIMD register use the same functions. Sums and products are written out:
//! closures over arrays are not always inlined, and would then go through memory.

use crate::real::{Number, Real};
use nalgebra::Matrix3;

/// Coordinates of the Hall probes in the stage's frame, with the paper's signs:
/// A at (`h1x`, `h1y`), B at (-`h2x`, `h2y`), C at (`h3x`, `h3y`). All in m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProbeCoordinates<T> {
    /// H1x, m.
    pub h1x_m: T,
    /// H1y, m.
    pub h1y_m: T,
    /// H2x, m (probe B sits at -H2x).
    pub h2x_m: T,
    /// H2y, m.
    pub h2y_m: T,
    /// H3x, m.
    pub h3x_m: T,
    /// H3y, m.
    pub h3y_m: T,
}

/// Lever arms and misalignments of the probes A, B, C: all that PM depends on.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ProbeGeometry<T> {
    /// Third column of PM: displacement along the sensing axis per rad of Rz, m.
    pub lever_arm_m: [T; 3],
    /// Angle of each sensing axis from its designed direction, rad.
    pub misalignment_rad: [T; 3],
}

/// Unit vectors (x, y) along which the probes A, B, C sense: the rows of PM without the arms.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SensingAxes<T>(pub [[T; 2]; 3]);

impl<T: Number> SensingAxes<T> {
    /// The axes at the given misalignments.
    #[inline(always)]
    pub fn at(misalignment_rad: [T; 3]) -> Self {
        let [a, b, c] = misalignment_rad;
        let ((sin_a, cos_a), (sin_b, cos_b), (sin_c, cos_c)) =
            (a.sin_cos(), b.sin_cos(), c.sin_cos());
        Self([[-sin_a, cos_a], [-sin_b, cos_b], [cos_c, sin_c]])
    }

    /// The derivative of each axis by its misalignment, per rad. It is also the unit vector
    /// across the axis: the axis turned by a right angle.
    #[inline(always)]
    pub fn across(&self) -> [[T; 2]; 3] {
        let [a, b, c] = self.0;
        [[-a[1], a[0]], [-b[1], b[0]], [-c[1], c[0]]]
    }

    /// The derivatives of each lever arm by the two coordinates of its probe, in the order
    /// and with the signs of [`ProbeCoordinates`]: (H1x, H1y), (H2x, H2y), (H3x, H3y).
    #[inline(always)]
    pub fn arm_factors(&self) -> [[T; 2]; 3] {
        let [a, b, c] = self.0;
        [[a[1], -a[0]], [-b[1], -b[0]], [c[1], -c[0]]]
    }

    /// Lever arms of probes at `coordinates_m` (see [`ProbeCoordinates::pairs`]): the third
    /// column of PM (equation 11), m.
    #[inline(always)]
    pub fn lever_arms_m(&self, coordinates_m: [[T; 2]; 3]) -> [T; 3] {
        let [a, b, c] = self.arm_factors();
        let [h1, h2, h3] = coordinates_m;
        [
            a[0] * h1[0] + a[1] * h1[1],
            b[0] * h2[0] + b[1] * h2[1],
            c[0] * h3[0] + c[1] * h3[1],
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

    /// The misalignments of the axes, rad, whatever their lengths: the inverse of
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

impl<T: Copy> ProbeCoordinates<T> {
    /// The two coordinates of each probe: (H1x, H1y), (H2x, H2y), (H3x, H3y), m.
    #[inline(always)]
    pub fn pairs(&self) -> [[T; 2]; 3] {
        [
            [self.h1x_m, self.h1y_m],
            [self.h2x_m, self.h2y_m],
            [self.h3x_m, self.h3y_m],
        ]
    }

    /// From the two coordinates of each probe, as [`ProbeCoordinates::pairs`] gives them, m.
    #[inline(always)]
    pub fn from_pairs([[h1x_m, h1y_m], [h2x_m, h2y_m], [h3x_m, h3y_m]]: [[T; 2]; 3]) -> Self {
        Self {
            h1x_m,
            h1y_m,
            h2x_m,
            h2y_m,
            h3x_m,
            h3y_m,
        }
    }
}

impl<T: Number> ProbeCoordinates<T> {
    /// Lever arms at the given misalignments: the third column of PM (equation 11), m.
    pub fn lever_arms_m(&self, misalignment_rad: [T; 3]) -> [T; 3] {
        SensingAxes::at(misalignment_rad).lever_arms_m(self.pairs())
    }

    /// The geometry of probes at these coordinates, turned by `misalignment_rad`.
    pub fn geometry(&self, misalignment_rad: [T; 3]) -> ProbeGeometry<T> {
        ProbeGeometry {
            lever_arm_m: self.lever_arms_m(misalignment_rad),
            misalignment_rad,
        }
    }

    /// The coordinates nearest to these (least sum of squared changes) that have the
    /// given geometry. They are a choice, not a measurement: see the module's text.
    pub fn nearest_with(&self, geometry: &ProbeGeometry<T>) -> Self {
        let axes = SensingAxes::at(geometry.misalignment_rad);
        let (now, factors) = (axes.lever_arms_m(self.pairs()), axes.arm_factors());
        let mut pairs = self.pairs();
        for (k, pair) in pairs.iter_mut().enumerate() {
            // A step along the gradient, which has length one.
            let step = geometry.lever_arm_m[k] - now[k];
            *pair = [
                pair[0] + step * factors[k][0],
                pair[1] + step * factors[k][1],
            ];
        }
        Self::from_pairs(pairs)
    }
}

impl<T: Number> ProbeGeometry<T> {
    /// The rows of PM (equations 11, 32): displacement sensed by A, B, C, in m, per
    /// (m, m, rad) of (X, Y, Rz).
    pub fn plane_rows(&self) -> [[T; 3]; 3] {
        SensingAxes::at(self.misalignment_rad).plane_rows(self.lever_arm_m)
    }
}

/// A 3x3 matrix from its rows.
pub fn matrix<T: Real>(rows: &[[T; 3]; 3]) -> Matrix3<T> {
    Matrix3::from_fn(|row, column| rows[row][column])
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
pub fn inverse_rows<T: Real>(m: &[[T; 3]; 3]) -> Option<[[T; 3]; 3]> {
    let (inverse, determinant) = inverse_and_determinant(m);
    let size = determinant.to_f64().abs();
    (size.is_finite() && size > f64::from(f32::MIN_POSITIVE)).then_some(inverse)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const DESIGNED: ProbeCoordinates<f64> = ProbeCoordinates {
        h1x_m: 0.1975,
        h1y_m: 0.40,
        h2x_m: 0.1975,
        h2y_m: 0.42,
        h3x_m: 0.1975,
        h3y_m: 0.36,
    };

    #[test]
    fn aligned_probes_sense_y_y_x_with_the_designed_arms() {
        let rows = DESIGNED.geometry([0.0; 3]).plane_rows();
        assert_eq!(
            rows,
            [[0.0, 1.0, 0.1975], [0.0, 1.0, -0.1975], [1.0, 0.0, -0.36]]
        );
    }

    /// A rigid body turned by a small Rz moves the probe at p by Rz x p; the sensing axis
    /// projects that. Worked from vectors, not from equation 11.
    #[test]
    fn lever_arm_is_the_sensed_part_of_a_small_rotation() {
        let misalignment = [0.03, -0.05, 0.08];
        let arms = DESIGNED.lever_arms_m(misalignment);
        let probes = [(0.1975, 0.40), (-0.1975, 0.42), (0.1975, 0.36)];
        for (k, &(px, py)) in probes.iter().enumerate() {
            let t = misalignment[k];
            let axis = if k < 2 {
                (-t.sin(), t.cos())
            } else {
                (t.cos(), t.sin())
            };
            let moved = (-py, px);
            let expected = axis.0 * moved.0 + axis.1 * moved.1;
            assert!((arms[k] - expected).abs() < 1e-15, "probe {k}");
        }
    }

    proptest! {
        #[test]
        fn inverse_times_matrix_is_identity(t in prop::array::uniform3(-0.14..0.14f64),
                                            arms in prop::array::uniform3(0.1..0.5f64)) {
            let geometry = ProbeGeometry { lever_arm_m: [arms[0], -arms[1], -arms[2]], misalignment_rad: t };
            let rows = geometry.plane_rows();
            let inverse = inverse_rows(&rows).expect("a sound geometry");
            let product = matrix(&inverse) * matrix(&rows);
            prop_assert!((product - Matrix3::identity()).abs().max() < 1e-12);
        }

        #[test]
        fn nearest_coordinates_have_the_asked_geometry(t in prop::array::uniform3(-0.14..0.14f64),
                                                       d in prop::array::uniform3(-0.05..0.05f64)) {
            let mut asked = DESIGNED.geometry(t);
            for (arm, change) in asked.lever_arm_m.iter_mut().zip(d) { *arm += change; }
            let moved = DESIGNED.nearest_with(&asked);
            for (have, want) in moved.lever_arms_m(t).iter().zip(asked.lever_arm_m) {
                prop_assert!((have - want).abs() < 1e-14);
            }
            // The change lies along the gradient, so no smaller one does it.
            let step = ((moved.h1x_m - DESIGNED.h1x_m).powi(2) + (moved.h1y_m - DESIGNED.h1y_m).powi(2)).sqrt();
            prop_assert!((step - d[0].abs()).abs() < 1e-14);
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
