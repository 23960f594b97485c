//! Drops, repeats, delays and damages bus frames, for tests of receivers. The same seed gives the same faults.
//!
//! ```
//! use embedded_can::Frame;
//! use hal_adapters::can::{BusFrame, Message};
//! use tests::fault::{Channel, Fault};
//!
//! let frame = BusFrame::new(Message::Hall.id(), &[0; 8]).unwrap();
//! let mut bus = Channel::new(&[(Fault::Drop, 100_000)], 1); // one frame in ten
//! (0..100).for_each(|at_us| bus.send(at_us, frame));
//! assert_eq!(bus.arrived(100).len() as u32 + bus.injected(Fault::Drop), 100);
//! ```

use crate::random::Random;
use embedded_can::{Frame, Id, StandardId};
use hal_adapters::can::table::TABLE;
use hal_adapters::can::{BusFrame, Message};

/// A fault of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// It is lost.
    Drop,
    /// It arrives twice.
    Repeat,
    /// It arrives after some of the next frames.
    Swap,
    /// It arrives some ticks late.
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
    /// All faults.
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

/// The same frame with its bytes XOR `mask`; the most significant byte of `mask` falls on byte 0.
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

/// A bus: frames under way, some lost, repeated, late or damaged.
#[derive(Clone, Debug)]
pub struct Channel {
    random: Random,
    per_million: [u64; 9],
    injected: [u32; 9],
    under_way: Vec<(u64, BusFrame)>,
}

impl Channel {
    /// Faults at these rates per million frames, drawn by `seed`; at most one happens to a frame. Of two
    /// rates of a fault the last holds.
    pub fn new(faults: &[(Fault, u64)], seed: u64) -> Self {
        let mut per_million = [0; 9];
        for (fault, rate) in faults {
            per_million[*fault as usize] = *rate;
        }
        Self {
            random: Random::new(seed),
            per_million,
            injected: [0; 9],
            under_way: Vec::new(),
        }
    }

    /// Takes a frame at a time, us.
    pub fn send(&mut self, now_us: u64, frame: BusFrame) {
        let mut below = self.random.below(1_000_000);
        let fault = Fault::ALL.into_iter().zip(self.per_million);
        let fault = fault.into_iter().find_map(|(fault, rate)| {
            let happens = below < rate;
            below = below.saturating_sub(rate);
            happens.then_some(fault)
        });
        let delay_us = self.random.below(9) * 1_000;
        let due_us = match fault {
            Some(Fault::Drop) => u64::MAX,
            Some(Fault::Repeat) => {
                self.under_way.push((now_us, frame));
                now_us + 500
            }
            Some(Fault::Swap) => now_us + 1_500,
            Some(Fault::Delay) => now_us + 2_000 + delay_us,
            _ => now_us,
        };
        let mut sent = frame;
        if let Some(fault) = fault {
            self.injected[fault as usize] += 1;
            sent = damaged(&frame, fault, &mut self.random);
        }
        if due_us < u64::MAX {
            self.under_way.push((due_us, sent));
        }
    }

    /// The frames that have arrived by a time, us.
    pub fn arrived(&mut self, now_us: u64) -> Vec<BusFrame> {
        let is_due = |(due_us, _): &mut (u64, BusFrame)| *due_us <= now_us;
        let due = self.under_way.extract_if(.., is_due);
        due.map(|(_, frame)| frame).collect()
    }

    /// How often a fault was injected.
    pub const fn injected(&self, fault: Fault) -> u32 {
        self.injected[fault as usize]
    }
}
