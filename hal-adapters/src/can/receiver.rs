//! From sensor frames to raw frames: every tick that the bus brings, whole or with the codes
//! missing that did not come or were not good.
//!
//! Call [`SensorReceiver::take`] with every frame of the bus and the time at which it came,
//! and [`SensorReceiver::poll`] when time passes without one: at
//! [`SensorReceiver::deadline_us`], or every millisecond.
//!
//! ```
//! use hal_adapters::can::{Layout, BusFrame, SensorReceiver, Timing, sensor};
//! use runtime::RawFrame;
//!
//! let sent = RawFrame { hall: [100, -200, 300], capacitive: [1, 2, 3], sequence: 7, time_us: 14_000 };
//! let mut receiver = SensorReceiver::new(Layout::Bits16, Timing::default());
//! let mut got = None;
//! for frame in sensor::frames(Layout::Bits16, &sent) {
//!     let taken = receiver.take(&BusFrame::from(frame), 14_300);
//!     assert_eq!(taken.fault, None);
//!     got = taken.tick;
//! }
//! assert_eq!(got.map(|frame| (frame.hall, frame.capacitive)), Some((sent.hall, sent.capacitive)));
//! ```

use super::e2e::{SHORT_BITS, Sequence, Verdict, unprotect};
use super::group::{Group, GroupTick};
use super::notice::{BusFault, BusHealth, Taken, Timing};
use super::sensor::{Layout, read_three, read_two};
use super::table::{FRAME_BYTES, Message};
use embedded_can::{Frame, Id};
use runtime::RawFrame;
use runtime::frame::MISSING_CODE;

/// Number and time of a tick by the sensor node's clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SensorTime {
    /// The receiver's number of the same tick.
    pub sequence: u32,
    /// When its codes were sampled by the node's clock, us, wrapping.
    pub time_us: u32,
}

/// Receives the sensor frames of one stage.
///
/// Raw frames are numbered from the first counter seen. Lost ticks are counted in the number,
/// so [`runtime::Servo`] sees them too. `time_us` of a raw frame is when its first bus frame
/// came, by the receiver's clock.
#[derive(Clone, Debug)]
pub struct SensorReceiver {
    group: Frames,
    clock: Sequence,
    offset: Option<u32>,
    last_time: Option<SensorTime>,
}

#[derive(Clone, Debug)]
enum Frames {
    Bits16(Group<2>),
    Bits24(Group<3>),
}

/// The same call on either group.
macro_rules! either {
    ($frames:expr, $group:ident => $call:expr) => {
        match $frames {
            Frames::Bits16($group) => $call,
            Frames::Bits24($group) => $call,
        }
    };
}

#[inline(always)]
fn raw_16(tick: &GroupTick<2>) -> RawFrame {
    let codes = |k| tick.payload(k).map_or([MISSING_CODE; 3], read_three);
    RawFrame {
        hall: codes(0),
        capacitive: codes(1),
        sequence: tick.sequence,
        time_us: tick.time_us,
    }
}

fn raw_24(tick: &GroupTick<3>) -> RawFrame {
    let codes = |k| tick.payload(k).map_or([MISSING_CODE; 2], read_two);
    let ([a, b], [c, g1], [g2, g3]) = (codes(0), codes(1), codes(2));
    RawFrame {
        hall: [a, b, c],
        capacitive: [g1, g2, g3],
        sequence: tick.sequence,
        time_us: tick.time_us,
    }
}

impl SensorReceiver {
    /// A receiver that has seen no frame.
    pub const fn new(layout: Layout, timing: Timing) -> Self {
        let group = match layout {
            Layout::Bits16 => Frames::Bits16(Group::new(timing)),
            Layout::Bits24 => Frames::Bits24(Group::new(timing)),
        };
        Self {
            group,
            clock: Sequence::START,
            offset: None,
            last_time: None,
        }
    }

    /// Takes one frame, received at `now_us`. A frame that is not for this receiver is
    /// ignored.
    #[inline]
    pub fn take<F: Frame>(&mut self, frame: &F, now_us: u32) -> Taken<RawFrame> {
        let Id::Standard(id) = frame.id() else {
            return Taken::NOTHING;
        };
        let data = if frame.is_remote_frame() {
            &[]
        } else {
            frame.data()
        };
        self.take_data(id.as_raw(), data, now_us)
    }

    /// As [`SensorReceiver::take`], from a standard identifier and the data of a data frame.
    #[inline]
    pub fn take_data(&mut self, id: u16, data: &[u8], now_us: u32) -> Taken<RawFrame> {
        use Message as M;
        const HALL: u16 = M::Hall.spec().id;
        const CAPACITIVE: u16 = Message::Capacitive.spec().id;
        const FIRST: u16 = Message::HallAb24.spec().id;
        const SECOND: u16 = Message::HallCCapacitive1At24.spec().id;
        const THIRD: u16 = Message::Capacitive23At24.spec().id;
        const TIME: u16 = Message::SensorTime.spec().id;
        match (&mut self.group, id) {
            (Frames::Bits16(g), HALL) => g.take(0, M::Hall, data, now_us, raw_16),
            (Frames::Bits16(g), CAPACITIVE) => g.take(1, M::Capacitive, data, now_us, raw_16),
            (Frames::Bits24(g), FIRST) => g.take(0, M::HallAb24, data, now_us, raw_24),
            (Frames::Bits24(g), SECOND) => g.take(1, M::HallCCapacitive1At24, data, now_us, raw_24),
            (Frames::Bits24(g), THIRD) => g.take(2, M::Capacitive23At24, data, now_us, raw_24),
            (_, TIME) => Taken {
                tick: None,
                fault: self.take_time(data),
            },
            _ => Taken::NOTHING,
        }
    }

    /// Compares the sensor node's own count of ticks with the receiver's.
    fn take_time(&mut self, data: &[u8]) -> Option<BusFault> {
        let message = Message::SensorTime;
        let checked = match data.first_chunk::<FRAME_BYTES>() {
            Some(bytes) if data.len() == FRAME_BYTES => unprotect(message.spec().key, bytes),
            _ => {
                let bytes = data.len() as u8;
                return Some(self.note(BusFault::WrongLength { message, bytes }));
            }
        };
        let Some((counter, payload)) = checked else {
            return Some(self.note(BusFault::WrongCheck { message }));
        };
        match self.clock.judge(counter) {
            Verdict::Repeated => return Some(self.note(BusFault::Repeated { message })),
            Verdict::WrongSequence { ahead } => {
                return Some(self.note(BusFault::WrongSequence { message, ahead }));
            }
            Verdict::First | Verdict::Next | Verdict::Lost { .. } | Verdict::Resumed => {}
        }
        let counted = either!(&self.group, g => g.nearest((payload.short & 0xf) as u8));
        let offset = payload.short.wrapping_sub(counted) << (32 - SHORT_BITS);
        let mut fault = None;
        let mut sequence = counted;
        match self.offset.replace(offset) {
            Some(before) if before != offset => {
                let moved = offset.wrapping_sub(before) as i32 >> (32 - SHORT_BITS);
                if moved > 0 {
                    let ticks = moved as u32;
                    either!(&mut self.group, g => g.skip(ticks));
                    sequence = counted.wrapping_add(ticks);
                    self.offset = Some(before);
                    fault = Some(self.note(BusFault::TicksLost { ticks }));
                } else {
                    fault = Some(self.note(BusFault::SenderRestarted));
                }
            }
            _ => {}
        }
        self.last_time = Some(SensorTime {
            sequence,
            time_us: payload.long,
        });
        fault
    }

    fn note(&mut self, fault: BusFault) -> BusFault {
        either!(&mut self.group, g => g.note(fault))
    }

    /// What the passing of time gives: a tick whose time is over, a source that is stale. A
    /// source is called stale once; [`SensorReceiver::is_stale`] holds until a good frame.
    pub fn poll(&mut self, now_us: u32) -> Taken<RawFrame> {
        match &mut self.group {
            Frames::Bits16(g) => g.poll(now_us, raw_16),
            Frames::Bits24(g) => g.poll(now_us, raw_24),
        }
    }

    /// When [`SensorReceiver::poll`] has something to say if no frame comes; `None` before
    /// the first frame and while stale.
    pub fn deadline_us(&self) -> Option<u32> {
        either!(&self.group, g => g.deadline_us())
    }

    /// Whether there was no good frame for too long.
    pub const fn is_stale(&self) -> bool {
        either!(&self.group, g => g.is_stale())
    }

    /// The counters.
    pub const fn health(&self) -> &BusHealth {
        either!(&self.group, g => g.health())
    }

    /// The last number and time that the sensor node told.
    pub const fn sensor_time(&self) -> Option<SensorTime> {
        self.last_time
    }
}

#[cfg(test)]
#[path = "receiver_tests.rs"]
mod tests;
