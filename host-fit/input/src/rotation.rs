//! Exact rotations.

use nalgebra::Matrix3;

/// Rz Ry Rx of the angles Rx, Ry, Rz in rad: about X first, then Y, then Z, all axes of the framework.
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
    use nalgebra::{Rotation3, Vector3};

    #[test]
    fn rotations_follow_the_right_hand_rule_about_x_then_y_then_z() {
        let about = |axis, angle| Rotation3::from_axis_angle(&axis, angle);
        let want = about(Vector3::z_axis(), 1.9)
            * about(Vector3::y_axis(), -0.7)
            * about(Vector3::x_axis(), 0.3);
        assert!((rotation([0.3, -0.7, 1.9]) - want.matrix()).amax() < 1e-15);
    }
}
