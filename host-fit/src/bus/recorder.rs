//! `record`: asks a controller for the codes of its own converter, and records the bus like `candump -L` until the
//! user stops it. The controller needs no parameters: the first calibration has none.

mod run;
mod watch;

pub(crate) use run::run;
pub use watch::Monitor;

use super::BusAddress;
use super::live::BusError;
use crate::output::OutputError;
use hal_adapters::can::command::Outcome;
use std::path::PathBuf;
use std::time::Duration;

/// Settings of `record`.
#[derive(Debug)]
pub(crate) struct RecordSettings {
    /// CAN interface, for instance can0; can0@5 for node 5 of the bus.
    pub(crate) can: BusAddress,
    /// Where to write the record, as `candump -L` does, for `join`: a new file.
    pub(crate) out: PathBuf,
    /// End after this many seconds; without it, on Ctrl-C.
    pub(crate) seconds: Option<Duration>,
}

/// A record.
#[derive(Clone, Debug)]
pub struct Recorded {
    /// Its contents.
    pub watch: Monitor,
    /// Whether the controller has confirmed that it sends no more codes.
    pub is_stopped: bool,
}

/// A record with more missing ticks than one in this number is spoilt: `check` warns of such a log.
pub const MISSING_ONE_IN: u64 = 1_000;

/// Why there is no record, or none to calibrate by.
#[derive(Debug, thiserror::Error)]
pub enum RecorderError {
    /// The bus cannot be used.
    #[error(transparent)]
    Bus(#[from] BusError),
    /// The record cannot be begun.
    #[error("cannot record to {0}")]
    NoRecord(OutputError),
    /// The record ended before its time; its first part is kept.
    #[error("the record is not whole: {0}. It ends with the last frame that there was room for")]
    RecordEnded(#[from] OutputError),
    /// No controller answers.
    #[error(
        "no controller at `{address}` answered the request to send its codes within 3 s; is it on, and is \
         the interface set to its bit rate (`ip -details link show`)? Where a sensor node sends the codes \
         and none is asked for, record with `candump -L`. Nothing was written"
    )]
    NoAnswer {
        /// Its address.
        address: BusAddress,
    },
    /// The controller refuses.
    #[error("the controller refuses to send its codes: {}. Nothing was written", match outcome {
        Some(Outcome::NotAuthorised) => "name the key of its stage with --key FILE",
        Some(Outcome::ServoOn) => "it has no key, and its line does not say that the servo is off. Switch that off, begin to \
                                   record, and switch it on again",
        Some(Outcome::NoRandomNumber) => "its random number generator gives no numbers; restart it",
        _ => "its program may be too old to record",
    })]
    Refused {
        /// Its answer.
        outcome: Option<Outcome>,
    },
    /// The controller agreed, and no codes came.
    #[error(
        "the controller agreed to send its codes, but none came in {seconds:.1} s: {state}. Nothing was written"
    )]
    NoCodes {
        /// How long was recorded, s.
        seconds: f64,
        /// State of the controller.
        state: String,
    },
    /// Too many ticks are missing.
    #[error(
        "{missing} of {ticks} ticks are missing, more than one in {MISSING_ONE_IN}: {cause}. The record is kept in {}", path.display()
    )]
    TicksLost {
        /// Missing ticks.
        missing: u64,
        /// All ticks, missing ones included.
        ticks: u64,
        /// Where they were lost.
        cause: String,
        /// The record.
        path: PathBuf,
    },
}
