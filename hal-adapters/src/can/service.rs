//! [`Service`] takes the commands for a decoding node, obeys them, and gives their answers. A controller and a
//! computer use the same code.
//!
//! Setting or clearing the zero moves the pose at once, and a stage with its servo on follows. Both are refused
//! unless the servo was declared off ([`Request::ServoOff`]; the declaration expires) and the board's service
//! pin, if it has one, agrees. A node with a key obeys such a request only with a tag
//! ([`Command::needs_authority`]); a node without a key obeys only while the line says that the servo is off. A node without
//! key and line obeys any sender's declaration: a controller of that kind says "on" in place of the line.
//!
//! ```
//! use hal_adapters::can::BusFrame;
//! use hal_adapters::can::command::{Command, Content, Mailbox, Outcome, Request};
//! use hal_adapters::can::service::Service;
//!
//! let (mut host, mut node) = (Mailbox::default(), Service::new(500));
//! let record = Content::Command(Command::new(Request::Record { on: true }, 17));
//! let frame = BusFrame::from(host.send(&record).expect("a command"));
//! let answered = node.take(&frame, None::<&mut runtime::PoseTracker>, None).expect("a command").expect("a sound one");
//! assert!(node.is_recording());
//! let answer = host.take(&BusFrame::from(answered.answer.expect("an answer")));
//! assert!(matches!(answer, Some(Ok(Content::Answer(a))) if a.outcome == Some(Outcome::Done)));
//! ```

use super::command::{Answer, Command, Content, Mailbox, Outcome, Request};
use super::frame::Coded;
use super::notice::BusFault;
use super::status::flag;
use super::update::{UpdateData, UpdateRequest};
use embedded_can::Frame;
use runtime::zero_offset::{ZeroOffsetSettings, ZeroOffsetState};
use runtime::{Decode, PlanarPose, PoseTracker};

/// The part of a node that takes new parameters: `update::Updates`, by the feature `update`.
pub trait TakesUpdates {
    /// Whether a tag must come before the command, and, if so, the answer unless it came.
    fn authorise(&mut self, command: &Command) -> Option<Option<(Outcome, u32)>>;

    /// Obeys a request, and gives outcome and detail of its answer.
    fn obey(&mut self, token: u8, request: UpdateRequest, servo_off: bool) -> (Outcome, u32);

    /// Notes the answer to a command that needs a tag.
    fn note_answer(&mut self, command: &Command, answer: (Outcome, u32));

    /// Takes a word of a tag or of parameters.
    fn take(&mut self, data: &UpdateData);
}

/// A command that came, and its answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Answered {
    /// The command.
    pub command: Command,
    /// Its answer, to be sent.
    pub answer: Option<Coded>,
}

/// Obeys commands. It counts time in ticks: call [`Service::tick`] in every one.
#[derive(Clone, Debug)]
pub struct Service {
    ticks_per_s: u32,
    rezero_settings: ZeroOffsetSettings,
    mailbox: Mailbox,
    /// Token of the re-zero that runs.
    rezero: Option<u8>,
    was_refused: bool,
    /// Remaining ticks of the declaration that the servo is off.
    servo_off_ticks: u32,
    /// Whether the service pin says that the servo is off; `None` without such a pin.
    servo_off_pin: Option<bool>,
    identify_ticks: u32,
    is_recording: bool,
}

impl Service {
    /// Before the first command; `ticks_per_s` is the servo's rate.
    pub fn new(ticks_per_s: u32) -> Self {
        Self {
            ticks_per_s,
            rezero_settings: ZeroOffsetSettings::default(),
            mailbox: Mailbox::default(),
            rezero: None,
            was_refused: false,
            servo_off_ticks: 0,
            servo_off_pin: None,
            identify_ticks: 0,
            is_recording: false,
        }
    }

    /// Re-zeros within these limits in place of [`ZeroOffsetSettings::default`].
    #[must_use]
    pub const fn with_rezero_limits(mut self, limits: ZeroOffsetSettings) -> Self {
        self.rezero_settings = limits;
        self
    }

    /// Takes a frame from the bus, and obeys it if it is a command. `servo` is `None` for a node without
    /// parameters, `updates` for a node that takes no parameters over the bus. Gives `None` for a frame that
    /// is no command.
    ///
    /// # Errors
    /// The command's frame is damaged or repeated: not obeyed, not answered.
    pub fn take<F: Frame, D: Decode>(
        &mut self,
        frame: &F,
        servo: Option<&mut PoseTracker<D>>,
        mut updates: Option<&mut dyn TakesUpdates>,
    ) -> Option<Result<Answered, BusFault>> {
        match self.mailbox.take(frame)? {
            Ok(Content::Command(command)) => {
                // For lack of a tag or, without a key, of a line that says "off"; or the first answer to a repeated command.
                let line_is_on = matches!(self.servo_off_pin, Some(false));
                let by_line = line_is_on.then_some((Outcome::ServoOn, 0));
                let refusal = match &mut updates {
                    _ if !command.needs_authority() => None,
                    Some(updates) => updates.authorise(&command).unwrap_or(by_line),
                    None => by_line,
                };
                let (outcome, detail) = match (refusal, command.request, &mut updates) {
                    (Some(refusal), ..) => refusal,
                    (None, Some(Request::Update(request)), Some(updates)) => {
                        updates.obey(command.token, request, self.servo_is_off())
                    }
                    _ => self.obey(&command, servo),
                };
                if let Some(updates) = &mut updates
                    && command.needs_authority()
                {
                    updates.note_answer(&command, (outcome, detail));
                }
                let answer = self.answer(command.number, command.token, outcome, detail);
                Some(Ok(Answered { command, answer }))
            }
            Ok(Content::UpdateData(data)) => {
                updates?.take(&data);
                None
            }
            Ok(_) => None,
            Err(fault) => Some(Err(fault)),
        }
    }

    /// Call this before the servo's own tick, which may end a re-zero and move the pose: it cancels a running
    /// re-zero unless the servo is off. `servo_off_pin` says whether the service pin says "off"; `None` without
    /// such a pin.
    pub fn before_tick<D: Decode>(
        &mut self,
        servo: Option<&mut PoseTracker<D>>,
        servo_off_pin: Option<bool>,
    ) {
        self.servo_off_pin = servo_off_pin;
        if let Some(servo) = servo
            && self.rezero.is_some()
            && !self.servo_is_off()
        {
            servo.cancel_zero_offset();
        }
    }

    /// One tick, after the servo's own: counts the declaration and the blinking down, and answers a re-zero
    /// that has ended.
    pub fn tick<D: Decode>(&mut self, servo: Option<&PoseTracker<D>>) -> Option<Coded> {
        self.identify_ticks = self.identify_ticks.saturating_sub(1);
        self.servo_off_ticks = self.servo_off_ticks.saturating_sub(1);
        let (token, servo) = (self.rezero?, servo?);
        let (outcome, detail) = match servo.zero_offset_state() {
            ZeroOffsetState::Running { .. } => return None,
            ZeroOffsetState::Idle => (Outcome::ServoOn, 0),
            ZeroOffsetState::Done { .. } => (Outcome::Done, 0),
            ZeroOffsetState::Refused(refusal) => Outcome::from_refusal(&refusal),
        };
        self.rezero = None;
        self.was_refused = outcome != Outcome::Done;
        let number = Command::new(Request::Rezero { ticks: 0 }, token).number;
        self.answer(number, token, outcome, detail)
    }

    /// The frame with this content, numbered.
    pub fn send(&mut self, content: &Content) -> Option<Coded> {
        self.mailbox.send(content)
    }

    /// The bits of [`flag`] that follow from commands.
    pub fn flags<D: Decode>(&self, servo: Option<&PoseTracker<D>>) -> u8 {
        let on = |bit, is| if is { bit } else { 0 };
        let zero = servo.map_or(PlanarPose::ZERO, PoseTracker::zero);
        on(flag::REZERO_RUNS, self.rezero.is_some())
            | on(flag::ZERO_SET, zero != PlanarPose::ZERO)
            | on(flag::REZERO_REFUSED, self.was_refused)
            | on(flag::IDENTIFYING, self.is_identifying())
            | on(flag::RECORDING, self.is_recording)
    }

    /// Whether the node is to blink.
    pub const fn is_identifying(&self) -> bool {
        self.identify_ticks > 0
    }

    /// Whether the codes of every tick are to be sent.
    pub const fn is_recording(&self) -> bool {
        self.is_recording
    }

    /// Whether the zero and the parameters may be changed.
    pub const fn servo_is_off(&self) -> bool {
        self.servo_off_ticks > 0 && !matches!(self.servo_off_pin, Some(false))
    }

    fn obey<D: Decode>(
        &mut self,
        command: &Command,
        servo: Option<&mut PoseTracker<D>>,
    ) -> (Outcome, u32) {
        match command.request {
            Some(Request::Identify { seconds }) => self.identify_ticks = self.ticks_in(seconds),
            Some(Request::Record { on }) => self.is_recording = on,
            Some(Request::ServoOff { seconds }) => self.servo_off_ticks = self.ticks_in(seconds),
            Some(Request::Rezero { ticks }) => return self.zero(Some(ticks), command.token, servo),
            Some(Request::ClearZero) => return self.zero(None, command.token, servo),
            Some(Request::Update(_)) | None => return (Outcome::UnknownCommand, 0),
        }
        (Outcome::Done, 0)
    }

    /// Starts a re-zero of this number of ticks, or clears the zero.
    fn zero<D: Decode>(
        &mut self,
        ticks: Option<u16>,
        token: u8,
        servo: Option<&mut PoseTracker<D>>,
    ) -> (Outcome, u32) {
        let Some(servo) = servo else {
            return (Outcome::NoParameters, 0);
        };
        if self.rezero.is_some() {
            return (Outcome::Busy, 0);
        }
        if !self.servo_is_off() {
            return (Outcome::ServoOn, 0);
        }
        self.was_refused = false;
        let Some(ticks) = ticks else {
            servo.set_zero(PlanarPose::ZERO);
            return (Outcome::Done, 0);
        };
        let mut settings = self.rezero_settings;
        if ticks > 0 {
            settings.ticks = ticks;
        }
        servo.start_zero_offset(settings);
        if let ZeroOffsetState::Refused(refusal) = servo.zero_offset_state() {
            self.was_refused = true;
            return Outcome::from_refusal(&refusal);
        }
        self.rezero = Some(token);
        (Outcome::Started, 0)
    }

    const fn ticks_in(&self, seconds: u8) -> u32 {
        (seconds as u32).saturating_mul(self.ticks_per_s)
    }

    fn answer(&mut self, number: u8, token: u8, outcome: Outcome, detail: u32) -> Option<Coded> {
        self.send(&Content::Answer(Answer {
            number,
            token,
            outcome: Some(outcome),
            detail,
        }))
    }
}

#[cfg(test)]
#[path = "service_tests.rs"]
mod tests;
