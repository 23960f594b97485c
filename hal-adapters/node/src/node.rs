//! One tick of the stage controller: codes in, frames out; and its commands.

mod state;

pub use state::{Parameters, SampleFault};

use crate::fpu;
use crate::outbox::Outbox;
use crate::schedule::Period;
use embedded_can::Frame;
use hal_adapters::can::command::Content;
use hal_adapters::can::sensor::{self, TemperatureSender};
pub use hal_adapters::can::status::BoardFacts;
use hal_adapters::can::status::{HealthPage, NodeState, NodeStatus, bit, board_check, flag};
use hal_adapters::can::table::{Message, SLOW_TICKS};
use hal_adapters::can::update::{Identity, Nonce, Receiver, Store, Updates};
use hal_adapters::can::{Layout, PROTOCOL_VERSION, PoseSender, Service};
use runtime::tracker::Health;
use runtime::zero_offset::ZeroOffsetSettings;
use runtime::{AnyDecoder, PlanarPose, PoseTracker, RawFrame, Reading, Status};

/// The reading of a tick that gave no pose.
const NOTHING: Reading = Reading {
    pose: runtime::Pose {
        planar: PlanarPose::ZERO,
        vertical: runtime::VerticalPose::ZERO,
    },
    status: Status::PLANAR_INVALID.with(Status::VERTICAL_INVALID),
};

/// The stage and its servo.
#[derive(Clone, Copy, Debug)]
pub struct Settings<'s> {
    /// Serial number, key, version of the program.
    pub identity: Identity<'s>,
    /// The servo period.
    pub period: Period,
    /// Limits of rest at the zero.
    pub rezero_limits: ZeroOffsetSettings,
}

/// Input of a tick from the rest of the program and the board.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Facts {
    /// Ticks that came late or not at all.
    pub missed_ticks: u32,
    /// Times the bus was off.
    pub bus_off: u32,
    /// Whether the service pin says that the servo is off; `None` without such a pin. A node without pin and key takes
    /// the servo for on: any sender could declare it off.
    pub servo_off_pin: Option<bool>,
    /// Findings of the start-up.
    pub board: BoardFacts,
}

impl Facts {
    /// Notes a check of the board, a bit of [`board_check`].
    pub const fn note(&mut self, check: u32, fails: bool) {
        self.board.board_checks &= !check;
        self.board.board_checks |= bit(check, fails);
    }
}

/// The stage controller, apart from its chip.
#[derive(Clone, Debug)]
pub struct Node<'s> {
    parameters: Parameters,
    period: Period,
    watchdog_reset: bool,
    /// How codes are put into frames.
    layout: Layout,
    sender: PoseSender,
    temperatures: TemperatureSender,
    service: Service,
    receiver: Receiver<'s>,
    has_key: bool,
    /// Ticks since start.
    pub ticks: u32,
    state: (NodeState, u8),
    /// Ticks with changed settings of the FPU.
    pub fpu_restored: u32,
    board_checks: u32,
    /// Times the bus was off, as the last state says.
    bus_off_sent: u32,
}

impl<'s> Node<'s> {
    /// A node before its first tick; `layout` holds the codes of its converter.
    pub fn new(
        parameters: Parameters,
        watchdog_reset: bool,
        layout: Layout,
        settings: Settings<'s>,
    ) -> Self {
        let Settings {
            identity, period, ..
        } = settings;
        let service = Service::new(period.ticks_per_s());
        Self {
            parameters,
            period,
            watchdog_reset,
            layout,
            sender: PoseSender::default(),
            temperatures: TemperatureSender::START,
            service: service.with_rezero_limits(settings.rezero_limits),
            has_key: identity.key.is_some(),
            receiver: Receiver::new(identity, period.ticks_per_s()),
            ticks: 0,
            state: (NodeState::Starting, 0),
            fpu_restored: 0,
            board_checks: 0,
            bus_off_sent: 0,
        }
    }

    /// The zero deviation that is subtracted, as a pose.
    pub const fn zero(&self) -> PlanarPose<f32> {
        match &self.parameters.servo {
            Some(servo) => servo.zero(),
            None => PlanarPose::ZERO,
        }
    }

    /// Subtracts a zero deviation that was kept over a reset. Without parameters, or if it is
    /// not finite, nothing happens.
    pub fn restore_zero(&mut self, zero: PlanarPose<f32>) {
        if let Some(servo) = &mut self.parameters.servo {
            servo.set_zero(zero);
        }
    }

    /// The decoder, if there are parameters to decode with.
    pub const fn decoder(&self) -> Option<&AnyDecoder> {
        match &self.parameters.servo {
            Some(servo) => Some(servo.decoder()),
            None => None,
        }
    }

    /// Whether the LED is to be on.
    pub fn light(&self) -> bool {
        crate::light::is_on(
            self.state.0,
            self.board_checks,
            self.service.is_identifying(),
            self.ticks,
            self.period,
        )
    }

    /// One tick: decodes the codes and puts the frames that are due into the outbox.
    pub fn tick(
        &mut self,
        sample: Result<RawFrame, SampleFault>,
        facts: &Facts,
        outbox: &mut Outbox,
    ) -> Reading {
        let servo = self.parameters.servo.as_mut();
        let without_pin = (!self.has_key).then_some(false);
        (self.service).before_tick(servo, facts.servo_off_pin.or(without_pin));
        let reading = self.decode(&sample);
        let is_updating = self.receiver.is_updating();
        self.state = self.parameters.state(is_updating, &sample, &reading);
        self.board_checks = facts.board.board_checks;
        if self.decoder().is_some() {
            self.send_pose(&reading, sample.as_ref().ok(), outbox);
        }
        if let Ok(frame) = &sample {
            let temperatures = self.temperatures.frame(frame);
            temperatures
                .into_iter()
                .for_each(|frame| outbox.push(frame));
            if self.service.is_recording() {
                self.send_codes(frame, outbox);
            }
        }
        let answer = self.service.tick(self.parameters.servo.as_ref());
        let was_off = core::mem::replace(&mut self.bus_off_sent, facts.bus_off) != facts.bus_off;
        self.receiver.tick(self.service.servo_is_off());
        let due = match self.ticks % u32::from(SLOW_TICKS) {
            0 => Some(Content::Status(self.status(facts))),
            // A receiver must know why no frames come.
            _ if was_off || self.is_storing() => Some(Content::Status(self.status(facts))),
            8 => {
                let number = self.ticks / u32::from(SLOW_TICKS);
                let page = HealthPage::new(&self.health(), Some(&facts.board), number);
                Some(Content::Health(page))
            }
            _ => None,
        };
        let due = due.and_then(|content| self.service.send(&content));
        let frames = answer.into_iter().chain(due);
        frames.for_each(|frame| outbox.push(frame));
        self.ticks = self.ticks.wrapping_add(1);
        reading
    }

    /// Takes a frame from the bus, and answers a command. `nonce` is a fresh random number, if there is one.
    pub fn take<F: Frame>(
        &mut self,
        frame: &F,
        outbox: &mut Outbox,
        store: &mut dyn Store,
        nonce: Option<Nonce>,
    ) {
        let servo = self.parameters.servo.as_mut();
        let mut updates = Updates {
            receiver: &mut self.receiver,
            store,
            nonce,
        };
        if let Some(Ok(answered)) = self.service.take(frame, servo, Some(&mut updates))
            && let Some(answer) = answered.answer
        {
            outbox.push(answer);
        }
    }

    /// Whether [`Node::store`] is to be called at the end of a tick, once all frames have left.
    pub const fn is_storing(&self) -> bool {
        self.receiver.is_storing()
    }

    /// Stores new parameters: takes half a second.
    pub fn store(&mut self, outbox: &mut Outbox, store: &mut dyn Store) {
        let answer = self.receiver.store(self.service.servo_is_off(), store);
        let frame = answer.and_then(|answer| self.service.send(&Content::Answer(answer)));
        frame.into_iter().for_each(|frame| outbox.push(frame));
    }

    /// Whether the controller is to be reset, once its answers have left.
    pub const fn wants_reset(&self) -> bool {
        self.receiver.wants_reset()
    }

    fn send_pose(&mut self, reading: &Reading, sampled: Option<&RawFrame>, outbox: &mut Outbox) {
        let mut frames = self.sender.frames(reading, sampled);
        outbox.push_group(frames.by_ref().take(3));
        frames.for_each(|frame| outbox.push(frame));
    }

    /// Comes after the pose: control does not wait for the record.
    fn send_codes(&self, frame: &RawFrame, outbox: &mut Outbox) {
        let mut frames = sensor::frames(self.layout, frame).peekable();
        if let Some(time) = frames.next_if(|frame| frame.message == Message::SensorTime) {
            outbox.push(time);
        }
        outbox.push_group(frames);
    }

    fn decode(&mut self, sample: &Result<RawFrame, SampleFault>) -> Reading {
        let Some(servo) = &mut self.parameters.servo else {
            return NOTHING;
        };
        let changed_before = fpu::restore();
        let reading = run(servo, sample);
        let changed_meanwhile = fpu::restore();
        if changed_before || changed_meanwhile {
            self.fpu_restored = self.fpu_restored.saturating_add(1);
        }
        // Other settings give other words than the host's.
        if changed_meanwhile || self.receiver.is_updating() {
            NOTHING
        } else {
            reading
        }
    }

    fn status(&self, facts: &Facts) -> NodeStatus {
        let on = |bit, is| if is { bit } else { 0 };
        let (state, reason) = self.state;
        let by_internal = facts.board.board_checks & board_check::INTERNAL_OSCILLATOR != 0;
        NodeStatus {
            state: Some(state),
            reason,
            flags: on(flag::WATCHDOG_RESET, self.watchdog_reset)
                | on(flag::BUS_WAS_OFF, facts.bus_off > 0)
                | on(flag::INTERNAL_OSCILLATOR, by_internal)
                | self.service.flags(self.parameters.servo.as_ref()),
            missed_ticks: u16::try_from(facts.missed_ticks).unwrap_or(u16::MAX),
            bus_off: u8::try_from(facts.bus_off).unwrap_or(u8::MAX),
            version: PROTOCOL_VERSION,
        }
    }

    fn health(&self) -> Health {
        match &self.parameters.servo {
            Some(servo) => servo.health(),
            None => Health {
                ticks: self.ticks,
                planar_invalid: self.ticks,
                vertical_invalid: self.ticks,
                ..Health::default()
            },
        }
    }
}

/// The arithmetic of a tick, in a function of its own: the checks of the FPU's settings stay
/// before and after it.
#[inline(never)]
fn run(servo: &mut PoseTracker, sample: &Result<RawFrame, SampleFault>) -> Reading {
    match sample {
        Ok(frame) => servo.tick(frame),
        Err(_) => servo.tick_without_frame(),
    }
}

#[cfg(test)]
#[path = "node_tests.rs"]
mod tests;
