//! A source that drops, repeats, delays and damages what another source gives: for tests of
//! whatever reads it. The same seed gives the same faults.
//!
//! ```
//! use hal_adapters::fault::{Fault, FaultRates, Faulty};
//! use hal_adapters::source::{FrameSource, SliceSource};
//! # use hal_adapters::can::{BusFrame, StampedFrame, Message};
//! # use embedded_can::Frame;
//! # let frame = BusFrame::new(Message::Hall.id(), &[0; 8]).unwrap();
//! # let frames = [StampedFrame { time_us: 0, frame }; 100];
//! let rates = FaultRates::NONE.with(Fault::Drop, 100_000); // one frame in ten
//! let mut source = Faulty::new(SliceSource::new(&frames), rates, 1);
//! let mut got = 0;
//! while source.next_frame().unwrap().is_some() { got += 1; }
//! assert_eq!(got + source.injected(Fault::Drop), 100);
//! ```

use crate::can::{BusFrame, Message, StampedFrame};
use crate::source::FrameSource;
use embedded_can::{Frame, Id, StandardId};
use runtime::RawFrame;
use runtime::frame::MISSING_CODE;

/// What can happen to a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// It does not come.
    Drop,
    /// It comes twice.
    Repeat,
    /// It changes places with the next one.
    Swap,
    /// It comes after the next 2 to 9 frames.
    Delay,
    /// One to three of its bits are flipped.
    Flip,
    /// A burst of 2 to 8 bits, both ends flipped.
    Burst,
    /// All its bits are random.
    Noise,
    /// It has another length.
    WrongLength,
    /// It has the identifier of another message, or a foreign one.
    WrongId,
}

impl Fault {
    /// Every fault, in the order of [`FaultRates`].
    pub const ALL: [Self; 9] = [
        Self::Drop,
        Self::Repeat,
        Self::Swap,
        Self::Delay,
        Self::Flip,
        Self::Burst,
        Self::Noise,
        Self::WrongLength,
        Self::WrongId,
    ];
}

/// How often each fault happens, per million frames; at most one happens to a frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FaultRates {
    per_million: [u32; 9],
}

impl FaultRates {
    /// No faults.
    pub const NONE: Self = Self {
        per_million: [0; 9],
    };

    /// Every fault as often.
    pub const fn each(per_million: u32) -> Self {
        Self {
            per_million: [per_million; 9],
        }
    }

    /// These rates with another one for `fault`.
    #[must_use]
    pub const fn with(mut self, fault: Fault, per_million: u32) -> Self {
        self.per_million[fault as usize] = per_million;
        self
    }

    fn draw(&self, random: u64) -> Option<Fault> {
        let mut below = random % 1_000_000;
        for (fault, rate) in Fault::ALL.into_iter().zip(self.per_million) {
            let rate = u64::from(rate);
            if below < rate {
                return Some(fault);
            }
            below -= rate;
        }
        None
    }
}

/// A frame that can be damaged. `random` decides how, all its bits alike.
pub trait Damage: Clone {
    /// A damaged copy; only called for faults that change the frame itself (`Flip` to
    /// `WrongId`).
    #[must_use]
    fn damaged(&self, fault: Fault, random: &mut Random) -> Self;
}

/// Random numbers that depend on the seed alone (SplitMix64).
#[derive(Clone, Debug)]
pub struct Random(u64);

impl Random {
    /// The sequence of a seed.
    pub const fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// The next 64 bits.
    pub const fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ self.0 >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ z >> 31
    }

    /// A number from 0 to `n - 1`; 0 for n = 0.
    pub const fn below(&mut self, n: u64) -> u64 {
        let bits = self.bits();
        match bits.checked_rem(n) {
            Some(rest) => rest,
            None => 0,
        }
    }

    /// A mask of one to three bits, or of a burst of 2 to 8 bits with both ends set.
    fn mask(&mut self, fault: Fault) -> u64 {
        if fault == Fault::Burst {
            let length = 2 + self.below(7);
            let inner = self.bits() & ((1 << (length - 1)) - 1);
            let pattern = 1 | 1 << (length - 1) | inner;
            return pattern << self.below(64 - length + 1);
        }
        let flips = 1 + self.below(3);
        let mut mask: u64 = 0;
        while u64::from(mask.count_ones()) < flips {
            mask |= 1 << self.below(64);
        }
        mask
    }
}

impl Damage for BusFrame {
    fn damaged(&self, fault: Fault, random: &mut Random) -> Self {
        match fault {
            Fault::Flip | Fault::Burst => self.flipped(random.mask(fault)),
            Fault::Noise => self.flipped(random.bits()),
            Fault::WrongLength => {
                let shorter = random.below(8);
                self.resized(if self.dlc() == 8 { shorter as u8 } else { 8 })
            }
            Fault::WrongId => {
                let ours = Message::from_id(self.id);
                let other = if random.below(2) == 0 {
                    let k = random.below(crate::can::table::TABLE.len() as u64) as usize;
                    crate::can::table::TABLE.get(k).map(|row| row.message.id())
                } else {
                    StandardId::new(random.below(0x800) as u16)
                };
                let other = other.filter(|id| Message::from_id(Id::Standard(*id)) != ours);
                self.renamed(other.unwrap_or(StandardId::ZERO))
            }
            Fault::Drop | Fault::Repeat | Fault::Swap | Fault::Delay => *self,
        }
    }
}

impl Damage for StampedFrame {
    fn damaged(&self, fault: Fault, random: &mut Random) -> Self {
        Self {
            frame: self.frame.damaged(fault, random),
            ..*self
        }
    }
}

/// Damage to whole ticks: bits of one code (of 16), a code that is missing for a wrong
/// length, two codes exchanged for a wrong identifier.
impl Damage for RawFrame {
    fn damaged(&self, fault: Fault, random: &mut Random) -> Self {
        let mut damaged = *self;
        let which = random.below(6);
        let codes = if which < 3 {
            &mut damaged.hall
        } else {
            &mut damaged.capacitive
        };
        let [first, second, third] = codes;
        let code = match which % 3 {
            0 => first,
            1 => second,
            _ => third,
        };
        match fault {
            Fault::Flip => *code ^= 1 << random.below(16),
            Fault::Burst => *code ^= (random.mask(fault) % 255 + 1) as i32,
            Fault::Noise => *code = random.bits() as i16 as i32,
            Fault::WrongLength => *code = MISSING_CODE,
            Fault::WrongId => codes.rotate_left(1),
            Fault::Drop | Fault::Repeat | Fault::Swap | Fault::Delay => {}
        }
        damaged
    }
}

/// Injects faults into a source.
#[derive(Clone, Debug)]
pub struct Faulty<S: FrameSource> {
    source: S,
    rates: FaultRates,
    random: Random,
    held: Option<(u8, S::Frame)>,
    again: Option<S::Frame>,
    injected: [u32; 9],
    last: Option<Fault>,
}

impl<S: FrameSource<Frame: Damage>> Faulty<S> {
    /// Wraps a source.
    pub const fn new(source: S, rates: FaultRates, seed: u64) -> Self {
        Self {
            source,
            rates,
            random: Random::new(seed),
            held: None,
            again: None,
            injected: [0; 9],
            last: None,
        }
    }

    /// How often a fault was injected.
    pub const fn injected(&self, fault: Fault) -> u32 {
        self.injected[fault as usize]
    }

    /// The fault that was injected last by the last call of `next_frame`, if any.
    pub const fn last_fault(&self) -> Option<Fault> {
        self.last
    }

    /// The wrapped source.
    pub fn into_inner(self) -> S {
        self.source
    }

    /// A frame that is due from an earlier fault.
    fn due(&mut self) -> Option<S::Frame> {
        if let Some(frame) = self.again.take() {
            return Some(frame);
        }
        match self.held.take() {
            Some((0, frame)) => Some(frame),
            other => {
                self.held = other;
                None
            }
        }
    }

    fn inject(&mut self, fault: Fault, frame: S::Frame) -> Option<S::Frame> {
        // One frame can be held at a time; a second one passes.
        if matches!(fault, Fault::Swap | Fault::Delay) && self.held.is_some() {
            return Some(frame);
        }
        self.last = Some(fault);
        let count = &mut self.injected[fault as usize];
        *count = count.saturating_add(1);
        match fault {
            Fault::Drop => None,
            Fault::Repeat => {
                self.again = Some(frame.clone());
                Some(frame)
            }
            Fault::Swap => {
                self.held = Some((1, frame));
                None
            }
            Fault::Delay => {
                let after = 2 + self.random.below(8) as u8;
                self.held = Some((after, frame));
                None
            }
            _ => Some(frame.damaged(fault, &mut self.random)),
        }
    }
}

impl<S: FrameSource<Frame: Damage>> FrameSource for Faulty<S> {
    type Frame = S::Frame;
    type Error = S::Error;

    fn next_frame(&mut self) -> Result<Option<S::Frame>, S::Error> {
        self.last = None;
        if let Some(frame) = self.due() {
            return Ok(Some(frame));
        }
        loop {
            let Some(frame) = self.source.next_frame()? else {
                // At the end nothing overtakes a held frame any more.
                return Ok(self.held.take().map(|(_, frame)| frame));
            };
            let frame = match self.rates.draw(self.random.bits()) {
                Some(fault) => self.inject(fault, frame),
                None => Some(frame),
            };
            if let Some(frame) = frame {
                if let Some((left, _)) = &mut self.held {
                    *left = left.saturating_sub(1);
                }
                return Ok(Some(frame));
            }
        }
    }
}

#[cfg(test)]
#[path = "fault_tests.rs"]
mod tests;
