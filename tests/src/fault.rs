//! Bus frames dropped, repeated, delayed and damaged on the way: for tests of whatever receives
//! them. The same seed gives the same faults.
//!
//! ```
//! use embedded_can::Frame;
//! use hal_adapters::can::{BusFrame, Message, StampedFrame};
//! use tests::fault::{Fault, FaultRates, Faulty};
//!
//! let frame = BusFrame::new(Message::Hall.id(), &[0; 8]).unwrap();
//! let frames = [StampedFrame { time_us: 0, frame }; 100];
//! let rates = FaultRates::NONE.with(Fault::Drop, 100_000); // one frame in ten
//! let mut faulty = Faulty::new(frames.into_iter(), rates, 1);
//! let got = faulty.by_ref().count() as u32;
//! assert_eq!(got + faulty.injected(Fault::Drop), 100);
//! ```

use crate::random::Random;
use embedded_can::{Frame, Id, StandardId};
use hal_adapters::can::table::TABLE;
use hal_adapters::can::{BusFrame, Message, StampedFrame};

/// What can happen to a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// It does not come.
    Drop,
    /// It comes twice.
    Repeat,
    /// It changes places with the next frame.
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
    /// Every one.
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

    /// Every fault at the same rate.
    pub const fn each(per_million: u32) -> Self {
        Self {
            per_million: [per_million; 9],
        }
    }

    /// These rates, with a different one for `fault`.
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

/// A mask of one to three bits, or of a burst of 2 to 8 bits with both ends set.
fn mask(random: &mut Random, fault: Fault) -> u64 {
    if fault == Fault::Burst {
        let length = 2 + random.below(7);
        let inner = random.bits() & ((1 << (length - 1)) - 1);
        let pattern = 1 | 1 << (length - 1) | inner;
        return pattern << random.below(64 - length + 1);
    }
    let flips = 1 + random.below(3);
    let mut mask: u64 = 0;
    while u64::from(mask.count_ones()) < flips {
        mask |= 1 << random.below(64);
    }
    mask
}

/// A damaged copy, as `random` decides. Only `Flip` to `WrongId` change the frame itself.
#[must_use]
pub fn damaged(frame: &BusFrame, fault: Fault, random: &mut Random) -> BusFrame {
    match fault {
        Fault::Flip | Fault::Burst => flipped(frame, mask(random, fault)),
        Fault::Noise => flipped(frame, random.bits()),
        Fault::WrongLength => {
            let shorter = random.below(8) as usize;
            resized(frame, if frame.dlc() == 8 { shorter } else { 8 })
        }
        Fault::WrongId => {
            let ours = Message::from_id(frame.id());
            let other = if random.below(2) == 0 {
                let k = random.below(TABLE.len() as u64) as usize;
                TABLE.get(k).map(|row| row.message.id())
            } else {
                StandardId::new(random.below(0x800) as u16)
            };
            let other = other.filter(|id| Message::from_id(Id::Standard(*id)) != ours);
            renamed(frame, other.unwrap_or(StandardId::ZERO))
        }
        Fault::Drop | Fault::Repeat | Fault::Swap | Fault::Delay => *frame,
    }
}

/// The same frame with its bytes XOR `mask`, whose most significant byte falls on byte 0.
pub fn flipped(frame: &BusFrame, mask: u64) -> BusFrame {
    let mut data = [0; 8];
    for (to, (from, mask)) in data
        .iter_mut()
        .zip(frame.data().iter().zip(mask.to_be_bytes()))
    {
        *to = from ^ mask;
    }
    made(frame.id(), &data[..frame.dlc()])
}

/// The same frame cut or padded with zeros to `length` bytes.
fn resized(frame: &BusFrame, length: usize) -> BusFrame {
    let mut data = [0; 8];
    data[..frame.dlc()].copy_from_slice(frame.data());
    made(frame.id(), &data[..length])
}

fn renamed(frame: &BusFrame, id: StandardId) -> BusFrame {
    made(id.into(), frame.data())
}

fn made(id: Id, data: &[u8]) -> BusFrame {
    BusFrame::new(id, data).expect("at most 8 bytes")
}

/// Injects faults into a stream of frames.
#[derive(Clone, Debug)]
pub struct Faulty<I> {
    frames: I,
    rates: FaultRates,
    random: Random,
    /// A frame that is held back, and the number of frames that still pass it.
    held: Option<(u8, StampedFrame)>,
    again: Option<StampedFrame>,
    injected: [u32; 9],
}

impl<I: Iterator<Item = StampedFrame>> Faulty<I> {
    /// Faults at these rates, drawn by `seed`.
    pub const fn new(frames: I, rates: FaultRates, seed: u64) -> Self {
        Self {
            frames,
            rates,
            random: Random::new(seed),
            held: None,
            again: None,
            injected: [0; 9],
        }
    }

    /// How often a fault was injected.
    pub const fn injected(&self, fault: Fault) -> u32 {
        self.injected[fault as usize]
    }

    /// A frame that is due from an earlier fault.
    fn due(&mut self) -> Option<StampedFrame> {
        let held = &mut self.held;
        let passed = || held.take_if(|(left, _)| *left == 0).map(|(_, frame)| frame);
        self.again.take().or_else(passed)
    }

    fn inject(&mut self, fault: Fault, stamped: StampedFrame) -> Option<StampedFrame> {
        // One frame can be held at a time; a second one passes.
        if matches!(fault, Fault::Swap | Fault::Delay) && self.held.is_some() {
            return Some(stamped);
        }
        let count = &mut self.injected[fault as usize];
        *count = count.saturating_add(1);
        match fault {
            Fault::Drop => None,
            Fault::Repeat => {
                self.again = Some(stamped);
                Some(stamped)
            }
            Fault::Swap => {
                self.held = Some((1, stamped));
                None
            }
            Fault::Delay => {
                let after = 2 + self.random.below(8) as u8;
                self.held = Some((after, stamped));
                None
            }
            _ => Some(StampedFrame {
                frame: damaged(&stamped.frame, fault, &mut self.random),
                ..stamped
            }),
        }
    }
}

impl<I: Iterator<Item = StampedFrame>> Iterator for Faulty<I> {
    type Item = StampedFrame;

    fn next(&mut self) -> Option<StampedFrame> {
        if let Some(frame) = self.due() {
            return Some(frame);
        }
        loop {
            let Some(frame) = self.frames.next() else {
                // No frame is left that could overtake the one held back.
                return self.held.take().map(|(_, frame)| frame);
            };
            let frame = match self.rates.draw(self.random.bits()) {
                Some(fault) => self.inject(fault, frame),
                None => Some(frame),
            };
            if frame.is_some() {
                if let Some((left, _)) = &mut self.held {
                    *left = left.saturating_sub(1);
                }
                return frame;
            }
        }
    }
}
