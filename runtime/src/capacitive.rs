//! Three capacitive gaps and the tilted plane through them: Z, Rx, Ry.
//!
//! The gap at (x, y) changes by g = Z + Rx y - Ry x.

#[cfg(feature = "host")]
use crate::geometry::inverse_rows;
use crate::model::dot;
use crate::pose::VerticalPose;
use crate::real::Number;
#[cfg(feature = "host")]
use crate::real::Real;

/// Coordinates of the three capacitive probes, (x, y) in m.
#[cfg(feature = "host")]
pub type ProbePositions<T> = [[T; 2]; 3];

/// The rows Z, Rx, Ry of the matrix that turns three gap changes (m) into the vertical
/// pose (m, rad, rad); `None` when the probes stand in one line.
#[cfg(feature = "host")]
pub fn vertical_rows<T: Real>(probes_m: &ProbePositions<T>) -> Option<[[T; 3]; 3]> {
    inverse_rows(&probes_m.map(|[x, y]| [T::ONE, y, -x]))
}

/// The vertical pose of three gap changes (or codes, when the scale is in `rows`).
#[inline(always)]
pub fn vertical_pose<T: Number>(rows: &[[T; 3]; 3], gaps: [T; 3]) -> VerticalPose<T> {
    VerticalPose {
        z_m: dot(&rows[0], gaps),
        rx_rad: dot(&rows[1], gaps),
        ry_rad: dot(&rows[2], gaps),
    }
}

/// The gap changes, in m, that the three probes read at a vertical pose.
#[cfg(feature = "host")]
pub fn gaps_m<T: Number>(probes_m: &ProbePositions<T>, vertical: &VerticalPose<T>) -> [T; 3] {
    probes_m.map(|[x, y]| (vertical.z_m + vertical.rx_rad * y) - vertical.ry_rad * x)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const PROBES: ProbePositions<f64> = [[0.12, 0.0], [-0.12, 0.0], [0.0, -0.12]];

    #[test]
    fn signs_follow_the_right_hand_rule() {
        let rows = vertical_rows(&PROBES).expect("a triangle");
        // +Ry lowers the probe on +X and raises the one on -X.
        let v = vertical_pose(&rows, [-12e-6, 12e-6, 0.0]);
        assert!((v.ry_rad - 1e-4).abs() < 1e-18 && v.z_m.abs() < 1e-20 && v.rx_rad.abs() < 1e-18);
        // +Rx lowers the probe on -Y.
        let v = vertical_pose(&rows, [0.0, 0.0, -12e-6]);
        assert!((v.rx_rad - 1e-4).abs() < 1e-18 && v.ry_rad.abs() < 1e-18);
    }

    proptest! {
        #[test]
        fn gaps_and_vertical_pose_undo_each_other(v in prop::array::uniform3(-5e-4..5e-4f64)) {
            let rows = vertical_rows(&PROBES).expect("a triangle");
            let back = vertical_pose(&rows, gaps_m(&PROBES, &VerticalPose::from_array(v)));
            for (have, want) in back.to_array().iter().zip(v) { prop_assert!((have - want).abs() < 1e-17); }
        }
    }
}
