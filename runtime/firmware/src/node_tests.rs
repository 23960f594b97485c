extern crate std;

use super::*;
use crate::records::{Choice, Loaded, Records, Refusal};
use crate::store::flash_model::FlashModel;
use hal_adapters::adc::AdcError;
use hal_adapters::can::command::{Command, Mailbox, Outcome, Request};
use hal_adapters::can::{BusFrame, SensorReceiver, Timing};
use runtime::calibration::{Calibration, Origin};
use runtime::frame::CodeWindow;
use runtime::geometry::ProbeGeometry;
use runtime::model::{ModelKind, Probes, Sensitivity};
use runtime::parameters::Text;
use runtime::{OnInvalid, PoseTracker};
use std::boxed::Box;
use std::vec::Vec;

#[path = "node_key_tests.rs"]
mod key;

/// An FPU whose settings something else changes: before these calls, counted from 0.
#[derive(Default)]
struct Disturbed {
    calls: usize,
    at: Vec<usize>,
}

impl FpuSettings for Disturbed {
    fn restore(&mut self) -> bool {
        self.calls += 1;
        self.at.contains(&(self.calls - 1))
    }
}

const WINDOW: CodeWindow = CodeWindow {
    low: -32767,
    high: 32766,
};

/// A blob of this stage.
fn blob(serial: &str) -> Vec<u8> {
    let calibration = Calibration {
        model: ModelKind::M31,
        geometry: ProbeGeometry {
            lever_arm_m: [0.19, -0.21, -0.34],
            misalignment_rad: [0.01, -0.02, 0.03],
        },
        probes: Probes::Linear(
            [Sensitivity {
                eta: 0.8,
                per_z_m: -190.0,
                per_rx_rad: -70.0,
                per_ry_rad: 15.0,
            }; 3],
        ),
        hall_m_per_code: 6.25e-8,
        hall_window: WINDOW,
        capacitive_probes_m: [[0.12, 0.0], [-0.12, 0.0], [0.0, -0.12]],
        capacitive_m_per_code: 1.5625e-8,
        capacitive_window: WINDOW,
        calibrated_planar: [1e-3; 3],
        calibrated_vertical: [5e-4; 3],
        sensitivity_min: 0.1,
        temperature: runtime::temperature::Temperature::NONE,
    };
    let origin = Origin {
        serial: Text::try_from(serial).expect("short"),
        ..Origin::default()
    };
    let set = calibration.prepare(&origin).expect("a sound calibration");
    let mut buffer = [0; runtime::blob::MAX_BYTES];
    set.to_bytes(&mut buffer).expect("it fits").to_vec()
}

fn loaded() -> &'static Loaded {
    let mut flash = FlashModel::erased();
    flash.load(0, &blob("stage-7"));
    let (mut records, _) = Records::start(&mut flash, Choice::Newest, None);
    let place = Box::leak(Box::new(core::mem::MaybeUninit::uninit()));
    records.load(Choice::Newest, place).expect("a sound slot")
}

fn node() -> Node<'static> {
    let loaded = loaded();
    let parameters = Parameters::Usable {
        servo: PoseTracker::new(&loaded.decoder, OnInvalid::Zero),
        serial: &loaded.serial,
        other_slot: None,
    };
    Node::new(parameters, false, Layout::Bits24, IDENTITY)
}

const IDENTITY: Identity<'_> = Identity {
    serial: None,
    key: None,
    program_version: 1,
    program_hash: 2,
};

/// What is drawn for a tag.
const NONCE: Nonce = [1, 2, 3, 4];

fn take(node: &mut Node<'_>, frame: &impl Frame, outbox: &mut Outbox) {
    let (mut records, _) = Records::start(FlashModel::erased(), Choice::Newest, None);
    node.take(frame, outbox, &mut records, Some(NONCE));
}

fn frame(sequence: u32) -> RawFrame {
    RawFrame::new([100, 200, 300], [10, 20, 30], sequence, sequence * 2000)
}

/// Frames that one tick sends.
fn tick(
    node: &mut Node<'_>,
    sample: Result<RawFrame, SampleFault>,
) -> Vec<hal_adapters::can::Coded> {
    let mut outbox = Outbox::new();
    let facts = Facts {
        servo_off_pin: Some(true),
        ..Facts::default()
    };
    node.tick(sample, &facts, &mut Disturbed::default(), &mut outbox);
    core::iter::from_fn(|| outbox.pop()).collect()
}

fn contents(frames: &[hal_adapters::can::Coded]) -> Vec<Content> {
    let mut mailbox = Mailbox::default();
    let read = |coded: &hal_adapters::can::Coded| mailbox.take(&BusFrame::from(*coded))?.ok();
    frames.iter().filter_map(read).collect()
}

fn ask(node: &mut Node<'_>, request: Request, token: u8) -> Vec<Content> {
    let coded = Mailbox::default().send(&Content::Command(Command::new(request, token)));
    let mut outbox = Outbox::new();
    take(
        node,
        &BusFrame::from(coded.expect("a command")),
        &mut outbox,
    );
    contents(&core::iter::from_fn(|| outbox.pop()).collect::<Vec<_>>())
}

#[test]
fn every_sixteenth_tick_sends_the_state_and_half_way_a_counter() {
    let mut node = node();
    for k in 0..64u32 {
        let contents = contents(&tick(&mut node, Ok(frame(k))));
        let status = contents
            .iter()
            .any(|t| matches!(t, Content::Status(s) if s.state == Some(NodeState::Running)));
        let health = contents.iter().any(|t| matches!(t, Content::Health(_)));
        assert_eq!((status, health), (k % 16 == 0, k % 16 == 8), "{k}");
    }
}

#[test]
fn a_re_zero_needs_the_servo_off_and_its_answer_comes_in_the_tick_that_ends_it() {
    let mut node = node();
    tick(&mut node, Ok(frame(0)));
    let mut token = 0;
    let mut asked = |node: &mut Node<'_>, request| {
        token += 1;
        match ask(node, request, token)[..] {
            [Content::Answer(answer)] => answer.outcome,
            _ => None,
        }
    };
    let rezero = Request::Rezero { ticks: 300 };
    assert_eq!(asked(&mut node, rezero), Some(Outcome::ServoOn));
    let off = Request::ServoOff { seconds: 2 };
    assert_eq!(asked(&mut node, off), Some(Outcome::Done));
    assert_eq!(asked(&mut node, rezero), Some(Outcome::Started));
    let answers = (1..=400).flat_map(|k| {
        let contents = contents(&tick(&mut node, Ok(frame(k))));
        let answers = contents
            .into_iter()
            .filter(|t| matches!(t, Content::Answer(_)));
        answers.map(move |answer| (k, answer)).collect::<Vec<_>>()
    });
    let answers: Vec<_> = answers.collect();
    assert!(matches!(answers[..], [(300, Content::Answer(a))] if a.outcome == Some(Outcome::Done)));
    assert_ne!(node.zero(), PlanarPose::ZERO);
}

/// Codes as wide as the converter's, with a tick that the schedule missed and one that the
/// converter failed.
#[test]
fn a_record_holds_the_codes_of_every_tick_and_shows_those_without_as_gaps() {
    for (parameters, layout) in [(true, Layout::Bits24), (false, Layout::Bits16)] {
        let mut node = if parameters {
            node()
        } else {
            let refusal = Refusal::NEITHER;
            Node::new(Parameters::None { refusal }, false, layout, IDENTITY)
        };
        let width = if parameters { 1_000 } else { 1 };
        let codes = |sequence: u32| RawFrame {
            hall: [-5 * width, 8 * width, sequence as i32 * width],
            ..frame(sequence)
        };
        let is_code = |coded: &hal_adapters::can::Coded| layout.messages().contains(&coded.message);
        assert!(!tick(&mut node, Ok(codes(0))).iter().any(is_code));
        ask(&mut node, Request::Record { on: true }, 1);
        let mut receiver = SensorReceiver::new(layout, Timing::default());
        let mut got = Vec::new();
        for sequence in (1..100).filter(|s| *s != 40) {
            let sample = if sequence == 70 {
                Err(SampleFault::from(&AdcError::Bus(())))
            } else {
                Ok(codes(sequence))
            };
            for coded in tick(&mut node, sample) {
                let taken = receiver.take(&BusFrame::from(coded), sequence * 2_000);
                got.extend(taken.tick);
            }
        }
        let want: Vec<_> = (1..100).filter(|s| ![40, 70].contains(s)).collect();
        assert_eq!(got.len(), want.len());
        for (got, sequence) in got.iter().zip(want) {
            assert_eq!(got.hall, codes(sequence).hall);
            assert_eq!(got.sequence & 0xf, sequence & 0xf);
        }
        ask(&mut node, Request::Record { on: false }, 2);
        assert!(!tick(&mut node, Ok(codes(100))).iter().any(is_code));
    }
}

#[test]
fn a_program_built_to_record_does_so_from_the_first_tick() {
    let mut node = node().recording(true);
    let frames = tick(&mut node, Ok(frame(0)));
    let messages: Vec<_> = frames.iter().map(|coded| coded.message).collect();
    use Message as M;
    let want = [
        [M::PoseX, M::PoseY, M::PoseRz].as_slice(),
        &[M::PoseTime, M::PoseZ, M::SensorTime],
        &[M::HallAb24, M::HallCCapacitive1At24, M::Capacitive23At24],
        &[M::NodeStatus],
    ];
    assert_eq!(messages, want.concat());
}

#[test]
fn a_remote_frame_or_a_foreign_one_is_no_command() {
    let mut node = node();
    let mut outbox = Outbox::new();
    let remote = BusFrame::new_remote(Message::Command.id(), 8).expect("eight bytes");
    take(&mut node, &remote, &mut outbox);
    let foreign = BusFrame::new(embedded_can::StandardId::MAX, &[0; 8]).expect("eight bytes");
    take(&mut node, &foreign, &mut outbox);
    assert_eq!(outbox.front(true), None);
}
