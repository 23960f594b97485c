//! `live`: decodes the sensor frames of a CAN bus as they come, with the decoder of the
//! target, and publishes the pose.
//!
//! [`node`] is the decoding node itself, without a bus and without a clock: frames and times
//! in, frames out. [`run`](run()) puts it on an interface, records and shows it.

mod bus;
mod display;
pub mod node;
mod record;
pub mod rhythm;
mod run;

pub(crate) use bus::Bus;
pub use bus::BusError;
pub use run::run;

use crate::output::OutputError;
use crate::output::blob_file::BlobFileError;
use clap::Args;
use std::path::PathBuf;

/// Arguments of `live`.
#[derive(Clone, Debug, Args)]
pub struct LiveArgs {
    /// CAN interface, for instance can0.
    #[arg(long, value_name = "IFACE")]
    pub can: String,
    /// The parameter blob.
    #[arg(value_name = "params.bin")]
    pub params: PathBuf,
    /// Refuse a blob of another stage than the one with this serial number.
    #[arg(long, value_name = "TEXT")]
    pub serial: Option<String>,
    /// Record every frame received and sent, as `candump -L` does.
    #[arg(long, value_name = "FILE")]
    pub record: Option<PathBuf>,
    /// Repeat the last valid pose for at most so many ticks where codes are bad.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub hold: u16,
    /// Send each vertical axis in every so many ticks: 1, 2, 4, 8 or 16.
    #[arg(long, value_name = "TICKS", default_value_t = 4, value_parser = vertical_ticks)]
    pub vertical_every: u8,
    /// Send nothing: only watch, record and show.
    #[arg(long)]
    pub listen_only: bool,
    /// End after so many seconds; without it, on Ctrl-C.
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    pub duration: Option<f64>,
    /// Seconds from line to line where output is no terminal.
    #[arg(long, value_name = "SECONDS", default_value = "1", value_parser = seconds)]
    pub every: f64,
    /// Give up a tick whose frames are not all there after so long.
    #[arg(long, value_name = "US", default_value_t = 1_000, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    pub assembly_us: u32,
    /// Call the sensors stale after so long without a good frame.
    #[arg(long, value_name = "US", default_value_t = 3_000, value_parser = clap::value_parser!(u32).range(1..=10_000_000))]
    pub stale_us: u32,
}

fn vertical_ticks(text: &str) -> Result<u8, String> {
    match text.parse() {
        Ok(ticks @ (1 | 2 | 4 | 8 | 16)) => Ok(ticks),
        _ => Err("expected 1, 2, 4, 8 or 16".into()),
    }
}

fn seconds(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(seconds) if seconds > 0.0 && seconds <= 1e9 => Ok(seconds),
        _ => Err("expected a number of seconds above 0".into()),
    }
}

/// Why `live` ended early.
#[derive(Debug, thiserror::Error)]
pub enum LiveError {
    /// The parameter blob is refused.
    #[error(transparent)]
    Blob(#[from] BlobFileError),
    /// The blob belongs to another stage.
    #[error(
        "{}: the blob belongs to the stage `{found}`, not `{expected}`: name the blob of this stage, or its serial \
         number", path.display()
    )]
    OtherStage {
        /// The file.
        path: PathBuf,
        /// Serial number in the blob.
        found: String,
        /// Serial number asked for.
        expected: String,
    },
    /// The codes that the blob accepts do not fit into a frame of the bus.
    #[error(
        "{}: the blob accepts codes of more than 24 bits, which no frame of this bus carries",
        path.display()
    )]
    CodesTooWide {
        /// The file.
        path: PathBuf,
    },
    /// The bus cannot be used.
    #[error(transparent)]
    Bus(#[from] BusError),
    /// The record cannot be written.
    #[error("cannot record to {}: {cause}; the frames before it are kept", path.display())]
    Record {
        /// The file.
        path: PathBuf,
        /// What the system says.
        cause: std::io::Error,
    },
    /// The record's file cannot be made.
    #[error(transparent)]
    Output(#[from] OutputError),
}
