extern crate std;

use super::super::frame::BusFrame;
use super::*;
use runtime::{AnyDecoder, OnInvalid, ParameterSet, RawFrame};
use std::vec::Vec;

const TICKS_PER_S: u32 = 500;

fn decoder() -> AnyDecoder {
    let blob = include_bytes!("../../../runtime/examples/stage.bin");
    ParameterSet::from_bytes(blob).expect("sound").decoder()
}

/// A node with a servo, and a host that commands it.
struct Stage<'d> {
    servo: PoseTracker<&'d AnyDecoder>,
    service: Service,
    host: Mailbox,
    sequence: u32,
    pin: Option<bool>,
}

impl<'d> Stage<'d> {
    fn new(decoder: &'d AnyDecoder) -> Self {
        Self {
            servo: PoseTracker::new(decoder, OnInvalid::Zero),
            service: Service::new(TICKS_PER_S),
            host: Mailbox::default(),
            sequence: 0,
            pin: None,
        }
    }

    fn ask(&mut self, request: Request, token: u8) -> Outcome {
        let command = Content::Command(Command::new(request, token));
        let frame = BusFrame::from(self.host.send(&command).expect("a command"));
        let taken = self.service.take(&frame, Some(&mut self.servo), None);
        let answered = taken.expect("a command").expect("a sound one");
        self.read(answered.answer.expect("an answer"), token)
    }

    fn declares_off(&mut self, seconds: u8) -> Outcome {
        self.ask(Request::ServoOff { seconds }, 100)
    }

    fn read(&mut self, answer: Coded, token: u8) -> Outcome {
        match self.host.take(&BusFrame::from(answer)) {
            Some(Ok(Content::Answer(a))) if a.token == token => a.outcome.expect("a known one"),
            other => panic!("{other:?}"),
        }
    }

    /// Ticks at rest, a few um off; the answer that comes, of this token.
    fn rest(&mut self, ticks: u32, token: u8) -> Option<Outcome> {
        let mut outcome = None;
        for _ in 0..ticks {
            self.sequence += 1;
            let frame = RawFrame::new([100, -50, 70], [10, 20, 30], self.sequence, 0);
            self.service.before_tick(Some(&mut self.servo), self.pin);
            self.servo.tick(&frame);
            if let Some(answer) = self.service.tick(Some(&self.servo)) {
                assert_eq!(outcome, None);
                outcome = Some(self.read(answer, token));
            }
        }
        outcome
    }

    fn flags(&self) -> u8 {
        self.service.flags(Some(&self.servo))
    }
}

const REZERO: Request = Request::Rezero { ticks: 0 };

#[test]
fn the_zero_changes_only_while_the_servo_is_declared_off() {
    let decoder = decoder();
    let mut stage = Stage::new(&decoder);
    assert_eq!(stage.ask(REZERO, 1), Outcome::ServoOn);
    assert_eq!(stage.declares_off(3), Outcome::Done);
    assert_eq!(stage.ask(REZERO, 3), Outcome::Started);
    assert_eq!(stage.flags(), flag::REZERO_RUNS);
    assert_eq!(stage.ask(REZERO, 4), Outcome::Busy);
    assert_eq!(stage.ask(Request::ClearZero, 5), Outcome::Busy);
    assert_eq!(stage.rest(600, 3), Some(Outcome::Done));
    assert_eq!(stage.flags(), flag::ZERO_SET);
    let zero = stage.servo.zero();
    // The declaration ends three seconds after it was made.
    assert_eq!(stage.rest(899, 0), None);
    assert!(stage.service.servo_is_off());
    stage.rest(1, 0);
    assert_eq!(stage.ask(Request::ClearZero, 6), Outcome::ServoOn);
    assert_eq!(stage.servo.zero(), zero);
    assert_eq!(stage.declares_off(1), Outcome::Done);
    assert_eq!(stage.ask(Request::ClearZero, 8), Outcome::Done);
    assert_eq!(stage.flags(), 0);
    assert_eq!(stage.declares_off(0), Outcome::Done);
    assert_eq!(stage.ask(REZERO, 10), Outcome::ServoOn);
}

#[test]
fn a_service_pin_that_says_on_overrules_the_declaration() {
    let decoder = decoder();
    let mut stage = Stage::new(&decoder);
    stage.declares_off(9);
    for (pin, token, outcome) in [
        (Some(false), 2, Outcome::ServoOn),
        (None, 3, Outcome::Started),
        (Some(true), 4, Outcome::Busy),
    ] {
        stage.pin = pin;
        assert_eq!(stage.rest(1, 0), None);
        assert_eq!(stage.ask(REZERO, token), outcome, "{pin:?}");
    }
}

#[test]
fn a_servo_that_goes_on_ends_a_re_zero_and_leaves_the_zero() {
    let decoder = decoder();
    let on: [fn(&mut Stage<'_>); 2] = [
        |stage| assert_eq!(stage.declares_off(0), Outcome::Done),
        |stage| stage.pin = Some(false),
    ];
    // In the middle, and before the tick that would end it.
    for (go_on, ticks) in on.into_iter().zip([100, 499]) {
        let mut stage = Stage::new(&decoder);
        stage.declares_off(9);
        stage.ask(REZERO, 2);
        assert_eq!(stage.rest(ticks, 0), None);
        go_on(&mut stage);
        assert_eq!(stage.rest(1, 2), Some(Outcome::ServoOn));
        assert_eq!(stage.flags(), flag::REZERO_REFUSED);
        assert_eq!(stage.rest(1000, 0), None);
        assert_eq!(stage.servo.zero(), PlanarPose::ZERO);
    }
}

#[test]
fn a_stage_that_rests_elsewhere_is_zeroed_within_limits_of_its_own() {
    let decoder = decoder();
    let zeroed_within = |vertical_max: [f32; 3]| {
        let mut stage = Stage::new(&decoder);
        stage.service = Service::new(TICKS_PER_S).with_rezero_limits(ZeroOffsetSettings {
            vertical_max,
            ..ZeroOffsetSettings::default()
        });
        stage.declares_off(10);
        assert_eq!(stage.ask(REZERO, 2), Outcome::Started);
        stage.rest(500, 2)
    };
    // At these codes the stage is some nm high and some nrad tilted.
    assert_eq!(zeroed_within([1e-12; 3]), Some(Outcome::OutOfBounds));
    assert_eq!(zeroed_within([50e-6; 3]), Some(Outcome::Done));
}

#[test]
fn a_re_zero_that_is_too_short_is_refused_at_once() {
    let decoder = decoder();
    let mut stage = Stage::new(&decoder);
    stage.declares_off(1);
    let short = stage.ask(Request::Rezero { ticks: 1 }, 2);
    assert_eq!(short, Outcome::TooShort);
    assert_eq!(stage.flags(), flag::REZERO_REFUSED);
    assert_eq!(stage.ask(REZERO, 3), Outcome::Started);
}

#[test]
fn a_node_without_parameters_records_and_identifies_and_has_no_zero() {
    let (mut service, mut host) = (Service::new(TICKS_PER_S), Mailbox::default());
    let mut outcomes = Vec::new();
    for (token, request) in (1..).zip([
        Request::Record { on: true },
        Request::Identify { seconds: 1 },
        Request::ServoOff { seconds: 1 },
        REZERO,
        Request::ClearZero,
    ]) {
        let command = Content::Command(Command::new(request, token));
        let frame = BusFrame::from(host.send(&command).expect("a command"));
        let answered = service
            .take(&frame, None::<&mut PoseTracker>, None)
            .expect("a command")
            .expect("sound");
        let answer = BusFrame::from(answered.answer.expect("an answer"));
        match host.take(&answer) {
            Some(Ok(Content::Answer(answer))) => outcomes.extend(answer.outcome),
            other => panic!("{other:?}"),
        }
    }
    use Outcome::{Done, NoParameters};
    assert_eq!(outcomes, [Done, Done, Done, NoParameters, NoParameters]);
    assert_eq!(
        service.flags(None::<&PoseTracker>),
        flag::RECORDING | flag::IDENTIFYING
    );
    (0..TICKS_PER_S).for_each(|_| assert_eq!(service.tick(None::<&PoseTracker>), None));
    assert_eq!(service.flags(None::<&PoseTracker>), flag::RECORDING);
}
