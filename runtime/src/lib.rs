//! Pose of a 6-DOF precision stage from three Hall and three capacitive codes,
//! every servo period, with a calibration that `host-fit` made.
//!
//! The crate is `no_std`, allocates nothing, reads no clock and no pin. Data flow
//! one way, one type a step:
//!
//! ```text
//! bytes --ParameterSet::from_bytes--> ParameterSet --decoder--> AnyDecoder
//!     once, at start: checked, its model chosen, then borrowed read-only
//! RawFrame --Decode::decode--> Reading (Pose + Status) --PoseTracker::tick--> Reading, Health
//!     every servo period
//! ```
//!
//! | module | what it holds |
//! |---|---|
//! | [`pose`] | the pose, its frame and its signs (one drawing) |
//! | [`geometry`] | lever arms, misalignments and the plane matrix PM (equations 11, 32) |
//! | [`model`] | what a model is; Models (12), (15), (30) and (31), for `f32` and `f64` |
//! | [`matrix`] | the inverse of a 3 x 3 matrix |
//! | [`capacitive`] | three gaps to Z, Rx, Ry and back |
//! | [`frame`] | codes as the converters gave them, and what makes a code bad |
//! | [`status`] | the documented bit mask that goes with every pose |
//! | [`temperature`] | how sensitivities follow temperature |
//! | [`calibration`] | what a fit yields, in SI units, and how it becomes decoder constants |
//! | [`decoder`] | one frame to one reading: the flat tick path |
//! | [`tracker`] | what lasts from tick to tick: hold, sequence, counters, re-zero |
//! | [`zero_offset`] | the zero deviation measured at rest |
//! | [`prediction`] | the pose at a time after its sample |
//! | [`motion`] | errors that follow the commanded velocity and acceleration |
//! | [`parameters`], [`blob`] | the parameter set, and its bytes in flash |
//! | [`arithmetic`] | the check at start-up that this machine rounds as the host does |
//! | [`real`] | the operations that a number must have to run a model |
//!
//! Symbols of the paper and the names here:
//!
//! | paper | here | unit |
//! |---|---|---|
//! | X, Y, Rz | [`pose::PlanarPose`] `x_m`, `y_m`, `rz_rad` | m, m, rad |
//! | Z, Rx, Ry | [`pose::VerticalPose`] `z_m`, `rx_rad`, `ry_rad` | m, rad, rad |
//! | third column of PM | lever arm, `lever_arm_m` | m |
//! | theta_A, theta_B, theta_C | [`geometry`], `misalignment_rad` | rad |
//! | eta_yA, eta_yB, eta_x | `sensitivity` at the zero of the vertical pose | 1 |
//! | a, b, c | `per_z_m`, `per_rx_rad`, `per_ry_rad` | 1/m, 1/rad, 1/rad |
//! | phi_A, phi_B, phi_C | sensitivity at a vertical pose | 1 |
//! | delta_A, delta_B, delta_C | zero deviation | m |
//! | (beyond the paper) k, h, G | [`temperature`] | 1/mK, 1/mK, 1 |
//! | (beyond the paper) A, L | [`motion`], `acceleration_s2`, `velocity_s` | rows of m, m, rad per SI unit |
#![no_std]
#![forbid(unsafe_code)]

pub mod arithmetic;
pub mod blob;
#[cfg(feature = "host")]
pub mod calibration;
#[cfg(feature = "host")]
pub mod capacitive;
#[cfg(not(feature = "host"))]
mod capacitive;
pub mod decoder;
pub mod frame;
#[cfg(feature = "host")]
pub mod geometry;
#[cfg(not(feature = "host"))]
mod geometry;
mod layout;
#[cfg(feature = "host")]
pub mod matrix;
#[cfg(not(feature = "host"))]
mod matrix;
pub mod model;
pub mod motion;
pub mod parameters;
pub mod pose;
pub mod prediction;
#[cfg(feature = "host")]
pub mod real;
#[cfg(not(feature = "host"))]
mod real;
#[cfg(test)]
#[path = "sample_for_tests.rs"]
mod sample;
mod soundness;
pub mod status;
pub mod temperature;
pub mod tracker;
pub mod zero_offset;

pub use blob::BlobError;
#[cfg(feature = "host")]
pub use calibration::Calibration;
pub use decoder::{AnyDecoder, Decode, Decoder, Reading};
pub use frame::RawFrame;
pub use model::{FieldModel, LinearModel, Model, ModelKind};
pub use motion::{CommandedMotion, MotionCorrection};
pub use parameters::ParameterSet;
pub use pose::{PlanarPose, Pose, VerticalPose};
pub use prediction::Predictor;
pub use status::Status;
pub use temperature::Temperature;
pub use tracker::{OnInvalid, PoseTracker};

/// The earlier name of a [`PoseTracker`] that borrows its decoder.
#[deprecated(since = "0.2.0", note = "use PoseTracker, which can own its decoder")]
pub type Servo<'d> = PoseTracker<&'d dyn Decode>;
