//! Where the Hall probes sit and how they are turned: the plane matrix PM (equations 11, 32).
//!
//! The six coordinates enter PM only through three lever arms, its third column. `H1x` and
//! `H1y` cannot be told apart by any data, nor can the other pairs, so a calibration holds
//! lever arms and misalignments; coordinates are kept only as designed values.

use crate::real::Real;
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
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProbeGeometry<T> {
    /// Third column of PM: displacement along the sensing axis per rad of Rz, m.
    pub lever_arm_m: [T; 3],
    /// Angle of each sensing axis from its designed direction, rad.
    pub misalignment_rad: [T; 3],
}

impl<T: Real> ProbeCoordinates<T> {
    /// Lever arms at the given misalignments: the third column of PM (equation 11), m.
    pub fn lever_arms_m(&self, misalignment_rad: [T; 3]) -> [T; 3] {
        let [(sin_a, cos_a), (sin_b, cos_b), (sin_c, cos_c)] = misalignment_rad.map(Real::sin_cos);
        [
            self.h1x_m * cos_a + self.h1y_m * sin_a,
            self.h2y_m * sin_b - self.h2x_m * cos_b,
            self.h3x_m * sin_c - self.h3y_m * cos_c,
        ]
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
        let now = self.lever_arms_m(geometry.misalignment_rad);
        let [(sin_a, cos_a), (sin_b, cos_b), (sin_c, cos_c)] =
            geometry.misalignment_rad.map(Real::sin_cos);
        let [d_a, d_b, d_c] = [
            geometry.lever_arm_m[0] - now[0],
            geometry.lever_arm_m[1] - now[1],
            geometry.lever_arm_m[2] - now[2],
        ];
        Self {
            h1x_m: self.h1x_m + d_a * cos_a,
            h1y_m: self.h1y_m + d_a * sin_a,
            h2x_m: self.h2x_m - d_b * cos_b,
            h2y_m: self.h2y_m + d_b * sin_b,
            h3x_m: self.h3x_m + d_c * sin_c,
            h3y_m: self.h3y_m - d_c * cos_c,
        }
    }
}

impl<T: Real> ProbeGeometry<T> {
    /// The rows of PM (equations 11, 32): displacement sensed by A, B, C, in m, per
    /// (m, m, rad) of (X, Y, Rz).
    pub fn plane_rows(&self) -> [[T; 3]; 3] {
        let [(sin_a, cos_a), (sin_b, cos_b), (sin_c, cos_c)] =
            self.misalignment_rad.map(Real::sin_cos);
        let [arm_a, arm_b, arm_c] = self.lever_arm_m;
        [
            [-sin_a, cos_a, arm_a],
            [-sin_b, cos_b, arm_b],
            [cos_c, sin_c, arm_c],
        ]
    }

    /// PM as a matrix.
    pub fn plane_matrix(&self) -> Matrix3<T> {
        matrix(&self.plane_rows())
    }
}

/// A 3x3 matrix from its rows.
pub fn matrix<T: Real>(rows: &[[T; 3]; 3]) -> Matrix3<T> {
    Matrix3::from_fn(|row, column| rows[row][column])
}

/// The inverse of a 3x3 matrix by its adjugate, in a written order; `None` when the
/// determinant is zero, subnormal or not finite.
pub fn inverse_rows<T: Real>(m: &[[T; 3]; 3]) -> Option<[[T; 3]; 3]> {
    let [[a, b, c], [d, e, f], [g, h, i]] = *m;
    let cofactor_a = e * i - f * h;
    let cofactor_b = f * g - d * i;
    let cofactor_c = d * h - e * g;
    let determinant = (a * cofactor_a + b * cofactor_b) + c * cofactor_c;
    let size = determinant.to_f64();
    if !size.is_finite()
        || (-f64::from(f32::MIN_POSITIVE)..=f64::from(f32::MIN_POSITIVE)).contains(&size)
    {
        return None;
    }
    let r = T::ONE / determinant;
    Some([
        [cofactor_a * r, (c * h - b * i) * r, (b * f - c * e) * r],
        [cofactor_b * r, (a * i - c * g) * r, (c * d - a * f) * r],
        [cofactor_c * r, (b * g - a * h) * r, (a * e - b * d) * r],
    ])
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
