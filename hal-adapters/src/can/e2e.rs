//! End-to-end protection after AUTOSAR E2E Profile 2.
//!
//! Byte 0 of every frame is a CRC-8 (polynomial 0x2F, start 0xFF, final XOR 0xFF), computed over
//! bytes 1 to 7 and then over one byte that is never sent: the data ID. The low nibble of
//! byte 1 is a counter, which each frame of a message raises by one, from 15 back to 0.
//! Profile 2 takes the data ID from a list of sixteen, by the counter. Every message has its
//! own list, so a frame under the identifier of another message fails its check.
//!
//! The list must not be chosen at random. A flipped bit of the counter also changes the data ID,
//! and the polynomial then no longer finds all patterns of three flipped bits; and because the
//! check comes before the data, three bursts of eight bits would pass. [`BASE_LIST`] is the
//! result of a search: at every counter, no pattern of up to three flipped bits and no burst of
//! up to eight in the 64 data bits passes; a test tries all of them. The list of a message is
//! the base list XOR its key. This keeps the property, which depends on differences only.
//!
//! | here | Profile 2 |
//! |---|---|
//! | [`Verdict::First`] | INITIAL |
//! | [`Verdict::Next`] | OK |
//! | [`Verdict::Lost`] | OKSOMELOST |
//! | [`Verdict::Repeated`] | REPEATED |
//! | [`Verdict::WrongSequence`] | WRONGSEQUENCE |
//! | [`Verdict::Resumed`] | SYNC, concluded |
//! | failed check | WRONGCRC |
//! | [`Stale`](BusFault::Stale) | NONEWDATA |

use super::notice::{BusFault, open};
use super::table::Message;
use crc::{CRC_8_AUTOSAR, Crc};

/// The 52 bits of a protected frame besides check and counter.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Payload {
    /// Bits 12 to 31 of the frame: the high nibble of byte 1, then bytes 2 and 3. The upper
    /// 12 bits of this word are not sent.
    pub short: u32,
    /// Bits 32 to 63 of the frame: bytes 4 to 7, lowest first.
    pub long: u32,
}

impl Payload {
    /// From [`Payload::short`] and [`Payload::long`].
    pub const fn new(short: u32, long: u32) -> Self {
        Self { short, long }
    }
}

/// Bits of [`Payload::short`].
pub(super) const SHORT_BITS: u32 = 20;

/// The data IDs of the message with key 0, by counter. See the module.
pub const BASE_LIST: [u8; 16] = [
    0, 48, 53, 119, 226, 9, 20, 141, 96, 249, 252, 190, 130, 105, 221, 237,
];

/// CRC-8 with polynomial 0x2F: the register after eight bits, for each value before them.
const TABLE: [u8; 256] = Crc::<u8>::new(&CRC_8_AUTOSAR).table()[0];

/// One byte through the register.
#[inline(always)]
const fn step(register: u8, byte: u8) -> u8 {
    TABLE[(register ^ byte) as usize]
}

/// The check over bytes 1 to 7 of a frame and a data ID. `low` holds bytes 0 to 3 and `high`
/// bytes 4 to 7, lowest first.
#[inline(always)]
const fn check_byte(low: u32, high: u32, data_id: u8) -> u8 {
    let head = step(0xff, (low >> 8) as u8);
    let head = step(step(head, (low >> 16) as u8), (low >> 24) as u8);
    let tail = step(step(head, high as u8), (high >> 8) as u8);
    let tail = step(step(tail, (high >> 16) as u8), (high >> 24) as u8);
    step(tail, data_id) ^ 0xff
}

/// The data ID of the message with this key at this counter (its low nibble).
#[inline(always)]
const fn data_id(key: u8, counter: u8) -> u8 {
    BASE_LIST[(counter & 0xf) as usize] ^ key
}

/// The eight bytes of a frame. Only the low nibble of `counter` is used.
#[inline(always)]
pub const fn protect(key: u8, counter: u8, payload: Payload) -> [u8; 8] {
    let counter = counter & 0xf;
    let low = payload.short << 12 | (counter as u32) << 8;
    let check = check_byte(low, payload.long, data_id(key, counter));
    ((payload.long as u64) << 32 | (low | check as u32) as u64).to_le_bytes()
}

/// Counter and payload of a frame of the message with this key, or `None` if its check fails.
#[inline(always)]
pub const fn unprotect(key: u8, bytes: &[u8; 8]) -> Option<(u8, Payload)> {
    let word = u64::from_le_bytes(*bytes);
    let (low, high) = (word as u32, (word >> 32) as u32);
    let counter = (low >> 8 & 0xf) as u8;
    if check_byte(low, high, data_id(key, counter)) != low as u8 {
        return None;
    }
    let payload = Payload::new(low >> 12, high);
    Some((counter, payload))
}

/// What the counter of a frame with a correct check means.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// The first frame of this message: used.
    First,
    /// The counter follows the last one: used.
    Next,
    /// Frames are missing before this frame: used.
    Lost {
        /// Missing frames, 1 to [`LOST_MAX`].
        frames: u8,
    },
    /// The counter of the last frame again: not used.
    Repeated,
    /// Any other counter: a frame that came late, a sender that restarted, or a longer gap.
    /// Not used.
    WrongSequence {
        /// Distance to the last used counter, modulo 16.
        ahead: u8,
    },
    /// The second of two successive frames after a break in the sequence: used.
    Resumed,
}

impl Verdict {
    /// Whether the frame's data may be used.
    pub const fn is_used(self) -> bool {
        !matches!(self, Self::Repeated | Self::WrongSequence { .. })
    }

    /// What is wrong with a frame of `message` and this verdict, or missing before it.
    pub const fn fault(self, message: Message) -> Option<BusFault> {
        match self {
            Self::First | Self::Next | Self::Resumed => None,
            Self::Lost { frames } => Some(BusFault::Lost { message, frames }),
            Self::Repeated => Some(BusFault::Repeated { message }),
            Self::WrongSequence { ahead } => Some(BusFault::WrongSequence { message, ahead }),
        }
    }
}

/// The most missing frames in a row after which the next is still used.
pub const LOST_MAX: u8 = 2;

/// The counters of one message, at its receiver.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sequence {
    /// That of the last frame used.
    last: u8,
    /// That of the last frame out of sequence: its successor is used.
    candidate: u8,
}

/// Stands for no counter.
const NO_COUNTER: u8 = 0xff;

impl Sequence {
    /// Before the first frame.
    pub const START: Self = Self {
        last: NO_COUNTER,
        candidate: NO_COUNTER,
    };

    /// Notes the counter of a frame with a correct check if it follows the last one; otherwise
    /// returns `false` and changes nothing.
    #[inline(always)]
    pub(super) const fn follow(&mut self, counter: u8) -> bool {
        // Never true of `NO_COUNTER`.
        let follows = self.last == counter.wrapping_sub(1) & 0xf;
        if follows {
            self.last = counter;
            self.candidate = NO_COUNTER;
        }
        follows
    }

    /// Takes a frame of a message that is sent alone: its payload, if it may be used, and what is
    /// wrong with it or missing before it.
    pub(super) fn take(
        &mut self,
        message: Message,
        data: &[u8],
    ) -> (Option<Payload>, Option<BusFault>) {
        match open(message, data) {
            Ok((counter, payload)) => {
                let verdict = self.judge(counter);
                let payload = verdict.is_used().then_some(payload);
                (payload, verdict.fault(message))
            }
            Err(fault) => (None, Some(fault)),
        }
    }

    /// Judges the counter, 0 to 15, of a frame with a correct check.
    pub const fn judge(&mut self, counter: u8) -> Verdict {
        if self.follow(counter) {
            return Verdict::Next;
        }
        let ahead = counter.wrapping_sub(self.last) & 0xf;
        let verdict = if self.last == NO_COUNTER {
            Verdict::First
        } else if ahead == 0 {
            return Verdict::Repeated;
        } else if ahead <= LOST_MAX + 1 {
            Verdict::Lost { frames: ahead - 1 }
        } else if self.candidate != NO_COUNTER && counter.wrapping_sub(self.candidate) & 0xf == 1 {
            Verdict::Resumed
        } else {
            self.candidate = counter;
            return Verdict::WrongSequence { ahead };
        };
        self.last = counter;
        self.candidate = NO_COUNTER;
        verdict
    }
}

#[cfg(test)]
#[path = "e2e_tests.rs"]
mod tests;
