//! The zero deviation of each movement, in closed form.
//!
//! Given the other parameters the pose is linear in it: delta = eta (PM mean pose error of the
//! movement).

use crate::estimator::paper::Parameters;
use hallstage_input::stage::Range;
use runtime::PlanarPose;
use runtime::matrix::inverse;
use runtime::model::{zero_deviation_m, zero_pose};

/// The zero deviation of one movement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ZeroDeviation {
    /// delta of A, B, C, m.
    pub delta_m: [f64; 3],
    /// The pose that it stands for: PM^-1 (delta / eta), m, m, rad.
    pub pose: [f64; 3],
    /// Whether any of the three is beyond its range in `stage.toml`.
    pub is_beyond: bool,
}

impl ZeroDeviation {
    /// No zero deviation.
    pub const NONE: Self = Self {
        delta_m: [0.0; 3],
        pose: [0.0; 3],
        is_beyond: false,
    };

    /// The zero deviation that takes off a mean pose error (m, m, rad).
    pub fn from_mean_error(parameters: &Parameters, mean_error: [f64; 3], range: &Range) -> Self {
        let plane = parameters.geometry().plane();
        let pose = PlanarPose::from_array(mean_error);
        let delta_m = zero_deviation_m(&plane, parameters.eta(), &pose);
        Self {
            delta_m,
            pose: mean_error,
            is_beyond: delta_m.map(|delta| range.clip(delta)) != delta_m,
        }
    }

    /// A zero deviation that is known, m at the probes.
    pub fn given(parameters: &Parameters, delta_m: [f64; 3]) -> Self {
        let pose = inverse(&parameters.geometry().plane()).map_or([0.0; 3], |inverse| {
            zero_pose(&inverse, parameters.eta(), delta_m).to_array()
        });
        Self {
            delta_m,
            pose,
            is_beyond: false,
        }
    }
}
