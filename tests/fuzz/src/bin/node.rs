//! Frames into a decoding node, a controller and a host: whatever comes, a pose is finite or marked
//! invalid, and nothing is done that was not asked for. Only a blob that was sent whole is stored, and
//! without the key none.

#![no_main]

use fuzz::PARAMS;
use fuzz::bus::{NEW, Numbers, Step, steps};
use hal_adapters::can::command::{Mailbox, Request};
use hal_adapters::can::{
    BusFrame, Layout, PoseReceiver, PoseSender, SensorReceiver, Service, Timing,
};
use libfuzzer_sys::fuzz_target;
use runtime::{OnInvalid, ParameterSet, PoseTracker, Predictor, Reading};
use std::sync::LazyLock;
use tests::flash_model::FlashModel;
use tests::node::Node;

static SET: LazyLock<ParameterSet> =
    LazyLock::new(|| ParameterSet::from_bytes(PARAMS).expect("the blob of the examples"));

fn is_sound(reading: &Reading) {
    let (q, v) = (
        reading.pose.planar.to_array(),
        reading.pose.vertical.to_array(),
    );
    assert!(q.iter().chain(&v).all(|x| x.is_finite()), "{reading:?}");
    assert!(
        reading.planar_or_held().is_some() || q == [0.0; 3],
        "{reading:?}"
    );
}

fuzz_target!(|data: &[u8]| {
    let Some((&form, data)) = data.split_first() else {
        return;
    };
    let decoder = SET.decoder();
    let layout = if form & 1 == 0 {
        Layout::Bits16
    } else {
        Layout::Bits24
    };
    let mut servo = PoseTracker::new(
        decoder,
        OnInvalid::Hold {
            ticks: u16::from(form >> 1),
        },
    );
    let mut sensors = SensorReceiver::new(layout, Timing::default());
    let mut poses = PoseReceiver::new(Timing::default());
    let (mut sender, mut service) = (PoseSender::default(), Service::new(500));
    let (mut host, mut numbers) = (Mailbox::default(), Numbers::default());
    let mut predictor = Predictor::new(3_000);
    let (mut now_us, mut asked_to_record) = (0u32, false);
    let mut flash = FlashModel::erased();
    flash.load(0, PARAMS);
    let key = (form & 2 == 2).then_some(&[7; 16]);
    let mut controller = Node::new(Some("HS-0007"), key, flash, form.into());
    let mut records = 0;
    let mut step = |step: Step| match step {
        Step::Frame(frame) => {
            let _ = (host.take(&frame), poses.take(&frame, now_us));
            if let Some(Ok(answered)) = service.take(&frame, Some(&mut servo), None) {
                let record = matches!(answered.command.request, Some(Request::Record { on: true }));
                asked_to_record |= record;
                assert!(answered.answer.is_some());
            }
            assert!(asked_to_record || !service.is_recording());
            let taken = sensors.take(&frame, now_us);
            if let Some(raw) = taken.tick {
                let reading = servo.tick(&raw);
                is_sound(&reading);
                predictor.take(&servo, &raw, &reading);
                let ahead = predictor.pose_at(raw.time_us.wrapping_add(1_000));
                assert!(ahead.is_none_or(|pose| pose.to_array().iter().all(|x| x.is_finite())));
                for coded in sender.frames(&reading, Some(&raw)) {
                    let received = poses.take(&BusFrame::from(coded), now_us);
                    if let Some(pose) = received.tick.and_then(|tick| tick.valid()) {
                        assert!(pose.to_array().iter().all(|x| x.is_finite()));
                    }
                }
            }
        }
        Step::Ticks(ticks) => {
            for _ in 0..ticks {
                now_us = now_us.wrapping_add(2_000);
                service.before_tick(Some(&mut servo), None);
                if let Some(raw) = sensors.poll(now_us).tick {
                    is_sound(&servo.tick(&raw));
                }
                service.tick(Some(&servo));
                poses.poll(now_us);
            }
        }
        Step::Wait(wait_us) => {
            now_us = now_us.wrapping_add(wait_us);
            is_sound(&servo.tick_without_frame());
        }
    };
    for what in steps(data, &mut numbers) {
        let (ticks, frame) = match what {
            Step::Frame(frame) => (1, Some(frame)),
            Step::Ticks(ticks) => (ticks, None),
            Step::Wait(_) => (0, None),
        };
        step(what);
        for _ in 0..ticks {
            controller.tick(0, frame);
            while controller.send().is_some() {}
        }
        if controller.is_to_be_reset() {
            controller.reset(0);
        }
        if controller.records() != records {
            records += 1;
            assert!(key.is_none() && controller.records() == records);
            assert!(controller.newest().is_some_and(|blob| blob == *NEW));
        }
    }
    assert!(controller.newest().is_some());
});
