//! What a receiver reports: ticks, and faults of frames and of the source, which it counts.

use super::e2e::{Payload, unprotect};
use super::table::{FRAME_BYTES, Message};

/// Time limits of a receiver, us, below 2^30.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Timing {
    /// A tick is handed out this long after its first frame, complete or not.
    pub assembly_us: u32,
    /// The source is stale when no good frame came for this long.
    pub stale_us: u32,
}

impl Default for Timing {
    /// For a servo period of 2 ms: half a period, and one and a half. A receiver that is polled
    /// every millisecond then reports a silent source within 4 ms.
    fn default() -> Self {
        Self {
            assembly_us: 1_000,
            stale_us: 3_000,
        }
    }
}

/// What is wrong with a frame, or with a source that sends none.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum BusFault {
    /// Not eight bytes, or a remote frame.
    #[error("{}: {bytes} bytes instead of 8", message.name())]
    WrongLength {
        /// Which message.
        message: Message,
        /// Its data length.
        bytes: u8,
    },
    /// The check fails: the frame is damaged, or belongs to another message.
    #[error("{}: check fails", message.name())]
    WrongCheck {
        /// Which message.
        message: Message,
    },
    /// The last frame again.
    #[error("{}: repeated", message.name())]
    Repeated {
        /// Which message.
        message: Message,
    },
    /// The counter neither repeats nor follows the last one: late, or after a long gap.
    #[error("{}: counter {ahead} ahead", message.name())]
    WrongSequence {
        /// Which message.
        message: Message,
        /// Distance to the last used counter, modulo 16.
        ahead: u8,
    },
    /// Frames are missing before this frame. This frame is used.
    #[error("{}: {frames} lost", message.name())]
    Lost {
        /// Which message.
        message: Message,
        /// How many.
        frames: u8,
    },
    /// The frame is good, but its tick was handed out before.
    #[error("{}: late", message.name())]
    Late {
        /// Which message.
        message: Message,
    },
    /// A multiple of 16 ticks is missing, by the sensor node's own count.
    #[error("{ticks} ticks lost")]
    TicksLost {
        /// How many.
        ticks: u32,
    },
    /// The sensor node restarted: its count of ticks began again.
    #[error("the sensor node started again")]
    SenderRestarted,
    /// No good frame for [`Timing::stale_us`].
    #[error("stale: no good frame for {age_us} us")]
    Stale {
        /// Age of the last good frame, us.
        age_us: u32,
    },
}

/// Counter and payload of a frame of `message`, from its data.
///
/// # Errors
/// [`BusFault::WrongLength`] and [`BusFault::WrongCheck`].
#[inline(always)]
pub(super) fn open(message: Message, data: &[u8]) -> Result<(u8, Payload), BusFault> {
    match data.first_chunk::<FRAME_BYTES>() {
        Some(bytes) if data.len() == FRAME_BYTES => {
            unprotect(message.key(), bytes).ok_or(BusFault::WrongCheck { message })
        }
        _ => {
            let bytes = data.len() as u8;
            Err(BusFault::WrongLength { message, bytes })
        }
    }
}

/// Counters of a receiver since start. They saturate.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BusHealth {
    /// Frames that were used.
    pub good: u32,
    /// Frames of a wrong length.
    pub wrong_length: u32,
    /// Frames with a failed check.
    pub wrong_check: u32,
    /// Repeated frames.
    pub repeated: u32,
    /// Frames out of sequence.
    pub wrong_sequence: u32,
    /// Frames that are missing according to the counters.
    pub lost: u32,
    /// Good frames of a tick that was already handed out.
    pub late: u32,
    /// Ticks handed out with a frame missing.
    pub incomplete: u32,
    /// How often the source went stale.
    pub stale: u32,
}

impl BusHealth {
    /// All counters at zero.
    pub(super) const NONE: Self = Self {
        good: 0,
        wrong_length: 0,
        wrong_check: 0,
        repeated: 0,
        wrong_sequence: 0,
        lost: 0,
        late: 0,
        incomplete: 0,
        stale: 0,
    };

    pub(super) fn count(&mut self, fault: &BusFault) {
        let (field, by) = match fault {
            BusFault::WrongLength { .. } => (&mut self.wrong_length, 1),
            BusFault::WrongCheck { .. } => (&mut self.wrong_check, 1),
            BusFault::Repeated { .. } => (&mut self.repeated, 1),
            BusFault::WrongSequence { .. } => (&mut self.wrong_sequence, 1),
            BusFault::Lost { frames, .. } => (&mut self.lost, u32::from(*frames)),
            BusFault::Late { .. } => (&mut self.late, 1),
            BusFault::TicksLost { ticks } => (&mut self.lost, *ticks),
            BusFault::SenderRestarted => return,
            BusFault::Stale { .. } => (&mut self.stale, 1),
        };
        *field = field.saturating_add(by);
    }
}

/// What a frame, or the passing of time, gave.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Taken<T> {
    /// A tick that is over.
    pub tick: Option<T>,
    /// What is wrong with the frame that was taken, or with the source.
    pub fault: Option<BusFault>,
}

impl<T> Taken<T> {
    pub(super) const NOTHING: Self = Self {
        tick: None,
        fault: None,
    };

    #[inline(always)]
    pub(super) fn map<U>(self, f: impl FnOnce(T) -> U) -> Taken<U> {
        Taken {
            tick: self.tick.map(f),
            fault: self.fault,
        }
    }
}
