//! `identify`, `update`, `read-back`, `rezero`: the identity of a node, new parameters for it, its parameters,
//! and its zero, over the bus. The protocol is [`hal_adapters::can::update`].
//!
//! Each command is a script over [`Talk::exchange`], on any [`Link`]: a bus, or a model of one.

mod identity;
mod rezero;
mod run;
mod script;
mod talk;

pub use identity::Identity;
pub use rezero::RezeroSettings;
pub use run::talk_to;
pub use script::{UpdateSettings, Updated};
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
    /// The bus cannot be used, or the record of it.
    #[error("{0}")]
    Link(String),
    /// No node answers.
    #[error(
        "no controller answered for 3 s; is it on, and is the interface set to its bit rate (`ip -details link show`)?"
    )]
    NoAnswer,
    /// The node answers, but does not know these requests.
    #[error(
        "the controller does not say what it runs: its program is too old for this version, or it is `host-fit live`. Flash a \
         newer program, and parameters with `host-fit export` and a probe"
    )]
    TellsNothing,
    /// An answer that makes no sense here.
    #[error("the controller gave an unexpected answer: {}", outcome.map_or("unknown to this version".to_owned(), |outcome| format!("{outcome:?}")))]
    Unexpected {
        /// The answer.
        outcome: Option<Outcome>,
    },
    /// The blob, or the serial number asked for, belongs to another stage than the node.
    #[error(
        "the controller belongs to the stage `{found}`, not `{expected}`; nothing was sent to it. Name the blob of this stage, \
         or connect the other controller"
    )]
    OtherStage {
        /// Serial number of the blob, or of the request.
        expected: String,
        /// Serial number of the node.
        found: String,
    },
    /// A serial number was asked for, and the node has none.
    #[error(
        "the controller has no serial number, so it may not belong to the stage `{expected}`; nothing was sent to it. Leave \
         out --serial if it does"
    )]
    NoSerial {
        /// The serial number asked for.
        expected: String,
    },
    /// The node needs a tag.
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
        /// The answer.
        outcome: Outcome,
        /// Its detail: an axis, or a status.
        detail: u32,
    },
    /// The servo is on for the node.
    #[error("{}", match declared {
        false => "the servo may be on: switch it off and add --servo-off, which declares it off meanwhile",
        true => "the controller no longer takes the servo for off: it restarted, its service pin says on, another computer \
                 declared the servo on, or the declaration expired. Nothing was changed. Look at the stage; once the servo is \
                 off, try again",
    })]
    ServoOn {
        /// Whether it was declared off.
        declared: bool,
    },
    /// Another host is updating the node.
    #[error("another computer is updating this controller; try again when it has finished")]
    Busy,
    /// The node has no random numbers to authorise a request.
    #[error(
        "the random number generator of the controller gives no numbers, so it cannot authorise anything; restart it. If \
         that does not help, the generator or its clock is broken"
    )]
    NoRandomNumber,
    /// The tag is wrong.
    #[error(
        "the controller refuses this as not authorised: name the key of its stage with --key FILE. If you did, the key belongs \
         to another stage, or another computer is busy with this controller"
    )]
    NotAuthorised,
    /// The node refuses the blob.
    #[error("the controller refuses the parameters: {}", match kind {
        4 => "their layout is too new for its program; update the program first",
        7 => "they arrived damaged four times; look at the bus and its termination",
        10 => "they belong to another stage",
        _ => "its program does not accept them; update it, or fit again",
    })]
    BadContent {
        /// See [`BlobError::number`].
        kind: u32,
    },
    /// The supply is too low to write.
    #[error(
        "the supply of the controller is below 2.9 V, so nothing was written; its parameters stay in force"
    )]
    SupplyLow,
    /// The flash could not be written.
    #[error(
        "the controller could not write its flash. Its parameters stay in force; the parameters before them may be lost. Try \
         again; if it fails again, the flash is worn out"
    )]
    StoreFailed,
    /// There are no parameters to activate.
    #[error("the controller has no parameters to activate")]
    NothingKept,
    /// Too much is lost.
    #[error(
        "the controller lost the update again and again, or was restarted; look at the bus, its termination and its load"
    )]
    Lossy,
    /// No answer to the commit.
    #[error(
        "the controller stopped answering while it stored the parameters. It has the old or the new set, never a mixture: \
         `host-fit identify` shows which"
    )]
    Unknown,
    /// The new parameters are stored, but the node was not reset.
    #[error(
        "the parameters are stored as number {sequence}, but not active: the servo may be on again, or another computer is \
         updating. Once the servo is off and the other computer has finished, use `host-fit update --servo-off --activate`"
    )]
    NotActivated {
        /// Their sequence number.
        sequence: u32,
    },
    /// The new parameters do not run.
    #[error(
        "the parameters are stored as number {sequence}, but the controller does not run them, or stopped because its program \
         failed twice: see its state. To go back, update with the parameters before"
    )]
    NotActive {
        /// Their sequence number.
        sequence: u32,
    },
    /// Another host stored parameters after them.
    #[error(
        "the parameters are stored as number {sequence}, but another computer stored number {newest} after them: \
         `host-fit identify` shows which parameters the controller runs"
    )]
    Replaced {
        /// Their sequence number.
        sequence: u32,
        /// The newest sequence number.
        newest: u32,
    },
    /// The new parameters are stored, and then the node was silent.
    #[error(
        "the parameters are stored as number {sequence}, but the controller has not answered for 3 s since: is it on? \
         `host-fit identify` shows which parameters it runs"
    )]
    Silent {
        /// Their sequence number.
        sequence: u32,
    },
    /// There is no blob to read.
    #[error("the controller runs no parameters: there is nothing to read back")]
    NothingRuns,
    /// The blob that was read back is not sound.
    #[error("the parameters read back are damaged: {cause}; try again")]
    ReadBack {
        /// What is wrong with it.
        cause: BlobError,
    },
    /// The blob that was read back has another check than the running one.
    #[error("the controller's parameters changed while they were read: try again")]
    Changed,
    /// Ctrl-C.
    #[error("interrupted; the parameters of the controller are unchanged")]
    Interrupted,
}

impl UpdateError {
    /// The error of an outcome other than the expected one; `declared`: whether the servo was declared off.
    const fn from_outcome(outcome: Outcome, detail: u32, declared: bool) -> Self {
        match outcome {
            Outcome::ServoOn => Self::ServoOn { declared },
            // Another host has stored a blob since the newest number was asked.
            Outcome::Busy | Outcome::WrongSequence => Self::Busy,
            Outcome::UnknownCommand => Self::TellsNothing,
            Outcome::NoParameters => Self::NothingRuns,
            Outcome::NoRandomNumber => Self::NoRandomNumber,
            Outcome::NotAuthorised => Self::NotAuthorised,
            Outcome::BadContent => Self::BadContent { kind: detail },
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

/// Why a command to a node ended early.
#[derive(Debug, thiserror::Error)]
pub enum UpdateRunError {
    /// The bus cannot be used.
    #[error(transparent)]
    Bus(#[from] BusError),
    /// An error of the node, or of the dialog with it.
    #[error("{address}: {cause}")]
    Dialog {
        /// The node.
        address: BusAddress,
        /// The error.
        cause: UpdateError,
    },
}
