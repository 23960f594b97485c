//! One tick of the stage controller: codes in, frames out; and what it is asked for.
//!
//! State and reason of the status frame (every 16 ticks, and at once after the bus was off):
//!
//! | state | reason |
//! |---|---|
//! | 1 running | 0; or 0x80 + reason of parameters that do not run: of a slot, if that is damaged; 12: those that are passed over, as they made the program fault twice; 13: the flash cannot be written |
//! | 2 no parameters | 2: both slots are erased |
//! | 3 bad parameters | slot * 16 + kind: 1 cut short, 3 no blob at all, 4 newer layout, 5 bad header, 7 wrong check (torn), 8 bad payload, 9 unusable values, 10 another stage's; 12 made the program fault twice, and there are no others: tried again at the next start |
//! | 4 no frames | 3 silent converter (line at 0 or 1), 7 no new codes |
//! | 5 sensor fault | 1 SPI, 2 pin, 4 wrong part, 5 wrong setting or unexpected reset, 6 wrong check, 8 wrong input, 10 SYNC does not arrive; 0x10 + channel: code at a rail, 0x20 + channel: code that never changes (0 to 2 Hall A to C, 3 to 5 gaps 1 to 3) |
//! | 6 self-test failed | 1: arithmetic is not that of the host, or the core would not restore the FPU's settings |
//! | 7 updating | 0: new parameters are coming or being stored, and every pose is invalid |

use crate::fpu::FpuSettings;
use crate::outbox::Outbox;
use crate::slots::Refusal;
use embedded_can::Frame;
use hal_adapters::adc::AdcError;
use hal_adapters::can::command::Told;
use hal_adapters::can::service::Updates;
pub use hal_adapters::can::status::BoardFacts;
use hal_adapters::can::status::{HealthPage, NodeState, NodeStatus, board_check, flag};
use hal_adapters::can::table::{Message, SLOW_TICKS};
use hal_adapters::can::update::{Identity, Nonce, Receiver, Store};
use hal_adapters::can::{Layout, PROTOCOL_VERSION, PoseSender, Service, sensor};
use runtime::servo::Health;
use runtime::{PlanarPose, RawFrame, Reading, Servo, Status};

/// Ticks of a second.
const TICKS_PER_SECOND: u32 = 1_000_000 / crate::schedule::PERIOD_US;

/// Reasons of [`NodeState::SensorFault`] from here on: a code at a rail or implausible, with
/// its channel (0 to 2 Hall A to C, 3 to 5 gaps 1 to 3). Below: [`AdcError::number`].
pub const REASON_CHANNEL: u8 = 0x10;
/// Reasons of [`NodeState::Running`] with this bit: the other slot is damaged; below it
/// [`Refusal::reason`].
pub const REASON_OTHER_SLOT: u8 = 0x80;
/// Reason of [`NodeState::SelfTestFailed`]: arithmetic is not that of the host, or the core
/// would not restore the FPU's settings for interrupts.
pub const REASON_FPU: u8 = 1;

/// The reading of a tick that gave no pose.
const NOTHING: Reading = Reading {
    pose: runtime::Pose {
        planar: PlanarPose {
            x_m: 0.0,
            y_m: 0.0,
            rz_rad: 0.0,
        },
        vertical: runtime::VerticalPose {
            z_m: 0.0,
            rx_rad: 0.0,
            ry_rad: 0.0,
        },
    },
    status: Status::PLANAR_INVALID.with(Status::VERTICAL_INVALID),
};

/// What the rest of the program and the board tell the node in each tick.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Facts {
    /// Ticks that came late or not at all.
    pub missed_ticks: u32,
    /// Times the bus was off.
    pub bus_off: u32,
    /// Whether the service pin says that the servo is off; `None`: this board has no such pin.
    pub servo_off_pin: Option<bool>,
    /// Whether the core runs on its internal oscillator.
    pub internal_oscillator: bool,
    /// What the start-up found.
    pub board: BoardFacts,
}

impl Facts {
    /// Notes whether the CAN controller takes part in the bus.
    pub const fn note_bus(&mut self, takes_part: bool) {
        self.board.board_checks &= !board_check::CAN_NOT_STARTED;
        if !takes_part {
            self.board.board_checks |= board_check::CAN_NOT_STARTED;
        }
    }
}

/// A fault of the converter in one byte, and whether it gave nothing at all.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SampleFault {
    reason: u8,
    silent: bool,
}

impl<B> From<&AdcError<B>> for SampleFault {
    fn from(error: &AdcError<B>) -> Self {
        Self {
            reason: error.number(),
            silent: matches!(error, AdcError::Silent { .. } | AdcError::NotReady { .. }),
        }
    }
}

/// Why a node decodes or does not.
#[derive(Clone, Debug)]
#[expect(
    clippy::large_enum_variant,
    reason = "there is one, in a static, and no heap"
)]
pub enum Parameters<'d> {
    /// There are parameters.
    Usable {
        /// Runs their decoder.
        servo: Servo<'d>,
        /// Serial number of the stage.
        serial: &'d str,
        /// What is wrong with parameters that are not used.
        other_slot: Option<Refusal>,
    },
    /// There are none, or none that are sound.
    None {
        /// What is wrong with the slots.
        refusal: Refusal,
    },
    /// The controller failed its own test and must not decode.
    SelfTestFailed,
}

/// The stage controller, apart from its chip.
#[derive(Clone, Debug)]
pub struct Node<'d> {
    parameters: Parameters<'d>,
    watchdog_reset: bool,
    /// How codes are put into frames.
    layout: Layout,
    sender: PoseSender,
    service: Service,
    receiver: Receiver<'d>,
    ticks: u32,
    state: (NodeState, u8),
    fpu_restored: u32,
    board_checks: u32,
    /// Times the bus was off that a state has told.
    bus_off_told: u32,
}

impl<'d> Node<'d> {
    /// A node before its first tick; `layout` holds the codes of its converter.
    pub fn new(
        parameters: Parameters<'d>,
        watchdog_reset: bool,
        layout: Layout,
        identity: Identity<'d>,
    ) -> Self {
        Self {
            parameters,
            watchdog_reset,
            layout,
            sender: PoseSender::default(),
            service: Service::new(TICKS_PER_SECOND),
            receiver: Receiver::new(identity, TICKS_PER_SECOND),
            ticks: 0,
            state: (NodeState::Starting, 0),
            fpu_restored: 0,
            board_checks: 0,
            bus_off_told: 0,
        }
    }

    /// Sends codes from the start, as if asked for.
    #[must_use]
    pub fn recording(self, is_on: bool) -> Self {
        Self {
            service: self.service.recording(is_on),
            ..self
        }
    }

    /// The zero deviation that is subtracted, as a pose.
    pub const fn zero(&self) -> PlanarPose<f32> {
        match self.servo() {
            Some(servo) => servo.zero(),
            None => PlanarPose::ZERO,
        }
    }

    /// Subtracts a zero deviation that was kept over a reset. Without parameters, or if it is
    /// not finite, nothing happens.
    pub fn restore_zero(&mut self, zero: PlanarPose<f32>) {
        if let Some(servo) = servo_of(&mut self.parameters) {
            servo.set_zero(zero);
        }
    }

    /// Whether there are parameters to decode with.
    pub const fn decodes(&self) -> bool {
        self.servo().is_some()
    }

    /// State and reason after the last tick.
    pub const fn state(&self) -> (NodeState, u8) {
        self.state
    }

    /// Ticks since start.
    pub const fn ticks(&self) -> u32 {
        self.ticks
    }

    /// Ticks in which the FPU's settings had been changed by something else.
    pub const fn fpu_restored(&self) -> u32 {
        self.fpu_restored
    }

    /// Whether the LED is to be on.
    pub const fn light(&self) -> bool {
        crate::light::is_on(
            self.state.0,
            self.board_checks,
            self.service.is_identifying(),
            self.ticks,
        )
    }

    /// One tick: decodes the codes and puts the frames that are due into the outbox.
    pub fn tick(
        &mut self,
        sample: Result<RawFrame, SampleFault>,
        facts: &Facts,
        fpu: &mut impl FpuSettings,
        outbox: &mut Outbox,
    ) -> Reading {
        let servo = servo_of(&mut self.parameters);
        self.service.before_tick(servo, facts.servo_off_pin);
        let reading = self.decode(&sample, fpu);
        self.state = self.state_of(&sample, &reading);
        self.board_checks = facts.board.board_checks;
        if let Parameters::Usable { .. } = self.parameters {
            self.send_pose(&reading, sample.as_ref().ok(), outbox);
        }
        if let Ok(frame) = &sample
            && self.service.is_recording()
        {
            self.send_codes(frame, outbox);
        }
        let servo = servo_of(&mut self.parameters);
        let answer = self.service.tick(servo.as_deref());
        let page = self.service.identity_page(self.serial());
        let was_off = core::mem::replace(&mut self.bus_off_told, facts.bus_off) != facts.bus_off;
        let due = match self.ticks % u32::from(SLOW_TICKS) {
            0 => Some(Told::Status(self.status(facts))),
            _ if was_off => Some(Told::Status(self.status(facts))),
            8 => {
                let number = self.ticks / u32::from(SLOW_TICKS);
                let page = HealthPage::of(&self.health(), Some(&facts.board), number);
                Some(Told::Health(page))
            }
            _ => None,
        };
        let told = due.and_then(|told| self.service.tell(&told));
        let frames = answer.into_iter().chain(page).chain(told);
        frames.for_each(|frame| outbox.push(frame));
        self.ticks = self.ticks.wrapping_add(1);
        reading
    }

    /// Takes a frame that came over the bus, and answers if it is a command. `nonce` is a fresh
    /// random number, if there is a source of any.
    pub fn take<F: Frame>(
        &mut self,
        frame: &F,
        outbox: &mut Outbox,
        store: &mut dyn Store,
        nonce: Option<Nonce>,
    ) {
        let servo = servo_of(&mut self.parameters);
        let updates = Updates {
            receiver: &mut self.receiver,
            store,
            nonce,
        };
        if let Some(Ok(answered)) = self.service.take_updating(frame, servo, Some(updates))
            && let Some(answer) = answered.answer
        {
            outbox.push(answer);
        }
    }

    /// A step of an update, if one runs: at the end of a tick, as it may take 0.2 ms and more.
    pub fn update(&mut self, outbox: &mut Outbox, store: &mut dyn Store) {
        let answer = self.receiver.tick(self.service.servo_is_off(), store);
        let told = answer.and_then(|answer| self.service.tell(&Told::Answer(answer)));
        told.into_iter().for_each(|frame| outbox.push(frame));
    }

    /// Whether the controller is to be reset, once its answers have left.
    pub const fn wants_reset(&self) -> bool {
        self.receiver.wants_reset()
    }

    fn send_pose(&mut self, reading: &Reading, sampled: Option<&RawFrame>, outbox: &mut Outbox) {
        let mut frames = self.sender.frames(reading, sampled);
        if let (Some(x), Some(y), Some(rz)) = (frames.next(), frames.next(), frames.next()) {
            outbox.push_group(&[x, y, rz]);
        }
        frames.for_each(|frame| outbox.push(frame));
    }

    /// After the pose: whoever controls by it does not wait for the record.
    fn send_codes(&self, frame: &RawFrame, outbox: &mut Outbox) {
        let mut frames = sensor::frames(self.layout, frame).peekable();
        if let Some(time) = frames.next_if(|frame| frame.message == Message::SensorTime) {
            outbox.push(time);
        }
        match (frames.next(), frames.next(), frames.next()) {
            (Some(a), Some(b), Some(c)) => outbox.push_group(&[a, b, c]),
            (Some(a), Some(b), None) => outbox.push_group(&[a, b]),
            _ => {}
        }
    }

    fn decode(
        &mut self,
        sample: &Result<RawFrame, SampleFault>,
        fpu: &mut impl FpuSettings,
    ) -> Reading {
        let Parameters::Usable { servo, .. } = &mut self.parameters else {
            return NOTHING;
        };
        let changed_before = fpu.restore();
        let reading = run(servo, sample);
        let changed_meanwhile = fpu.restore();
        if changed_before || changed_meanwhile {
            self.fpu_restored = self.fpu_restored.saturating_add(1);
        }
        // Whatever was computed under other settings is not what the host would compute.
        if changed_meanwhile || self.receiver.is_updating() {
            NOTHING
        } else {
            reading
        }
    }

    fn state_of(
        &self,
        sample: &Result<RawFrame, SampleFault>,
        reading: &Reading,
    ) -> (NodeState, u8) {
        let other_slot = match &self.parameters {
            Parameters::SelfTestFailed => return (NodeState::SelfTestFailed, REASON_FPU),
            _ if self.receiver.is_updating() => return (NodeState::Updating, 0),
            Parameters::None { refusal } if refusal.erased => {
                return (NodeState::NoParameters, refusal.reason);
            }
            Parameters::None { refusal } => return (NodeState::BadParameters, refusal.reason),
            Parameters::Usable { other_slot, .. } => other_slot.filter(|slot| !slot.erased),
        };
        let bad_codes = reading.status.bits() & Status::HALL.with(Status::CAPACITIVE).bits();
        match sample {
            Err(fault) if fault.silent => (NodeState::NoFrames, fault.reason),
            Err(fault) => (NodeState::SensorFault, fault.reason),
            Ok(_) if bad_codes != 0 => {
                let channel = bad_codes.trailing_zeros() as u8;
                (NodeState::SensorFault, REASON_CHANNEL + channel)
            }
            Ok(_) => {
                let reason = other_slot.map_or(0, |slot| REASON_OTHER_SLOT | slot.reason);
                (NodeState::Running, reason)
            }
        }
    }

    fn status(&self, facts: &Facts) -> NodeStatus {
        let on = |bit, is| if is { bit } else { 0 };
        let (state, reason) = self.state;
        NodeStatus {
            state: Some(state),
            reason,
            flags: on(flag::WATCHDOG_RESET, self.watchdog_reset)
                | on(flag::BUS_WAS_OFF, facts.bus_off > 0)
                | on(flag::INTERNAL_OSCILLATOR, facts.internal_oscillator)
                | self.service.flags(self.servo()),
            missed_ticks: u16::try_from(facts.missed_ticks).unwrap_or(u16::MAX),
            bus_off: u8::try_from(facts.bus_off).unwrap_or(u8::MAX),
            version: PROTOCOL_VERSION,
        }
    }

    fn health(&self) -> Health {
        match self.servo() {
            Some(servo) => servo.health(),
            None => Health {
                ticks: self.ticks,
                planar_invalid: self.ticks,
                vertical_invalid: self.ticks,
                ..Health::default()
            },
        }
    }

    const fn servo(&self) -> Option<&Servo<'d>> {
        match &self.parameters {
            Parameters::Usable { servo, .. } => Some(servo),
            Parameters::None { .. } | Parameters::SelfTestFailed => None,
        }
    }

    fn serial(&self) -> &'d str {
        match self.parameters {
            Parameters::Usable { serial, .. } => serial,
            Parameters::None { .. } | Parameters::SelfTestFailed => "",
        }
    }
}

/// The servo, where there are parameters.
const fn servo_of<'p, 'd>(parameters: &'p mut Parameters<'d>) -> Option<&'p mut Servo<'d>> {
    match parameters {
        Parameters::Usable { servo, .. } => Some(servo),
        Parameters::None { .. } | Parameters::SelfTestFailed => None,
    }
}

/// The arithmetic of a tick, in a function of its own: the checks of the FPU's settings stay
/// before and after it.
#[inline(never)]
fn run(servo: &mut Servo<'_>, sample: &Result<RawFrame, SampleFault>) -> Reading {
    match sample {
        Ok(frame) => servo.tick(frame),
        Err(_) => servo.tick_without_frame(),
    }
}

#[cfg(test)]
#[path = "node_tests.rs"]
mod tests;
