//! `live`: decodes the sensor frames of a CAN bus with the decoder of the target, and publishes the pose.
//!
//! `node` is the decoding node itself without a bus and a clock: frames and times in, frames out.
//! `run` connects it to an interface, records and shows it.

mod bus;
mod display;
mod node;
mod run;

pub use bus::BusError;
pub(crate) use bus::{Bus, now_us};
pub(crate) use run::run;

use crate::arguments::{hold, seconds};
use crate::bus::BusAddress;
use crate::output::OutputError;
use crate::output::blob_file::BlobFileError;
use clap::Args;
use runtime::OnInvalid;
use std::path::PathBuf;
use std::time::Duration;

/// Arguments of `live`.
#[derive(Debug, Args)]
pub(crate) struct LiveSettings {
    /// CAN interface, for instance can0; can0@5 for node 5 of the bus.
    #[arg(long, value_name = "IFACE")]
    pub(crate) can: BusAddress,
    /// The parameter blob.
    #[arg(value_name = "params.bin")]
    pub(crate) params: PathBuf,
    /// Refuse a blob unless its stage has this serial number.
    #[arg(long, value_name = "TEXT")]
    pub(crate) serial: Option<String>,
    /// Record every frame received and sent, as `candump -L` does, in a new file.
    #[arg(long, value_name = "FILE")]
    pub(crate) record: Option<PathBuf>,
    /// Repeat the last valid pose for at most N ticks where codes are bad.
    #[arg(long, value_name = "N", default_value = "0", value_parser = hold)]
    pub(crate) hold: OnInvalid,
    /// Send nothing: only watch, record and show.
    #[arg(long)]
    pub(crate) listen_only: bool,
    /// End after this many seconds; without it, on Ctrl-C.
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    pub(crate) duration: Option<Duration>,
    /// Seconds from line to line, where lines are shown.
    #[arg(long, value_name = "SECONDS", default_value = "1", value_parser = seconds)]
    pub(crate) every: Duration,
    /// Show lines on a terminal, too, in place of the scope.
    #[arg(long)]
    pub(crate) plain: bool,
    /// Give up a tick if frames are still missing after this time.
    #[arg(long, value_name = "US", default_value_t = 1_000, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    pub(crate) assembly_us: u32,
    /// Call the sensors stale after this time without a good frame.
    #[arg(long, value_name = "US", default_value_t = 3_000, value_parser = clap::value_parser!(u32).range(1..=10_000_000))]
    pub(crate) stale_us: u32,
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
    /// The terminal cannot be used.
    #[error("the terminal cannot be used: {0}; show lines with --plain")]
    Terminal(#[from] std::io::Error),
    /// The record cannot be begun.
    #[error("cannot record to {0}")]
    NoRecord(OutputError),
    /// The record ended before the run; decoding went on.
    #[error("the record is not whole: {source}. It ends with the frames of {after_s:.0} s")]
    RecordEnded {
        /// Why.
        source: OutputError,
        /// Time from the start of the run to the end of the record, s.
        after_s: f64,
    },
}
