//! From sensor frames to raw frames: one for every tick with at least one frame. Codes without a good frame are
//! missing.
//!
//! Call [`SensorReceiver::take`] with every frame of the bus and its receive time, and
//! [`SensorReceiver::poll`] when no frame comes: at [`SensorReceiver::deadline_us`], or every
//! millisecond.
//!
//! ```
//! use hal_adapters::can::{Layout, BusFrame, SensorReceiver, Timing, sensor};
//! use runtime::RawFrame;
//!
//! let sent = RawFrame::new([100, -200, 300], [1, 2, 3], 7, 14_000);
//! let mut receiver = SensorReceiver::new(Layout::Bits16, Timing::default());
//! let mut got = None;
//! for frame in sensor::frames(Layout::Bits16, &sent) {
//!     let taken = receiver.take(&BusFrame::from(frame), 14_300);
//!     assert_eq!(taken.fault, None);
//!     got = taken.tick;
//! }
//! assert_eq!(got.map(|frame| (frame.hall, frame.capacitive)), Some((sent.hall, sent.capacitive)));
//! ```

use super::e2e::{SHORT_BITS, Sequence};
use super::frame::standard;
use super::group::{Group, GroupTick};
use super::notice::{BusFault, BusHealth, Taken, Timing};
use super::sensor::{Layout, read_temperature_mc, read_three, read_two};
use super::table::Message;
use embedded_can::Frame;
use runtime::RawFrame;
use runtime::frame::MISSING_CODE;

/// Receives the sensor frames of one stage.
///
/// Raw frames are numbered from the first counter seen. Lost ticks are counted in the number,
/// so [`runtime::PoseTracker`] sees them, too. `time_us` of a raw frame is when its first bus frame
/// came, by the receiver's clock. Its temperatures are those that the node sent last.
#[derive(Clone, Debug)]
pub struct SensorReceiver {
    layout: Layout,
    group: Group,
    /// Counters of the time frames.
    clock: Sequence,
    /// The sensor node's number of a tick minus the receiver's, in the upper bits.
    offset: Option<u32>,
    /// Counters of the temperature frames.
    temperature: Sequence,
    temperature_mc: [i32; 2],
    /// When the last temperature frame came, us.
    temperature_us: u32,
}

/// Temperatures are forgotten this long after they came, us.
const TEMPERATURE_STALE_US: u32 = 350_000;

#[inline(always)]
fn raw_16(tick: &GroupTick, temperature_mc: [i32; 2]) -> RawFrame {
    let codes = |k| tick.payload(k).map_or([MISSING_CODE; 3], read_three);
    RawFrame::new(codes(0), codes(1), tick.sequence, tick.time_us)
        .with_temperature_mc(temperature_mc)
}

#[inline(always)]
fn raw_24(tick: &GroupTick, temperature_mc: [i32; 2]) -> RawFrame {
    let codes = |k| tick.payload(k).map_or([MISSING_CODE; 2], read_two);
    let ([a, b], [c, g1], [g2, g3]) = (codes(0), codes(1), codes(2));
    RawFrame::new([a, b, c], [g1, g2, g3], tick.sequence, tick.time_us)
        .with_temperature_mc(temperature_mc)
}

impl SensorReceiver {
    /// A receiver that has seen no frame.
    pub const fn new(layout: Layout, timing: Timing) -> Self {
        Self {
            layout,
            group: Group::new(layout.messages().len(), timing),
            clock: Sequence::START,
            offset: None,
            temperature: Sequence::START,
            temperature_mc: [MISSING_CODE; 2],
            temperature_us: 0,
        }
    }

    /// Takes one frame, received at `now_us`. A frame that is not for this receiver is
    /// ignored.
    #[inline]
    pub fn take<F: Frame>(&mut self, frame: &F, now_us: u32) -> Taken<RawFrame> {
        match standard(frame) {
            Some((id, data)) => self.take_data(id.as_raw(), data, now_us),
            None => Taken::NOTHING,
        }
    }

    /// As [`SensorReceiver::take`], from a standard identifier and the data of a data frame.
    #[inline]
    pub fn take_data(&mut self, id: u16, data: &[u8], now_us: u32) -> Taken<RawFrame> {
        use Message as M;
        const HALL: u16 = M::Hall.spec().id;
        const CAPACITIVE: u16 = M::Capacitive.spec().id;
        const FIRST: u16 = M::HallAb24.spec().id;
        const SECOND: u16 = M::HallCCapacitive1At24.spec().id;
        const THIRD: u16 = M::Capacitive23At24.spec().id;
        const TIME: u16 = M::SensorTime.spec().id;
        const TEMPERATURE: u16 = M::Temperature.spec().id;
        use Layout::{Bits16, Bits24};
        let group = &mut self.group;
        let raw_16 = |tick: &GroupTick| raw_16(tick, self.temperature_mc);
        let raw_24 = |tick: &GroupTick| raw_24(tick, self.temperature_mc);
        match (self.layout, id) {
            (Bits16, HALL) => group.take(0, M::Hall, data, now_us, raw_16),
            (Bits16, CAPACITIVE) => group.take(1, M::Capacitive, data, now_us, raw_16),
            (Bits24, FIRST) => group.take(0, M::HallAb24, data, now_us, raw_24),
            (Bits24, SECOND) => group.take(1, M::HallCCapacitive1At24, data, now_us, raw_24),
            (Bits24, THIRD) => group.take(2, M::Capacitive23At24, data, now_us, raw_24),
            (_, TIME) => {
                self.forget_temperature_at(now_us);
                let fault = self.take_time(data).map(|fault| self.group.note(fault));
                Taken { tick: None, fault }
            }
            (_, TEMPERATURE) => {
                let (payload, fault) = self.temperature.take(M::Temperature, data);
                if let Some(payload) = payload {
                    self.temperature_mc = read_temperature_mc(payload);
                    self.temperature_us = now_us;
                }
                let fault = fault.map(|fault| self.group.note(fault));
                Taken { tick: None, fault }
            }
            _ => Taken::NOTHING,
        }
    }

    /// Forgets temperatures that came too long ago. The time frames are often enough for that.
    const fn forget_temperature_at(&mut self, now_us: u32) {
        if now_us.wrapping_sub(self.temperature_us) > TEMPERATURE_STALE_US {
            self.temperature_mc = [MISSING_CODE; 2];
        }
    }

    /// Compares the sensor node's own count of ticks with the receiver's.
    #[inline(never)]
    fn take_time(&mut self, data: &[u8]) -> Option<BusFault> {
        let (payload, fault) = self.clock.take(Message::SensorTime, data);
        let Some(payload) = payload else { return fault };
        let counted = self.group.nearest((payload.short & 0xf) as u8);
        let offset = payload.short.wrapping_sub(counted) << (32 - SHORT_BITS);
        let before = self.offset.replace(offset)?;
        if offset == before {
            return None;
        }
        let moved = offset.wrapping_sub(before) as i32 >> (32 - SHORT_BITS);
        if moved < 0 {
            return Some(BusFault::SenderRestarted);
        }
        let ticks = moved as u32;
        self.group.skip(ticks);
        self.offset = Some(before);
        Some(BusFault::TicksLost { ticks })
    }

    /// Lets time pass: gives an overdue tick, and reports a stale source. A source is reported as stale once;
    /// [`SensorReceiver::is_stale`] holds until a good frame.
    pub fn poll(&mut self, now_us: u32) -> Taken<RawFrame> {
        let taken = self.group.poll(now_us).map(|tick| match self.layout {
            Layout::Bits16 => raw_16(tick, self.temperature_mc),
            Layout::Bits24 => raw_24(tick, self.temperature_mc),
        });
        if self.group.is_stale() {
            self.temperature_mc = [MISSING_CODE; 2];
        }
        taken
    }

    /// When [`SensorReceiver::poll`] will have something to report if no frame comes before;
    /// `None` before the first frame and while stale.
    pub fn deadline_us(&self) -> Option<u32> {
        self.group.deadline_us()
    }

    /// Whether there was no good frame for too long.
    pub const fn is_stale(&self) -> bool {
        self.group.is_stale()
    }

    /// The counters.
    pub const fn health(&self) -> &BusHealth {
        self.group.health()
    }
}

#[cfg(test)]
#[path = "receiver_tests.rs"]
mod tests;
