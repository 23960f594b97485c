//! The pose of a rigid stage, with exact rotations.

use nalgebra::{Matrix3, Vector3};
use std::fmt::Write;

/// Displacement of the stage's centroid and rotation of the stage, from the initial pose.
///
/// Rotations follow one another: Rx about X first, then Ry about Y, then Rz about Z, all about the axes
/// of the framework.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StagePose {
    /// X, Y, Rz: m, m, rad.
    pub planar: [f64; 3],
    /// Z, Rx, Ry: m, rad, rad.
    pub vertical: [f64; 3],
}

impl StagePose {
    /// From X, Y, Rz, Z, Rx, Ry, m and rad.
    pub const fn from_array([x, y, rz, z, rx, ry]: [f64; 6]) -> Self {
        Self {
            planar: [x, y, rz],
            vertical: [z, rx, ry],
        }
    }

    /// X, Y, Rz, Z, Rx, Ry, m and rad.
    pub const fn to_array(&self) -> [f64; 6] {
        let ([x, y, rz], [z, rx, ry]) = (self.planar, self.vertical);
        [x, y, rz, z, rx, ry]
    }

    /// Appends the six numbers to a line of CSV, each after a comma, rounded to 10 pm and prad: with two
    /// digits in nm and nrad, with five in um and urad.
    pub(crate) fn append_to(&self, line: &mut String, digits: u8) {
        let scale = libm::pow(10.0, f64::from(digits));
        for value in self.to_array() {
            // Zero is added, so that no number is -0.00. Writing to memory cannot fail.
            let rounded = (value * 1e11).round() / scale + 0.0;
            let _ = write!(line, ",{rounded:.*}", usize::from(digits));
        }
    }

    /// X, Y, Z of the centroid, m.
    pub fn position_m(&self) -> Vector3<f64> {
        Vector3::new(self.planar[0], self.planar[1], self.vertical[0])
    }

    /// Turns a direction of the stage into the framework.
    pub fn rotation(&self) -> Matrix3<f64> {
        rotation([self.vertical[1], self.vertical[2], self.planar[2]])
    }
}

/// Rz Ry Rx of the angles Rx, Ry, Rz in rad.
pub fn rotation([rx, ry, rz]: [f64; 3]) -> Matrix3<f64> {
    // libm, not the platform's: the same bits everywhere.
    let (sx, cx) = libm::sincos(rx);
    let (sy, cy) = libm::sincos(ry);
    let (sz, cz) = libm::sincos(rz);
    Matrix3::new(
        cz * cy,
        cz * sy * sx - sz * cx,
        cz * sy * cx + sz * sx,
        sz * cy,
        sz * sy * sx + cz * cx,
        sz * sy * cx - cz * sx,
        -sy,
        cy * sx,
        cy * cx,
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Rotation3;

    #[test]
    fn rotations_follow_the_right_hand_rule_about_x_then_y_then_z() {
        let about = |axis, angle| Rotation3::from_axis_angle(&axis, angle);
        let want = about(Vector3::z_axis(), 1.9)
            * about(Vector3::y_axis(), -0.7)
            * about(Vector3::x_axis(), 0.3);
        assert!((rotation([0.3, -0.7, 1.9]) - want.matrix()).amax() < 1e-15);
    }
}
