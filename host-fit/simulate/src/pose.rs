//! The pose of a rigid stage, with exact rotations.

use hallstage_input::rotation::rotation;
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
