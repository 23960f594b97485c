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
//! With uncertainties a line ends with three more fields, `u_x_um,u_y_um,u_rz_urad`: the standard
//! uncertainty of X, Y, Rz, four significant digits.
//!
//! [`PoseFormat::Npy`] is the same in binary: see `npy.rs`.

mod npy;
mod read;
mod stream;
mod summary;
mod text;
mod uncertainty;

pub use read::{PoseFileError, read};
pub use stream::{DecodeSettings, PoseFormat, decode_log};
pub use summary::StatusCounts;
pub use text::to_text;

use crate::input::dataset::{Dataset, LoggedFrame};
use crate::progress::Progress;
use runtime::{AnyDecoder, OnInvalid, Reading, Servo};

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

/// Runs the decoder over all rows as a controller would, one servo period after the other.
///
/// What is invalid is zero or held, as `on_invalid` says; nothing is held, and no frame is
/// missed, from one movement to the next.
pub fn decode(dataset: &Dataset, decoder: &AnyDecoder, on_invalid: OnInvalid) -> Vec<PoseRow> {
    let mut servo = Servo::new(&**decoder, on_invalid);
    let mut poses = Vec::with_capacity(dataset.rows.len());
    let progress = Progress::new("decoding", dataset.rows.len() as u64);
    for movement in &dataset.movements {
        progress.reach(movement.rows.start as u64);
        servo.forget();
        for row in dataset.rows.get(movement.rows.clone()).unwrap_or_default() {
            let reading = match &row.frame {
                LoggedFrame::Codes(frame) => servo.tick(frame),
                LoggedFrame::HallCodes {
                    hall,
                    vertical,
                    sequence,
                    ..
                } => servo.tick_with(*sequence, |zero| decoder.decode_at(*hall, *vertical, zero)),
            };
            poses.push(PoseRow {
                movement: movement.index,
                t_us: row.t_us,
                reading,
            });
        }
    }
    poses
}

#[cfg(test)]
mod tests;
