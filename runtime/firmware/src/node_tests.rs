extern crate std;

use super::*;
use crate::records::{Choice, Loaded, Records};
use crate::store::flash_model::FlashModel;
use hal_adapters::can::BusFrame;
use hal_adapters::can::command::{Command, Mailbox, Outcome, Request};
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
        other_slot: None,
    };
    Node::new(parameters, false, Layout::Bits24, IDENTITY)
}

const IDENTITY: Identity<'_> = Identity {
    serial: None,
    key: None,
    program_version: 1,
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
