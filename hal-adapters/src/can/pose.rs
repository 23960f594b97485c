//! Pose frames. Each frame carries one axis, as the decoder's own `f32` word, and bits 0 to 19 of the
//! status: see [`status_to_bus`]. So the bits on the bus are the bits of the decoder, and each frame says
//! whether its value may be used.
//!
//! ```
//! use hal_adapters::can::{BusFrame, PoseReceiver, PoseSender, Timing};
//! use runtime::{RawFrame, Reading};
//!
//! let codes = RawFrame::new([1, 2, 3], [4, 5, 6], 7, 14_000);
//! let mut reading = Reading::default(); // in its place what the decoder made of the codes
//! reading.pose.planar.x_m = 1.5e-6;
//! let (mut sender, mut receiver) = (PoseSender::default(), PoseReceiver::new(Timing::default()));
//! let mut received = None;
//! for frame in sender.frames(&reading, Some(&codes)) {
//!     let taken = receiver.take(&BusFrame::from(frame), 300);
//!     received = received.or(taken.tick);
//! }
//! let pose = received.expect("three axes came");
//! assert_eq!(pose.valid(), Some(reading.pose.planar));
//! assert_eq!(receiver.sampled_us(&pose, 2_000), Some(14_000));
//! ```

use super::e2e::{Payload, SHORT_BITS, Sequence};
use super::frame::{Coded, standard};
use super::group::{Group, GroupTick};
use super::notice::{BusFault, BusHealth, Taken, Timing};
use super::sensor::time_frame;
use super::table::Message;
use embedded_can::Frame;
use runtime::{PlanarPose, RawFrame, Reading, Status};

/// The planar axes, in the order of the pose.
const PLANAR: [Message; 3] = [Message::PoseX, Message::PoseY, Message::PoseRz];
/// The vertical axes.
const VERTICAL: [Message; 3] = [Message::PoseZ, Message::PoseRx, Message::PoseRy];

/// The lowest 20 bits of a status. The bits above say that a pose is held, and a held pose is invalid.
#[inline(always)]
pub const fn status_to_bus(status: Status) -> u32 {
    status.bits() & (u32::MAX >> (32 - SHORT_BITS))
}

/// Binary logarithm of the ticks between two frames of a vertical axis. The axes take turns.
const VERTICAL_SHIFT: u32 = 2;

const fn axis_frame(message: Message, counter: u32, value: f32, status: Status) -> Coded {
    let payload = Payload::new(status_to_bus(status), value.to_bits());
    Coded::new(message, counter, payload)
}

/// Numbers the pose frames of one node and decides when the vertical axes are sent.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PoseSender {
    tick: u32,
}

impl PoseSender {
    /// The frames of one tick: X, Y, Rz; in every [`super::table::SLOW_TICKS`]th tick, together with X, Y and
    /// Rz of counter 0, number and time of `sampled`; in four ticks Z, Rx, Ry, and none.
    /// `sampled` are the codes that were decoded; a tick without codes has no time.
    pub fn frames(
        &mut self,
        reading: &Reading,
        sampled: Option<&RawFrame>,
    ) -> impl Iterator<Item = Coded> + use<> {
        let (tick, pose, status) = (self.tick, reading.pose, reading.status);
        self.tick = tick.wrapping_add(1);
        let planar = PLANAR.into_iter().zip(pose.planar.to_array());
        let planar = planar.map(move |(message, value)| axis_frame(message, tick, value, status));
        let time = sampled.and_then(|sampled| time_frame(Message::PoseTime, sampled, tick));
        let turn = (tick & ((1 << VERTICAL_SHIFT) - 1)) as usize;
        let vertical = VERTICAL.into_iter().zip(pose.vertical.to_array()).nth(turn);
        let vertical = vertical
            .map(|(message, value)| axis_frame(message, tick >> VERTICAL_SHIFT, value, status));
        planar.chain(time).chain(vertical)
    }
}

/// The planar pose of one tick, as it came over the bus.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReceivedPose {
    /// X, Y, Rz; an axis that did not come is 0.
    pub pose: PlanarPose<f32>,
    /// The status that all three frames carry, 20 bits. With an axis missing, or three
    /// statuses that differ, [`Status::PLANAR_INVALID`] and [`Status::FRAMES_MISSED`] are set.
    pub status: Status,
    /// Number of the tick, counted by the receiver.
    pub sequence: u32,
    /// When its first frame came, us.
    pub time_us: u32,
}

impl ReceivedPose {
    /// The pose if it was measured in this tick and came whole.
    pub fn valid(&self) -> Option<PlanarPose<f32>> {
        (!self.status.any(Status::PLANAR_INVALID)).then_some(self.pose)
    }
}

/// The last value received of a vertical axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReceivedAxis {
    /// The value, m or rad.
    pub value: f32,
    /// Its status.
    pub status: Status,
    /// When it came, us.
    pub time_us: u32,
}

/// A tick with a known time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Dated {
    /// Number of the tick, counted by the receiver.
    sequence: u32,
    /// When its codes were sampled, us of the node's clock.
    time_us: u32,
    /// When its time frame came, us.
    received_us: u32,
}

/// How many periods late a pose or a time frame may come: half of a counter's range.
const LATE_PERIODS_MAX: u32 = 8;

/// Receives pose frames.
#[derive(Clone, Debug)]
pub struct PoseReceiver {
    planar: Group,
    clock: Sequence,
    dated: Option<Dated>,
    sequences: [Sequence; 3],
    vertical: [Option<ReceivedAxis>; 3],
}

fn received(tick: &GroupTick) -> ReceivedPose {
    let lost = Status::PLANAR_INVALID.with(Status::FRAMES_MISSED);
    let axes = [0, 1, 2].map(|k| tick.payload(k));
    let values = axes.map(|axis| axis.map_or(0.0, |axis| f32::from_bits(axis.long)));
    let status = match axes.map(|axis| axis.map(|axis| axis.short)) {
        [Some(x), Some(y), Some(rz)] if x == y && y == rz => Status::from_bits(x),
        _ => lost,
    };
    let are_finite = values.iter().all(|value| value.is_finite());
    ReceivedPose {
        pose: PlanarPose::from_array(values),
        status: if are_finite { status } else { lost },
        sequence: tick.sequence,
        time_us: tick.time_us,
    }
}

impl PoseReceiver {
    /// A receiver that has seen no frame.
    pub const fn new(timing: Timing) -> Self {
        Self {
            planar: Group::new(PLANAR.len(), timing),
            clock: Sequence::START,
            dated: None,
            sequences: [Sequence::START; 3],
            vertical: [None; 3],
        }
    }

    /// Takes one frame, received at `now_us`. Frames of other messages are ignored.
    pub fn take<F: Frame>(&mut self, frame: &F, now_us: u32) -> Taken<ReceivedPose> {
        let Some((id, data)) = standard(frame) else {
            return Taken::NOTHING;
        };
        let is = |message: &Message| message.id() == id;
        let planar = (0usize..).zip(PLANAR).find(|(_, message)| is(message));
        if let Some((k, message)) = planar {
            let taken = self.planar.take(k, message, data, now_us, received);
            let missed = |pose: &ReceivedPose| pose.status.any(Status::FRAMES_MISSED);
            if taken.tick.as_ref().is_some_and(missed) {
                self.dated = None;
            }
            return taken;
        }
        let fault = if is(&Message::PoseTime) {
            self.take_time(data, now_us)
        } else {
            let vertical = VERTICAL.iter().position(is);
            vertical.and_then(|k| self.take_vertical(k, data, now_us))
        };
        Taken {
            tick: None,
            fault: fault.map(|fault| self.planar.note(fault)),
        }
    }

    fn take_time(&mut self, data: &[u8], now_us: u32) -> Option<BusFault> {
        let (payload, fault) = self.clock.take(Message::PoseTime, data);
        if let Some(payload) = payload {
            self.dated = Some(Dated {
                sequence: self.planar.nearest(0),
                time_us: payload.long,
                received_us: now_us,
            });
        }
        fault
    }

    /// When the codes of a pose were sampled, us of the node's clock, which wraps: the last time
    /// that it gave, and one servo period for each tick since. `None` before the first time
    /// frame and, after a tick that the node missed, until the next one: the node does not
    /// number the ticks that it missed. `None`, too, where the receive times do not bear the
    /// numbers out: a loss of 16 ticks does not show in the counters.
    pub fn sampled_us(&self, pose: &ReceivedPose, period_us: u32) -> Option<u32> {
        let dated = self.dated?;
        let ticks = pose.sequence.wrapping_sub(dated.sequence);
        let since_us = ticks.wrapping_mul(period_us);
        let received_us = pose.time_us.wrapping_sub(dated.received_us);
        let apart_us = (received_us.wrapping_sub(since_us) as i32).unsigned_abs();
        (apart_us < period_us.saturating_mul(LATE_PERIODS_MAX))
            .then(|| dated.time_us.wrapping_add(since_us))
    }

    fn take_vertical(&mut self, k: usize, data: &[u8], time_us: u32) -> Option<BusFault> {
        let (payload, fault) = self.sequences.get_mut(k)?.take(*VERTICAL.get(k)?, data);
        if let Some(payload) = payload {
            *self.vertical.get_mut(k)? = Some(ReceivedAxis {
                value: f32::from_bits(payload.long),
                status: Status::from_bits(payload.short),
                time_us,
            });
        }
        fault
    }

    /// What the passing of time brings: see [`super::SensorReceiver::poll`].
    pub fn poll(&mut self, now_us: u32) -> Taken<ReceivedPose> {
        self.planar.poll(now_us).map(received)
    }

    /// When [`PoseReceiver::poll`] will have something to report if no frame comes before.
    pub fn deadline_us(&self) -> Option<u32> {
        self.planar.deadline_us()
    }

    /// Whether there was no good planar frame for too long.
    pub const fn is_stale(&self) -> bool {
        self.planar.is_stale()
    }

    /// The last Z, Rx, Ry received.
    pub const fn vertical(&self) -> &[Option<ReceivedAxis>; 3] {
        &self.vertical
    }

    /// The counters.
    pub const fn health(&self) -> &BusHealth {
        self.planar.health()
    }
}

#[cfg(test)]
#[path = "pose_tests.rs"]
mod tests;
