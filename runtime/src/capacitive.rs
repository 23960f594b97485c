//! Three capacitive gaps and the tilted plane through them: Z, Rx, Ry.
//!
//! The gap at (x, y) changes by g = Z + Rx y - Ry x.

#[cfg(feature = "host")]
use crate::matrix::inverse;
use crate::model::dot;
use crate::pose::VerticalPose;
use crate::real::Real;
#[cfg(feature = "host")]
use nalgebra::{Matrix3, Vector3};

/// Coordinates of the three capacitive probes, (x, y) in m.
#[cfg(feature = "host")]
pub type ProbePositions<T> = [[T; 2]; 3];

/// The plane matrix: gap changes of the three probes (m) per vertical pose (m, rad, rad).
#[cfg(feature = "host")]
pub fn gaps_per_vertical<T: Real>(probes_m: &ProbePositions<T>) -> Matrix3<T> {
    let [[xa, ya], [xb, yb], [xc, yc]] = *probes_m;
    #[rustfmt::skip]
    let plane = Matrix3::new(
        T::ONE, ya, -xa,
        T::ONE, yb, -xb,
        T::ONE, yc, -xc,
    );
    plane
}

/// The inverse of the plane matrix: vertical pose (m, rad, rad) per gap change (m); `None` when
/// the probes stand in one line.
#[cfg(feature = "host")]
pub fn vertical_per_gap<T: Real>(probes_m: &ProbePositions<T>) -> Option<Matrix3<T>> {
    inverse(&gaps_per_vertical(probes_m))
}

/// The gap changes, in m, that the three probes read at a vertical pose.
#[cfg(feature = "host")]
pub fn gaps_m<T: Real>(probes_m: &ProbePositions<T>, vertical: &VerticalPose<T>) -> [T; 3] {
    (gaps_per_vertical(probes_m) * Vector3::from(vertical.to_array())).into()
}

/// The vertical pose of three codes, by the rows Z, Rx, Ry of its change per code: part of the tick.
#[inline(always)]
pub fn vertical_pose<T: Real>(rows: &[[T; 3]; 3], codes: [T; 3]) -> VerticalPose<T> {
    VerticalPose {
        z_m: dot(&rows[0], codes),
        rx_rad: dot(&rows[1], codes),
        ry_rad: dot(&rows[2], codes),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const PROBES: ProbePositions<f64> = [[0.12, 0.0], [-0.12, 0.0], [0.0, -0.12]];

    fn vertical(gaps_m: [f64; 3]) -> [f64; 3] {
        let per_gap = vertical_per_gap(&PROBES).expect("a triangle");
        (per_gap * Vector3::from(gaps_m)).into()
    }

    #[test]
    fn signs_follow_the_right_hand_rule() {
        // +Ry lowers the probe on +X and raises the probe on -X.
        let [z, rx, ry] = vertical([-12e-6, 12e-6, 0.0]);
        assert!((ry - 1e-4).abs() < 1e-18 && z.abs() < 1e-20 && rx.abs() < 1e-18);
        // +Rx lowers the probe on -Y.
        let [_, rx, ry] = vertical([0.0, 0.0, -12e-6]);
        assert!((rx - 1e-4).abs() < 1e-18 && ry.abs() < 1e-18);
    }

    proptest! {
        #[test]
        fn gaps_and_vertical_pose_undo_each_other(v in prop::array::uniform3(-5e-4..5e-4f64)) {
            let back = vertical(gaps_m(&PROBES, &VerticalPose::from_array(v)));
            for (have, want) in back.iter().zip(v) { prop_assert!((have - want).abs() < 1e-17); }
        }
    }
}
