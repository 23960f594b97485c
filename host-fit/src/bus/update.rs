//! `identify`, `update`, `read-back`, `rezero`: who a node is, new parameters for it, the parameters that
//! it runs, and its zero, over the bus. The protocol is that of [`hal_adapters::can::update`].
//!
//! Each is a straight script over [`Talk::exchange`], on whatever [`Link`]: a bus, or a model of one.

mod identity;
mod plan;
mod rezero;
mod run;
mod script;
mod talk;

pub use identity::{Identity, RunningParameters};
pub use plan::{Plan, Updated, Wanted};
pub use rezero::Zero;
pub use run::{identify, read_back, rezero, update};
pub use talk::{Link, SPACING_US, Talk};
/// The scripts without an interface.
pub mod on {
    pub use super::identity::{identify, read_back};
    pub use super::rezero::rezero;
    pub use super::script::update;
}

use super::BusAddress;
use super::live::BusError;
use hal_adapters::can::command::Outcome;
use runtime::BlobError;

/// Why a node was not identified, updated or read.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum UpdateError {
    /// The bus cannot be used.
    #[error("the bus cannot be used")]
    Link,
    /// Nobody answers.
    #[error(
        "no controller answered for 3 s; is it on, and is the interface set to its bit rate (`ip -details link show`)?"
    )]
    NoAnswer,
    /// The node answers, but does not know these requests.
    #[error(
        "the controller does not say what it runs: its program is too old for updates over the bus, or it is `host-fit \
         live`. Flash a newer program, and parameters with `host-fit export` and a probe"
    )]
    TellsNothing,
    /// An answer that makes no sense here.
    #[error("the controller gave an answer that was not expected: {}", outcome.map_or("one that this version does not know".to_owned(), |outcome| format!("{outcome:?}")))]
    Unexpected {
        /// The answer.
        outcome: Option<Outcome>,
    },
    /// The blob is that of another stage, or another stage is there.
    #[error(
        "the controller is that of the stage `{found}`, not `{expected}`; nothing was sent to it. Name the blob of this \
         stage, or connect the other one"
    )]
    OtherStage {
        /// Serial number of the blob, or the one asked for.
        expected: String,
        /// That of the node.
        found: String,
    },
    /// A serial number was asked for, and the node has none.
    #[error(
        "the controller has no serial number, so it may not be that of the stage `{expected}`; nothing was sent to it. \
         Leave out --serial if it is"
    )]
    NoSerial {
        /// The one asked for.
        expected: String,
    },
    /// The node wants a tag.
    #[error(
        "the controller takes new parameters only with the key of its stage: name it with --key FILE"
    )]
    KeyNeeded,
    /// The stage is not at rest at its zero.
    #[error("not re-zeroed, and the zero stays: {}", match outcome {
        Outcome::NoPose => "a tick had no pose; see the state of the controller".to_owned(),
        Outcome::Extrapolated => "the stage rests outside the range of its calibration".to_owned(),
        Outcome::OutOfBounds => format!("{} rests too far from its zero; see the limits in `board.rs`", axis(*detail)),
        _ => format!("{} is not at rest; wait until the stage is quiet", axis(*detail)),
    })]
    NotAtRest {
        /// What the node says.
        outcome: Outcome,
        /// Its detail: an axis, or a status.
        detail: u32,
    },
    /// The node takes the servo for on.
    #[error("{}", match declared {
        false => "the servo may be on: switch it off, and say so with --servo-off, which declares it meanwhile",
        true => "the controller does not take the servo for off: it has restarted, its service pin says on, another \
                 computer has declared it on, or the time of the declaration ran out. Nothing was changed. Look at the stage; \
                 once the servo is off, try again",
    })]
    ServoOn {
        /// Whether it was declared off.
        declared: bool,
    },
    /// Another host is at it.
    #[error("another computer is updating this controller; try again when it is done")]
    Busy,
    /// Nothing can be authorised.
    #[error(
        "the controller's random number generator gives no numbers, so that it cannot authorise anything; restart it. If \
         that does not help, the generator or its clock is broken"
    )]
    NoRandomNumber,
    /// The tag is wrong.
    #[error(
        "the controller refuses this as not authorised: name the key of its stage with --key FILE; a key that was named is that \
         of another stage"
    )]
    NotAuthorised,
    /// The node refuses the blob.
    #[error("the controller refuses the parameters: {}", match kind {
        4 => "their layout is too new for its program; update that first",
        7 => "they came over damaged four times; look at the bus and its termination",
        10 => "they belong to another stage",
        _ => "its program does not take them; update it, or fit again",
    })]
    BadContent {
        /// See [`BlobError::number`].
        kind: u32,
    },
    /// Another host has stored records meanwhile.
    #[error(
        "another computer has stored newer parameters meanwhile (the next number is {least}); look at them with `host-fit \
         identify`, and try again"
    )]
    Overtaken {
        /// The least sequence number that the node takes.
        least: u32,
    },
    /// No number is left.
    #[error(
        "the controller's records have used up all sequence numbers: erase its store with a probe"
    )]
    NumbersUsedUp,
    /// The supply is too low to write.
    #[error(
        "the supply of the controller is below 2.9 V, so that nothing is written: it goes on with the parameters that it runs"
    )]
    SupplyLow,
    /// The flash could not be written.
    #[error(
        "the controller could not write its flash, and goes on with the parameters that it runs; those before them may be \
         lost. Try again; if it fails again, the flash is worn out"
    )]
    StoreFailed,
    /// There are no parameters to activate.
    #[error("the controller keeps no parameters that it could run")]
    NothingKept,
    /// There is nothing to go back to.
    #[error("the controller keeps no parameters from before the newest")]
    NoPrevious,
    /// Too much is lost.
    #[error(
        "the controller lost the update again and again, or was restarted; look at the bus, its termination and its load"
    )]
    Lossy,
    /// No answer to the commit.
    #[error(
        "the controller stopped to answer while it stored the parameters: see with `host-fit identify` which it has. It \
         has the old or the new ones, never a mixture"
    )]
    Unknown,
    /// The new parameters are stored, but the node was not reset.
    #[error(
        "the parameters are stored as number {sequence} and wait; they were not activated, because the servo may be on \
         again, or another computer is updating. Once it is off and the other one done, use `host-fit update --servo-off \
         --activate`"
    )]
    NotActivated {
        /// Their sequence number.
        sequence: u32,
    },
    /// The new parameters do not run.
    #[error(
        "the parameters are stored as number {sequence}, but the controller does not run them, or has stopped because its \
         program failed twice: see its state, and go back with `host-fit update --servo-off --previous --activate`"
    )]
    NotActive {
        /// Their sequence number.
        sequence: u32,
    },
    /// The new parameters are stored, and then nobody answered.
    #[error(
        "the parameters are stored as number {sequence}, and the controller has not answered for 3 s since: is it on? See \
         what it runs with `host-fit identify`"
    )]
    Silent {
        /// Their sequence number.
        sequence: u32,
    },
    /// There is no blob to read.
    #[error("the controller runs no parameters: there is nothing to read back")]
    NothingRuns,
    /// What was read back is not sound.
    #[error("what the controller gave is no sound parameter blob: {cause}; try again")]
    ReadBack {
        /// What is wrong with it.
        cause: BlobError,
    },
    /// What was read back is not what the node said it runs.
    #[error("the controller's parameters changed while they were read: try again")]
    Changed,
    /// Ctrl-C.
    #[error("interrupted; the controller keeps the parameters that it has")]
    Interrupted,
}

impl UpdateError {
    /// What another outcome than the one hoped for means; `declared`: whether the servo was declared off.
    const fn of(outcome: Outcome, detail: u32, declared: bool) -> Self {
        match outcome {
            Outcome::ServoOn => Self::ServoOn { declared },
            Outcome::Busy => Self::Busy,
            Outcome::UnknownCommand => Self::TellsNothing,
            Outcome::NoParameters => Self::NothingRuns,
            Outcome::NoRandomNumber => Self::NoRandomNumber,
            Outcome::NotAuthorised => Self::NotAuthorised,
            Outcome::BadContent => Self::BadContent { kind: detail },
            Outcome::WrongSequence => Self::Overtaken { least: detail },
            Outcome::SupplyLow => Self::SupplyLow,
            Outcome::StoreFailed => Self::StoreFailed,
            Outcome::NoTransfer => Self::Lossy,
            Outcome::NoPose
            | Outcome::Moved
            | Outcome::Drifted
            | Outcome::OutOfBounds
            | Outcome::Extrapolated => Self::NotAtRest { outcome, detail },
            outcome => Self::Unexpected {
                outcome: Some(outcome),
            },
        }
    }
}

/// Name of an axis by its number in an answer.
fn axis(number: u32) -> &'static str {
    const NAMES: [&str; 6] = ["X", "Y", "Rz", "Z", "Rx", "Ry"];
    let named = usize::try_from(number).ok().and_then(|k| NAMES.get(k));
    named.copied().unwrap_or("an axis")
}

/// Why a command that talks to a node ended early.
#[derive(Debug, thiserror::Error)]
pub enum UpdateRunError {
    /// The bus cannot be used.
    #[error(transparent)]
    Bus(#[from] BusError),
    /// The node, or the dialog with it.
    #[error("{address}: {cause}")]
    Dialog {
        /// Where.
        address: BusAddress,
        /// What is wrong.
        cause: UpdateError,
    },
}
