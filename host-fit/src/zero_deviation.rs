//! The zero deviation of each movement, in closed form.
//!
//! Given the other parameters the pose is linear in it: delta = eta (PM mean pose error of the
//! movement), clipped to its range.

use crate::parameters::Parameters;
use crate::stage::Range;
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
        let plane = parameters.geometry.plane_rows();
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
        let pose = inverse_rows(&parameters.geometry.plane_rows()).map_or([0.0; 3], |inverse| {
            zero_pose(&inverse, parameters.eta(), delta_m).to_array()
        });
        Self {
            delta_m,
            pose,
            clipped: false,
        }
    }
}
