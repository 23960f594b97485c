//! Requests to the decoding node, its answers, and all other messages that are not sent in every tick.
//! [`Mailbox`] numbers the frames that are sent and checks the frames that are received.
//!
//! ```
//! use hal_adapters::can::BusFrame;
//! use hal_adapters::can::command::{Command, Content, Mailbox, Request};
//!
//! let request = Content::Command(Command::new(Request::Rezero { ticks: 500 }, 17));
//! let (mut host, mut node) = (Mailbox::default(), Mailbox::default());
//! let sent = host.send(&request).map(BusFrame::from).unwrap();
//! assert_eq!(node.take(&sent), Some(Ok(request)));
//! ```

use super::e2e::Payload;
use super::frame::{Coded, standard};
use super::notice::{BusFault, open};
use super::status::{HealthPage, NodeStatus};
use super::table::Message;
use super::update::{UpdateData, UpdateRequest};
use embedded_can::Frame;
use runtime::zero_offset::ZeroOffsetRefusal;

/// A request to a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Request {
    /// Average `ticks` ticks at rest, and subtract the mean from then on; 0 stands for the default of
    /// [`runtime::zero_offset::ZeroOffsetSettings`].
    Rezero {
        /// Ticks to average.
        ticks: u16,
    },
    /// Blink.
    Identify {
        /// How long, s.
        seconds: u8,
    },
    /// Stop subtracting the mean of a re-zero.
    ClearZero,
    /// Send the codes of every tick, or stop.
    Record {
        /// Whether codes are sent from now on.
        on: bool,
    },
    /// Declare the servo off: the stage may be re-zeroed.
    ServoOff {
        /// How long the declaration holds, s; 0 declares the servo on.
        seconds: u8,
    },
    /// About the parameters.
    Update(UpdateRequest),
}

impl Request {
    /// Its number and its argument.
    const fn in_frame(self) -> (u8, u32) {
        match self {
            Self::Rezero { ticks } => (1, ticks as u32),
            Self::Identify { seconds } => (2, seconds as u32),
            Self::ClearZero => (3, 0),
            Self::Record { on } => (4, on as u32),
            Self::ServoOff { seconds } => (5, seconds as u32),
            Self::Update(request) => request.in_frame(),
        }
    }
}

/// A request with the token of its answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Command {
    /// The request; `None` for one that this version does not know.
    pub request: Option<Request>,
    /// Number of the command in the frame, 0 to 15.
    pub number: u8,
    /// Chosen by the sender anew each time; all requests of one transfer have the same token.
    pub token: u8,
}

impl Command {
    /// A command.
    pub const fn new(request: Request, token: u8) -> Self {
        let (number, _) = request.in_frame();
        Self {
            request: Some(request),
            number,
            token,
        }
    }

    /// Whether it moves the pose, invalidates it, resets the node, or prepares one of these. A node with a
    /// key obeys such a request only with a tag ([`super::update::tag`]), a controller without a key only
    /// while its line says that the servo is off. (The tag of a commit covers the blob, so the receiver
    /// checks it.)
    pub const fn needs_authority(&self) -> bool {
        match self.request {
            Some(Request::Rezero { .. } | Request::ClearZero | Request::Record { .. }) => true,
            // Anyone may say that the servo is on.
            Some(Request::ServoOff { seconds }) => seconds > 0,
            Some(Request::Update(request)) => matches!(
                request,
                UpdateRequest::Begin { .. } | UpdateRequest::Activate
            ),
            Some(Request::Identify { .. }) | None => false,
        }
    }

    /// The 52 bits of the frame.
    pub const fn payload(&self) -> Payload {
        let long = match self.request {
            Some(request) => request.in_frame().1,
            None => 0,
        };
        Payload::new((self.token as u32) << 4 | (self.number & 0xf) as u32, long)
    }

    /// From the 52 bits of a frame.
    pub fn from_payload(p: Payload) -> Self {
        let number = (p.short & 0xf) as u8;
        let ticks = u16::try_from(p.long).ok();
        let seconds = u8::try_from(p.long).ok();
        let request = match (number, p.long) {
            (1, _) => ticks.map(|ticks| Request::Rezero { ticks }),
            (2, _) => seconds.map(|seconds| Request::Identify { seconds }),
            (3, 0) => Some(Request::ClearZero),
            (4, 0 | 1) => Some(Request::Record { on: p.long == 1 }),
            (5, _) => seconds.map(|seconds| Request::ServoOff { seconds }),
            _ => UpdateRequest::from_frame(number, p.long).map(Request::Update),
        };
        Self {
            request,
            number,
            token: (p.short >> 4) as u8,
        }
    }
}

numbered! {
    /// How a request ended, by its number in the frame.
    Outcome {
        /// It was done.
        Done = 0,
        /// It is running; another answer follows.
        Started = 1,
        /// This node does not know the request.
        UnknownCommand = 2,
        /// There is no usable parameter blob.
        NoParameters = 3,
        /// Too few ticks.
        TooShort = 4,
        /// A tick had no pose; the detail is its status.
        NoPose = 5,
        /// The stage moved; the detail is the axis.
        Moved = 6,
        /// The stage drifted; the detail is the axis.
        Drifted = 7,
        /// Another request is still running.
        Busy = 8,
        /// The servo is on, or was not declared off.
        ServoOn = 9,
        /// The zero would lie too far away; the detail is the axis.
        OutOfBounds = 10,
        /// A pose lay outside the calibrated range; the detail is its status.
        Extrapolated = 11,
        /// The tag is missing, or was not made with the stage's key.
        NotAuthorised = 12,
        /// The blob is refused; the detail is [`runtime::BlobError::number`].
        BadContent = 13,
        /// The sequence number is not the next one; the detail is the next one.
        WrongSequence = 14,
        /// The supply is too low to write, and the store is unchanged.
        SupplyLow = 15,
        /// Words are missing; the detail is the index of the first.
        Incomplete = 16,
        /// The store failed. The parameters before stay in force.
        StoreFailed = 17,
        /// No transfer is open with this token: never begun, aborted, or silent for 5 s.
        NoTransfer = 18,
        /// The random number generator gives no number, so nothing can be authorised.
        NoRandomNumber = 19,
    }
}

impl Outcome {
    /// Outcome and detail of a refused re-zero.
    pub fn from_refusal(refusal: &ZeroOffsetRefusal) -> (Self, u32) {
        match *refusal {
            ZeroOffsetRefusal::TooShort { .. } => (Self::TooShort, 0),
            ZeroOffsetRefusal::NoPose { status } => (Self::NoPose, status.bits()),
            ZeroOffsetRefusal::Moved { axis, .. } => (Self::Moved, u32::from(axis)),
            ZeroOffsetRefusal::Drifted { axis, .. } => (Self::Drifted, u32::from(axis)),
            ZeroOffsetRefusal::OutOfBounds { axis, .. } => (Self::OutOfBounds, u32::from(axis)),
            ZeroOffsetRefusal::Extrapolated { status } => (Self::Extrapolated, status.bits()),
        }
    }
}

/// The answer to a command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Answer {
    /// Number of the command.
    pub number: u8,
    /// Its token.
    pub token: u8,
    /// How it ended; `None` for a number that this version does not know.
    pub outcome: Option<Outcome>,
    /// See [`Outcome`].
    pub detail: u32,
}

impl Answer {
    /// The 52 bits of the frame. An outcome of `None` is sent as 255.
    pub const fn payload(&self) -> Payload {
        let outcome = match self.outcome {
            Some(outcome) => outcome as u32,
            None => 0xff,
        };
        Payload::new(
            outcome << 12 | (self.token as u32) << 4 | (self.number & 0xf) as u32,
            self.detail,
        )
    }

    /// From the 52 bits of a frame.
    pub fn from_payload(p: Payload) -> Self {
        Self {
            number: (p.short & 0xf) as u8,
            token: (p.short >> 4) as u8,
            outcome: Outcome::ALL.get((p.short >> 12 & 0xff) as usize).copied(),
            detail: p.long,
        }
    }
}

/// The content of an occasional frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Content {
    /// State of the decoding node.
    Status(NodeStatus),
    /// One of its counters.
    Health(HealthPage),
    /// A request.
    Command(Command),
    /// The answer to one.
    Answer(Answer),
    /// A word of an update.
    UpdateData(UpdateData),
}

impl Content {
    const MESSAGES: [Message; 5] = [
        Message::NodeStatus,
        Message::Health,
        Message::Command,
        Message::Answer,
        Message::UpdateData,
    ];

    fn payload(&self) -> (usize, Payload) {
        match self {
            Self::Status(x) => (0, x.payload()),
            Self::Health(x) => (1, x.payload()),
            Self::Command(x) => (2, x.payload()),
            Self::Answer(x) => (3, x.payload()),
            Self::UpdateData(x) => (4, x.payload()),
        }
    }

    fn read(k: usize, p: Payload) -> Self {
        match k {
            0 => Self::Status(NodeStatus::from_payload(p)),
            1 => Self::Health(HealthPage::from_payload(p)),
            2 => Self::Command(Command::from_payload(p)),
            3 => Self::Answer(Answer::from_payload(p)),
            _ => Self::UpdateData(UpdateData::from_payload(p)),
        }
    }
}

/// Numbers and checks the occasional frames of one node.
#[derive(Clone, Copy, Debug, Default)]
pub struct Mailbox {
    sent: [u8; 5],
    /// Counter and payload of the last frame of each message.
    received: [Option<(u8, Payload)>; 5],
}

impl Mailbox {
    /// The frame with this content.
    pub fn send(&mut self, content: &Content) -> Option<Coded> {
        let (k, payload) = content.payload();
        let (message, counter) = (*Content::MESSAGES.get(k)?, self.sent.get_mut(k)?);
        let coded = Coded::new(message, u32::from(*counter), payload);
        *counter = counter.wrapping_add(1);
        Some(coded)
    }

    /// The content of a frame; `None` for a frame of another kind.
    ///
    /// These messages have no fixed rate, so a gap in the counter is no fault, and neither is a sender that
    /// restarts. A frame that equals the last one bit for bit is a fault: a program that sends one request
    /// and ends must choose a different token each time.
    pub fn take<F: Frame>(&mut self, frame: &F) -> Option<Result<Content, BusFault>> {
        let (id, data) = standard(frame)?;
        let k = Content::MESSAGES.iter().position(|m| m.id() == id)?;
        let (message, last) = (*Content::MESSAGES.get(k)?, self.received.get_mut(k)?);
        let opened = match open(message, data) {
            Ok(opened) => opened,
            Err(fault) => return Some(Err(fault)),
        };
        if last.replace(opened) == Some(opened) {
            return Some(Err(BusFault::Repeated { message }));
        }
        Some(Ok(Content::read(k, opened.1)))
    }
}

#[cfg(test)]
#[path = "command_tests.rs"]
mod tests;
