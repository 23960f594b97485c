//! The decoding node, without a bus and without a clock: frames and times in, frames out.

use hal_adapters::can::command::{Answer, Command, IdentityPage, Mailbox, Outcome, Request, Told};
use hal_adapters::can::status::{HealthPage, NodeState, NodeStatus, flag};
use hal_adapters::can::table::SLOW_TICKS;
use hal_adapters::can::{
    BusFault, Coded, Layout, Message, PROTOCOL_VERSION, PoseSender, SensorReceiver, StampedFrame,
    Timing,
};
use runtime::rezero::{RezeroSettings, RezeroState};
use runtime::{Decode, OnInvalid, PlanarPose, RawFrame, Reading, Servo, Status};

/// How a node is set up.
#[derive(Clone, Copy, Debug)]
pub struct NodeSettings {
    /// How codes come.
    pub layout: Layout,
    /// When ticks are given up and the sensors are stale.
    pub timing: Timing,
    /// What an invalid field reads.
    pub on_invalid: OnInvalid,
    /// Every how many ticks each vertical axis is sent.
    pub vertical_ticks: u8,
}

/// What a frame, or the passing of time, led to.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Step {
    /// The tick that was decoded, as received and as decoded.
    pub tick: Option<(RawFrame, Reading)>,
    /// What is wrong with the bus.
    pub fault: Option<BusFault>,
    /// A request that came.
    pub command: Option<Command>,
}

/// A decoding node.
#[derive(Debug)]
pub struct Node<'d> {
    receiver: SensorReceiver,
    servo: Servo<'d>,
    poses: PoseSender,
    mailbox: Mailbox,
    serial: &'d str,
    ticks: u32,
    rezero: Option<Command>,
    flags: u8,
}

/// The reading that is published while no frames come.
const NO_FRAMES: Status = Status::PLANAR_INVALID
    .with(Status::VERTICAL_INVALID)
    .with(Status::FRAMES_MISSED);

impl<'d> Node<'d> {
    /// A node that has seen nothing; `serial` is what it tells when asked who it is.
    pub fn new(decoder: &'d dyn Decode, serial: &'d str, settings: &NodeSettings) -> Self {
        Self {
            receiver: SensorReceiver::new(settings.layout, settings.timing),
            servo: Servo::new(decoder, settings.on_invalid),
            poses: PoseSender::new(settings.vertical_ticks),
            mailbox: Mailbox::default(),
            serial,
            ticks: 0,
            rezero: None,
            flags: 0,
        }
    }

    /// The messages that the node wants to receive.
    pub fn messages(layout: Layout) -> Vec<Message> {
        let mut messages = layout.messages().to_vec();
        messages.extend([Message::SensorTime, Message::Command]);
        messages
    }

    /// Takes one frame; what is to be sent is added to `out`.
    pub fn take(&mut self, frame: &StampedFrame, out: &mut Vec<Coded>) -> Step {
        match self.mailbox.take(&frame.frame) {
            Some(Ok(Told::Command(command))) => {
                self.obey(command, out);
                return Step {
                    command: Some(command),
                    ..Step::default()
                };
            }
            Some(Err(fault)) => {
                return Step {
                    fault: Some(fault),
                    ..Step::default()
                };
            }
            Some(Ok(_)) | None => {}
        }
        // The receiver's times wrap after 71 minutes, as those of a controller do.
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
            self.publish(&reading, out);
        }
        self.step(taken.tick, taken.fault, out)
    }

    /// How long to wait for a frame before [`Node::poll`] has something to say, us; `None`
    /// before the first frame.
    pub fn patience_us(&self, time_us: u64) -> Option<u32> {
        if self.receiver.is_stale() {
            return Some(2_000);
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
            let reading = self.servo.tick(&frame);
            self.publish(&reading, out);
            self.answer_rezero(out);
            (frame, reading)
        });
        Step {
            tick,
            fault,
            command: None,
        }
    }

    /// Pose frames, and every sixteenth time state and a counter.
    fn publish(&mut self, reading: &Reading, out: &mut Vec<Coded>) {
        out.extend(self.poses.frames(reading));
        if self.ticks.is_multiple_of(u32::from(SLOW_TICKS)) {
            let round = self.ticks / u32::from(SLOW_TICKS);
            let status = Told::Status(self.status());
            let health = Told::Health(HealthPage::of(&self.servo.health(), round));
            out.extend([status, health].iter().filter_map(|t| self.mailbox.send(t)));
        }
        self.ticks = self.ticks.wrapping_add(1);
    }

    fn status(&self) -> NodeStatus {
        let running = if self.rezero.is_some() {
            flag::REZERO_RUNS
        } else {
            0
        };
        let missed = self.servo.health().frames_missed;
        NodeStatus {
            state: Some(if self.receiver.is_stale() {
                NodeState::NoFrames
            } else {
                NodeState::Running
            }),
            reason: 0,
            flags: self.flags | running,
            missed_ticks: u16::try_from(missed).unwrap_or(u16::MAX),
            bus_off: 0,
            version: PROTOCOL_VERSION,
        }
    }

    fn obey(&mut self, command: Command, out: &mut Vec<Coded>) {
        let outcome = match command.request {
            None => Outcome::UnknownCommand,
            Some(Request::Rezero { .. }) if self.rezero.is_some() => Outcome::Busy,
            Some(Request::Rezero { ticks }) => {
                let mut settings = RezeroSettings::default();
                if ticks != 0 {
                    settings.ticks = ticks;
                }
                self.rezero = Some(command);
                self.servo.start_rezero(settings);
                if matches!(self.servo.rezero_state(), RezeroState::Refused(_)) {
                    return self.answer_rezero(out);
                }
                Outcome::Started
            }
            Some(Request::Identify { .. }) => {
                let pages = (0..IdentityPage::PAGES).map(|p| IdentityPage::of(self.serial, p));
                let told: Vec<Told> = pages.map(Told::Identity).collect();
                out.extend(told.iter().filter_map(|t| self.mailbox.send(t)));
                Outcome::Done
            }
            Some(Request::ClearZero) => {
                self.servo.set_zero(PlanarPose::ZERO);
                self.flags &= !flag::REZEROED;
                Outcome::Done
            }
        };
        self.answer(command, outcome, 0, out);
    }

    fn answer(&mut self, to: Command, outcome: Outcome, detail: u32, out: &mut Vec<Coded>) {
        let answer = Told::Answer(Answer {
            number: to.number,
            token: to.token,
            outcome: Some(outcome),
            detail,
        });
        out.extend(self.mailbox.send(&answer));
    }

    /// Answers the request for a re-zero that has just ended.
    fn answer_rezero(&mut self, out: &mut Vec<Coded>) {
        let (outcome, detail) = match (self.rezero, self.servo.rezero_state()) {
            (None, _) | (_, RezeroState::Idle | RezeroState::Running { .. }) => return,
            (_, RezeroState::Done { .. }) => {
                self.flags = (self.flags | flag::REZEROED) & !flag::REZERO_REFUSED;
                (Outcome::Done, 0)
            }
            (_, RezeroState::Refused(refusal)) => {
                self.flags |= flag::REZERO_REFUSED;
                Outcome::of_refusal(&refusal)
            }
        };
        if let Some(command) = self.rezero.take() {
            self.answer(command, outcome, detail, out);
        }
    }

    /// The receiver, for its counters.
    pub const fn receiver(&self) -> &SensorReceiver {
        &self.receiver
    }

    /// The servo, for its counters.
    pub const fn servo(&self) -> &Servo<'d> {
        &self.servo
    }
}

#[cfg(test)]
#[path = "node_tests.rs"]
mod tests;
