//! The zero deviation of each movement, in closed form.
//!
//! Given the other parameters the pose is linear in it: delta = eta (PM mean pose error of the
//! movement), clipped to its range.

use crate::input::stage::Range;
use crate::problem::parameters::Parameters;
use runtime::PlanarPose;
use runtime::geometry::inverse_rows;
use runtime::model::{zero_deviation_m, zero_pose};

/// The zero deviation of one movement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ZeroDeviation {
    /// delta of A, B, C, m, within its range.
    pub delta_m: [f64; 3],
    /// The pose that it stands for: PM^-1 (delta / eta), m, m, rad.
    pub pose: [f64; 3],
    /// Whether any of the three had to be clipped.
    pub clipped: bool,
}

impl ZeroDeviation {
    /// No zero deviation.
    pub const NONE: Self = Self {
        delta_m: [0.0; 3],
        pose: [0.0; 3],
        clipped: false,
    };

    /// The zero deviation that takes off a mean pose error (m, m, rad), as far as `range` lets
    /// it. With a singular PM, which no checked calibration has, there is none.
    pub fn of_mean_error(parameters: &Parameters, mean_error: [f64; 3], range: &Range) -> Self {
        let plane = parameters.geometry().plane_rows();
        let Some(inverse) = inverse_rows(&plane) else {
            return Self::NONE;
        };
        let eta = parameters.eta();
        let wanted = zero_deviation_m(&plane, eta, &PlanarPose::from_array(mean_error));
        let delta_m = wanted.map(|delta| range.clip(delta));
        if delta_m == wanted {
            return Self {
                delta_m,
                pose: mean_error,
                clipped: false,
            };
        }
        Self {
            delta_m,
            pose: zero_pose(&inverse, eta, delta_m).to_array(),
            clipped: true,
        }
    }

    /// A zero deviation that is known, m at the probes.
    pub fn given(parameters: &Parameters, delta_m: [f64; 3]) -> Self {
        let pose = inverse_rows(&parameters.geometry().plane_rows()).map_or([0.0; 3], |inverse| {
            zero_pose(&inverse, parameters.eta(), delta_m).to_array()
        });
        Self {
            delta_m,
            pose,
            clipped: false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::input::shipped::STAGE_TOML;
    use crate::input::stage::Stage;

    /// Aligned probes with arms 0.1975, -0.1975, -0.36 m and eta 1: a pose offset of (x, y, rz)
    /// reads y + 0.1975 rz, y - 0.1975 rz, x - 0.36 rz.
    #[test]
    fn a_mean_error_becomes_the_deviation_of_each_probe_within_its_range() {
        let stage = Stage::from_toml(STAGE_TOML, "stage.toml".as_ref()).expect("sound");
        let designed = Parameters::designed(&stage);
        let range = Range {
            low: -10e-6,
            high: 10e-6,
        };
        let within = ZeroDeviation::of_mean_error(&designed, [3e-6, 2e-6, 10e-6], &range);
        for (have, want) in within.delta_m.iter().zip([3.975e-6, 0.025e-6, -0.6e-6]) {
            assert!((have - want).abs() < 1e-15, "{have:e} {want:e}");
        }
        assert!(!within.clipped && within.pose == [3e-6, 2e-6, 10e-6]);
        // Both ends; what is taken off is then what the clipped ones stand for.
        let beyond = ZeroDeviation::of_mean_error(&designed, [-30e-6, 40e-6, 0.0], &range);
        assert_eq!(beyond.delta_m, [10e-6, 10e-6, -10e-6]);
        assert!(beyond.clipped);
        for (have, want) in beyond.pose.iter().zip([-10e-6, 10e-6, 0.0]) {
            assert!((have - want).abs() < 1e-15, "{have:e} {want:e}");
        }
        let given = ZeroDeviation::given(&designed, beyond.delta_m);
        assert_eq!(given.pose, beyond.pose);
    }
}
