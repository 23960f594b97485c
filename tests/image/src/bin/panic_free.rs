//! Uses every function that a controller calls, so that the linker shows whether any of them
//! can reach a panic. Without the feature `may-panic` it links; with it, which adds one
//! indexing that may fail, it must not.
#![no_std]
#![no_main]

use core::hint::black_box;
use cortex_m_rt::entry;
use hal_adapters::can::command::{Command, Content, Mailbox, Request};
use hal_adapters::can::update::{BlobId, Identity, NotWritten, Receiver, Running, Store, Updates};
use hal_adapters::can::{
    BusFrame, Layout, PoseReceiver, PoseSender, SensorReceiver, Service, Timing, sensor,
};
use runtime::blob::MAX_BYTES;
use runtime::zero_offset::ZeroOffsetSettings;
use runtime::{
    CommandedMotion, OnInvalid, ParameterSet, PlanarPose, PoseTracker, Predictor, RawFrame,
    Reading, VerticalPose,
};

extern crate image;

const FRAME: RawFrame = RawFrame::new([0; 3], [0; 3], 0, 0);

/// The bus: coding, checking, assembly.
#[inline(never)]
fn bus(frame: &RawFrame) {
    let mut poses = PoseReceiver::new(Timing::default());
    let mut mailbox = Mailbox::default();
    let mut sender = PoseSender::default();
    for layout in black_box([Layout::Bits16, Layout::Bits24]) {
        let mut receiver = SensorReceiver::new(layout, Timing::default());
        for coded in sensor::frames(layout, frame) {
            black_box(receiver.take(&black_box(BusFrame::from(coded)), 1));
        }
        black_box((receiver.poll(2), receiver.deadline_us(), *receiver.health()));
    }
    for coded in sender.frames(&black_box(Reading::default()), Some(frame)) {
        let frame = black_box(BusFrame::from(coded));
        let taken = poses.take(&frame, 1);
        black_box(taken.tick.map(|pose| poses.sampled_us(&pose, 2_000)));
        black_box(mailbox.take(&frame));
    }
    black_box((poses.poll(2), *poses.vertical()));
}

/// Requests and answers.
#[inline(never)]
fn commands(tracker: &mut PoseTracker) {
    let mut mailbox = Mailbox::default();
    let command = Command::new(black_box(Request::Rezero { ticks: 500 }), 1);
    let sent = mailbox.send(&black_box(Content::Command(command)));
    let mut service = black_box(Service::new(500));
    if let Some(coded) = sent {
        black_box(service.take(&black_box(BusFrame::from(coded)), Some(tracker), None));
    }
    service.before_tick(Some(tracker), black_box(Some(true)));
    black_box(service.tick(Some(tracker)));
    black_box(service.flags(Some(tracker)));
}

/// A store that has nothing and keeps nothing.
struct Nowhere;

impl Store for Nowhere {
    fn running(&self) -> Option<Running<'_>> {
        black_box(None)
    }

    fn newest(&self) -> Option<BlobId> {
        black_box(None)
    }

    fn newest_sequence(&self) -> u32 {
        black_box(0)
    }

    fn word(&mut self, index: usize) -> Option<u32> {
        black_box(index);
        black_box(None)
    }

    fn write(&mut self, sequence: u32, blob: &[u8]) -> Result<(), NotWritten> {
        black_box((sequence, blob));
        black_box(Ok(()))
    }
}

/// An update over the bus.
#[inline(never)]
fn update(frame: &BusFrame) {
    let identity = Identity {
        serial: black_box(Some("HS-0007")),
        key: black_box(Some(&[0; 16])),
        program_version: 1,
        ..Identity::default()
    };
    let (mut service, mut receiver) = (Service::new(500), Receiver::new(identity, 500));
    let store = &mut Nowhere;
    let mut updates = Updates {
        receiver: &mut receiver,
        store,
        nonce: black_box(Some([0; 4])),
    };
    black_box(service.take(frame, None::<&mut PoseTracker>, Some(&mut updates)));
    receiver.tick(service.servo_is_off());
    black_box(receiver.store(service.servo_is_off(), store));
    black_box((receiver.is_updating(), receiver.wants_reset()));
}

#[entry]
fn main() -> ! {
    let memory = black_box([0xff_u8; MAX_BYTES]);
    let length = black_box(MAX_BYTES);
    let frame = black_box(FRAME);
    #[cfg(feature = "may-panic")]
    black_box(memory[length]);
    let memory = memory.get(..length).unwrap_or_default();
    let _ = black_box(ParameterSet::from_bytes(memory));
    if let Ok(set) = ParameterSet::from_flash(memory) {
        let _ = black_box(set.expect_serial("HS-0007"));
        let mut buffer = [0; MAX_BYTES];
        let _ = black_box(set.to_bytes(&mut buffer));
        let decoder = black_box(set.decoder());
        let mut tracker = PoseTracker::new(decoder, black_box(OnInvalid::Hold { ticks: 3 }));
        tracker.start_zero_offset(black_box(ZeroOffsetSettings::default()));
        let reading = black_box(tracker.tick(&frame));
        let mut predictor = black_box(Predictor::new(4_000));
        predictor.take(&tracker, &frame, &reading);
        black_box(predictor.pose_at(black_box(2_300)));
        let correction = black_box(set.motion_correction.unwrap_or_default());
        let commanded = black_box(CommandedMotion::default());
        black_box(correction.correct(reading.pose.planar, &commanded));
        black_box(tracker.tick_without_frame());
        black_box(tracker.tick_with(1, |zero| {
            decoder.decode_at(
                frame.hall,
                frame.temperature_mc,
                black_box(VerticalPose::ZERO),
                zero,
            )
        }));
        black_box(tracker.set_zero(black_box(PlanarPose::ZERO)));
        tracker.forget();
        commands(&mut tracker);
        black_box((
            tracker.zero_offset_state(),
            tracker.health(),
            tracker.zero(),
        ));
    }
    bus(&frame);
    update(&black_box(BusFrame::from(sensor::frames_16(&frame)[0])));
    loop {
        cortex_m::asm::wfi();
    }
}
