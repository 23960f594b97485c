//! `live`: decodes the sensor frames of a CAN bus with the decoder of the target, and publishes the pose.
//!
//! `node` is the decoding node itself without a bus and a clock: frames and times in, frames out.
//! [`run`](run()) connects it to an interface, records and shows it.

mod bus;
mod display;
mod node;
mod run;

pub use bus::BusError;
pub(crate) use bus::{Bus, now_us};
pub use run::run;

use crate::bus::BusAddress;
use crate::output::OutputError;
use crate::output::blob_file::BlobFileError;
use runtime::OnInvalid;
use std::path::PathBuf;
use std::time::Duration;

/// The settings of `live`.
#[derive(Clone, Debug)]
pub struct LiveSettings {
    /// CAN interface, for instance can0; can0@5 for node 5 of the bus.
    pub can: BusAddress,
    /// The parameter blob.
    pub params: PathBuf,
    /// Refuse a blob without this serial number.
    pub serial: Option<String>,
    /// Record every frame received and sent, as `candump -L` does, in a new file.
    pub record: Option<PathBuf>,
    /// How long the last valid pose is repeated where codes are bad.
    pub hold: OnInvalid,
    /// Ticks between two frames of a vertical axis: 1, 2, 4, 8 or 16.
    pub vertical_every: u8,
    /// Send nothing: only watch, record and show.
    pub listen_only: bool,
    /// When to end; `None`: on Ctrl-C.
    pub duration: Option<Duration>,
    /// Time from line to line where output is no terminal.
    pub every: Duration,
    /// Time after which an incomplete tick is given up, us.
    pub assembly_us: u32,
    /// Time without a good frame after which the sensors are stale, us.
    pub stale_us: u32,
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
