//! The pose file: what the runtime's decoder makes of a log, one line per row.
//!
//! ```text
//! movement,t_us,x_um,y_um,rz_urad,z_um,rx_urad,ry_urad,status
//! 0,2000,0.161290318,7.68311691,-0.379999995,0.0078125,-0.0651041657,-0.0651041657,0
//! ```
//!
//! A field has nine significant digits, in positional or exponent notation, trailing zeros
//! dropped: read as `f64`, multiplied by 1e-6 and rounded to `f32` it is the decoder's word
//! again, bit for bit, the sign of a zero included. `status` is the bit mask of
//! [`runtime::status`], in decimal: 0 when all is good. A field that it calls invalid is 0,
//! or the last valid one if held.
//!
//! With uncertainties a line ends with `u_x_um,u_y_um,u_rz_urad`, the standard uncertainty of X, Y, Rz by parameters and
//! noise, and `uc_x_um,uc_y_um,uc_rz_urad`, the combined standard uncertainty: four significant digits.
//!
//! X, Y, Rz of a log with a commanded pose are corrected by its speed and acceleration, if the parameters have a
//! motion correction.
//!
//! [`PoseFormat::Npy`] is the same in binary: see `npy.rs`.

mod commanded;
mod npy;
mod stream;
mod summary;
mod text;
mod uncertainty;

pub use stream::{DecodeSettings, PoseFormat, decode_log};
pub use summary::StatusCounts;
pub use uncertainty::KnownErrors;

use runtime::Reading;

/// The first line of every pose file.
pub const HEADER: &str = "movement,t_us,x_um,y_um,rz_urad,z_um,rx_urad,ry_urad,status";

/// One line of a pose file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseRow {
    /// Number of the movement in its log.
    pub movement: i64,
    /// Time within the log, us.
    pub t_us: i64,
    /// Pose and status.
    pub reading: Reading,
}

#[cfg(test)]
mod tests;
