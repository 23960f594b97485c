//! The decoding node without a bus and a clock: frames and times in, frames out.

use hal_adapters::can::command::{Command, Content};
use hal_adapters::can::status::{HealthPage, NodeState, NodeStatus};
use hal_adapters::can::table::SLOW_TICKS;
use hal_adapters::can::{
    BusFault, Coded, Layout, Message, PROTOCOL_VERSION, PoseSender, SensorReceiver, Service,
    StampedFrame, Timing,
};
use runtime::{AnyDecoder, OnInvalid, PoseTracker, RawFrame, Reading, Status};

/// Ticks per second. The node publishes at this rate while the sensors are silent.
const TICKS_PER_S: u32 = 1_000_000 / SILENT_US;
/// Time from pose to pose while the sensors are silent, us.
const SILENT_US: u32 = 2_000;

/// The settings of a node.
#[derive(Clone, Copy, Debug)]
pub struct NodeSettings {
    /// The layout of the codes.
    pub layout: Layout,
    /// Time limits for incomplete ticks and silent sensors.
    pub timing: Timing,
    /// The value of an invalid field.
    pub on_invalid: OnInvalid,
}

/// The result of a frame, or of time that passed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Step {
    /// A tick, as received and as decoded.
    pub tick: Option<(RawFrame, Reading)>,
    /// A fault of the bus.
    pub fault: Option<BusFault>,
    /// A request.
    pub command: Option<Command>,
}

/// A decoding node.
#[derive(Debug)]
pub struct Node {
    receiver: SensorReceiver,
    tracker: PoseTracker,
    poses: PoseSender,
    service: Service,
    ticks: u32,
}

/// The reading that is published while no frames come.
const NO_FRAMES: Status = Status::PLANAR_INVALID
    .with(Status::VERTICAL_INVALID)
    .with(Status::FRAMES_MISSED);

impl Node {
    /// A node before its first frame.
    pub fn new(decoder: AnyDecoder, settings: &NodeSettings) -> Self {
        Self {
            receiver: SensorReceiver::new(settings.layout, settings.timing),
            tracker: PoseTracker::new(decoder, settings.on_invalid),
            poses: PoseSender::default(),
            service: Service::new(TICKS_PER_S),
            ticks: 0,
        }
    }

    /// The messages that the node wants to receive.
    pub fn messages(layout: Layout) -> Vec<Message> {
        let mut messages = layout.messages().to_vec();
        messages.extend([Message::SensorTime, Message::Temperature, Message::Command]);
        messages
    }

    /// Takes one frame, and adds the frames to send to `out`.
    pub fn take(&mut self, frame: &StampedFrame, out: &mut Vec<Coded>) -> Step {
        match (self.service).take(&frame.frame, Some(&mut self.tracker), None) {
            Some(Ok(answered)) => {
                out.extend(answered.answer);
                return Step {
                    command: Some(answered.command),
                    ..Step::default()
                };
            }
            Some(Err(fault)) => {
                return Step {
                    fault: Some(fault),
                    ..Step::default()
                };
            }
            None => {}
        }
        // The receiver's times wrap after 71 minutes, as on a controller.
        let taken = self.receiver.take(&frame.frame, frame.time_us as u32);
        self.step(taken.tick, taken.fault, out)
    }

    /// Lets time pass without a frame: `time_us` is now, on the clock of the receive times.
    pub fn poll(&mut self, time_us: u64, out: &mut Vec<Coded>) -> Step {
        let taken = self.receiver.poll(time_us as u32);
        if self.receiver.is_stale() && taken.tick.is_none() {
            let reading = Reading {
                status: NO_FRAMES,
                ..Reading::default()
            };
            self.publish(&reading, None, out);
        }
        self.step(taken.tick, taken.fault, out)
    }

    /// How long to wait for a frame before the next [`Node::poll`], us; `None` before the first frame.
    pub fn patience_us(&self, time_us: u64) -> Option<u32> {
        if self.receiver.is_stale() {
            return Some(SILENT_US);
        }
        let left = self.receiver.deadline_us()?.wrapping_sub(time_us as u32);
        Some(if left > u32::MAX / 2 { 0 } else { left })
    }

    fn step(
        &mut self,
        tick: Option<RawFrame>,
        fault: Option<BusFault>,
        out: &mut Vec<Coded>,
    ) -> Step {
        let tick = tick.map(|frame| {
            // A computer has no service pin.
            self.service.before_tick(Some(&mut self.tracker), None);
            let reading = self.tracker.tick(&frame);
            self.publish(&reading, Some(&frame), out);
            (frame, reading)
        });
        Step {
            tick,
            fault,
            command: None,
        }
    }

    /// Adds the pose frames, every sixteenth time a state and a counter, and the answer of a re-zero.
    fn publish(&mut self, reading: &Reading, sampled: Option<&RawFrame>, out: &mut Vec<Coded>) {
        out.extend(self.poses.frames(reading, sampled));
        if self.ticks.is_multiple_of(u32::from(SLOW_TICKS)) {
            let round = self.ticks / u32::from(SLOW_TICKS);
            let status = Content::Status(self.status());
            let health = Content::Health(HealthPage::new(&self.tracker.health(), None, round));
            out.extend([status, health].iter().filter_map(|t| self.service.send(t)));
        }
        out.extend(self.service.tick(Some(&self.tracker)));
        self.ticks = self.ticks.wrapping_add(1);
    }

    fn status(&self) -> NodeStatus {
        let missed = self.tracker.health().frames_missed;
        NodeStatus {
            state: Some(if self.receiver.is_stale() {
                NodeState::NoFrames
            } else {
                NodeState::Running
            }),
            reason: 0,
            flags: self.service.flags(Some(&self.tracker)),
            missed_ticks: u16::try_from(missed).unwrap_or(u16::MAX),
            bus_off: 0,
            version: PROTOCOL_VERSION,
        }
    }

    /// The receiver, for its counters.
    pub const fn receiver(&self) -> &SensorReceiver {
        &self.receiver
    }

    /// The tracker, for its counters.
    pub const fn tracker(&self) -> &PoseTracker {
        &self.tracker
    }
}

#[cfg(test)]
#[path = "node_tests.rs"]
mod tests;
