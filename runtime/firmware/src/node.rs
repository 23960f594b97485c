//! One tick of the stage controller: codes in, frames out; and what it is asked for.
//!
//! State and reason of the status frame (every 16 ticks):
//!
//! | state | reason |
//! |---|---|
//! | 1 running | 0; or 0x80 + reason of the other slot, if that is damaged |
//! | 2 no parameters | 2: both slots are erased |
//! | 3 bad parameters | slot * 16 + kind: 1 cut short, 3 no blob at all, 4 newer layout, 5 bad header, 7 wrong check (torn), 8 bad payload, 9 unusable values, 10 another stage's |
//! | 4 no frames | 3 silent converter (line at 0 or 1), 7 no new codes |
//! | 5 sensor fault | 1 SPI, 2 pin, 4 wrong part, 5 wrong setting or unexpected reset, 6 wrong check, 8 wrong input, 9 codes that never change; 0x10 + channel: code at a rail (0 to 2 Hall A to C, 3 to 5 gaps 1 to 3) |
//! | 6 self-test failed | 1: arithmetic is not that of the host, or the core would not restore the FPU's settings |

use crate::fpu::FpuSettings;
use crate::outbox::Outbox;
use crate::slots::Refusal;
use embedded_can::Frame;
use hal_adapters::adc::AdcError;
use hal_adapters::can::command::{Answer, Command, IdentityPage, Mailbox, Outcome, Request, Told};
use hal_adapters::can::status::{HealthPage, NodeState, NodeStatus, flag};
use hal_adapters::can::table::SLOW_TICKS;
use hal_adapters::can::{PROTOCOL_VERSION, PoseSender};
use runtime::rezero::{RezeroSettings, RezeroState};
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

/// What the rest of the program tells in the status frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Facts {
    /// Ticks that came late or not at all.
    pub missed_ticks: u32,
    /// Times the bus was off.
    pub bus_off: u32,
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
        /// What is wrong with the slot that is not used.
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
    sender: PoseSender,
    mailbox: Mailbox,
    ticks: u32,
    state: (NodeState, u8),
    fpu_restored: u32,
    /// Token of the re-zero that runs.
    rezero: Option<u8>,
    rezero_flags: u8,
    identify_ticks: u32,
    identity_page: u8,
}

impl<'d> Node<'d> {
    /// A node before its first tick.
    pub fn new(parameters: Parameters<'d>, watchdog_reset: bool) -> Self {
        Self {
            parameters,
            watchdog_reset,
            sender: PoseSender::default(),
            mailbox: Mailbox::default(),
            ticks: 0,
            state: (NodeState::Starting, 0),
            fpu_restored: 0,
            rezero: None,
            rezero_flags: 0,
            identify_ticks: 0,
            identity_page: IdentityPage::PAGES,
        }
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
        crate::light::is_on(self.state.0, self.identify_ticks > 0, self.ticks)
    }

    /// One tick: decodes the codes and puts the frames that are due into the outbox.
    pub fn tick(
        &mut self,
        sample: Result<RawFrame, SampleFault>,
        facts: &Facts,
        fpu: &mut impl FpuSettings,
        outbox: &mut Outbox,
    ) -> Reading {
        let reading = self.decode(&sample, fpu);
        self.state = self.state_of(&sample, &reading);
        if let Parameters::Usable { .. } = self.parameters {
            // The controller takes a frame only before frames of lower priority: Rz, Y, X
            // fill its three mailboxes at once, X, Y, Rz would wait for each other.
            let mut frames = self.sender.frames(&reading);
            if let (Some(x), Some(y), Some(rz)) = (frames.next(), frames.next(), frames.next()) {
                [rz, y, x].into_iter().for_each(|frame| outbox.push(frame));
            }
            frames.for_each(|frame| outbox.push(frame));
        }
        self.follow_rezero(outbox);
        self.follow_identify(outbox);
        match self.ticks % u32::from(SLOW_TICKS) {
            0 => self.tell(&Told::Status(self.status(facts)), outbox),
            8 => {
                let page = self.ticks / u32::from(SLOW_TICKS);
                self.tell(&Told::Health(HealthPage::of(&self.health(), page)), outbox);
            }
            _ => {}
        }
        self.ticks = self.ticks.wrapping_add(1);
        reading
    }

    /// Takes a frame that came over the bus, and answers if it is a command.
    pub fn take<F: Frame>(&mut self, frame: &F, outbox: &mut Outbox) {
        let Some(Ok(Told::Command(command))) = self.mailbox.take(frame) else {
            return;
        };
        let (outcome, detail) = self.obey(&command);
        self.answer(command.number, command.token, outcome, detail, outbox);
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
        if changed_meanwhile { NOTHING } else { reading }
    }

    fn state_of(
        &self,
        sample: &Result<RawFrame, SampleFault>,
        reading: &Reading,
    ) -> (NodeState, u8) {
        let other_slot = match &self.parameters {
            Parameters::SelfTestFailed => return (NodeState::SelfTestFailed, REASON_FPU),
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
                | on(flag::REZERO_RUNS, self.rezero.is_some())
                | on(flag::IDENTIFYING, self.identify_ticks > 0)
                | self.rezero_flags,
            missed_ticks: u16::try_from(facts.missed_ticks).unwrap_or(u16::MAX),
            bus_off: u8::try_from(facts.bus_off).unwrap_or(u8::MAX),
            version: PROTOCOL_VERSION,
        }
    }

    fn health(&self) -> Health {
        match &self.parameters {
            Parameters::Usable { servo, .. } => servo.health(),
            Parameters::None { .. } | Parameters::SelfTestFailed => Health {
                ticks: self.ticks,
                planar_invalid: self.ticks,
                vertical_invalid: self.ticks,
                ..Health::default()
            },
        }
    }

    fn obey(&mut self, command: &Command) -> (Outcome, u32) {
        let Parameters::Usable { servo, .. } = &mut self.parameters else {
            return match command.request {
                Some(Request::Identify { seconds }) => self.identify(seconds),
                Some(_) => (Outcome::NoParameters, 0),
                None => (Outcome::UnknownCommand, 0),
            };
        };
        match command.request {
            None => (Outcome::UnknownCommand, 0),
            Some(Request::Identify { seconds }) => self.identify(seconds),
            Some(_) if self.rezero.is_some() => (Outcome::Busy, 0),
            Some(Request::ClearZero) => {
                servo.set_zero(PlanarPose::ZERO);
                self.rezero_flags = 0;
                (Outcome::Done, 0)
            }
            Some(Request::Rezero { ticks }) => {
                let mut settings = RezeroSettings::default();
                if ticks > 0 {
                    settings.ticks = ticks;
                }
                servo.start_rezero(settings);
                if let RezeroState::Refused(refusal) = servo.rezero_state() {
                    self.rezero_flags |= flag::REZERO_REFUSED;
                    return Outcome::of_refusal(&refusal);
                }
                self.rezero = Some(command.token);
                self.rezero_flags &= !flag::REZERO_REFUSED;
                (Outcome::Started, 0)
            }
        }
    }

    fn identify(&mut self, seconds: u8) -> (Outcome, u32) {
        self.identify_ticks = u32::from(seconds) * TICKS_PER_SECOND;
        self.identity_page = 0;
        (Outcome::Done, 0)
    }

    /// Answers once the re-zero that runs has ended.
    fn follow_rezero(&mut self, outbox: &mut Outbox) {
        let (Some(token), Parameters::Usable { servo, .. }) = (self.rezero, &self.parameters)
        else {
            return;
        };
        let (outcome, detail) = match servo.rezero_state() {
            RezeroState::Running { .. } | RezeroState::Idle => return,
            RezeroState::Done { .. } => {
                self.rezero_flags |= flag::REZEROED;
                (Outcome::Done, 0)
            }
            RezeroState::Refused(refusal) => {
                self.rezero_flags |= flag::REZERO_REFUSED;
                Outcome::of_refusal(&refusal)
            }
        };
        self.rezero = None;
        let number = Command::new(Request::Rezero { ticks: 0 }, token).number;
        self.answer(number, token, outcome, detail, outbox);
    }

    /// Sends one page of the serial number a tick.
    fn follow_identify(&mut self, outbox: &mut Outbox) {
        self.identify_ticks = self.identify_ticks.saturating_sub(1);
        if self.identity_page < IdentityPage::PAGES {
            let serial = match &self.parameters {
                Parameters::Usable { serial, .. } => serial,
                Parameters::None { .. } | Parameters::SelfTestFailed => "",
            };
            let page = IdentityPage::of(serial, self.identity_page);
            self.identity_page += 1;
            self.tell(&Told::Identity(page), outbox);
        }
    }

    fn answer(
        &mut self,
        number: u8,
        token: u8,
        outcome: Outcome,
        detail: u32,
        outbox: &mut Outbox,
    ) {
        let answer = Answer {
            number,
            token,
            outcome: Some(outcome),
            detail,
        };
        self.tell(&Told::Answer(answer), outbox);
    }

    fn tell(&mut self, what: &Told, outbox: &mut Outbox) {
        if let Some(frame) = self.mailbox.send(what) {
            outbox.push(frame);
        }
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
