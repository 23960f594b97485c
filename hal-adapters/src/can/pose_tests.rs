use super::super::frame::BusFrame;
use super::*;
use runtime::{Pose, VerticalPose};

fn reading(k: u16) -> Reading {
    let x = f32::from(k) * 1.3e-7;
    Reading {
        pose: Pose {
            planar: PlanarPose {
                x_m: x,
                y_m: -x,
                rz_rad: x / 3.0,
            },
            vertical: VerticalPose {
                z_m: 2.0 * x,
                rx_rad: x / 7.0,
                ry_rad: -0.0,
            },
        },
        status: Status::from_bits(0x1000 * u32::from(k & 1)),
    }
}

#[test]
fn an_axis_worked_by_hand() {
    // 1.0 is 0x3f800000; status 0x41001 spans bits 12 to 31.
    let frame = axis_frame(Message::PoseY, 0x1b, 1.0, Status::from_bits(0x41001));
    assert_eq!(frame.bytes[1..], [0x1b, 0x00, 0x41, 0, 0, 0x80, 0x3f]);
}

#[test]
fn the_words_of_the_decoder_come_back_to_the_bit() {
    let (mut sender, mut receiver) = (PoseSender::default(), PoseReceiver::new(Timing::default()));
    for k in 0..100 {
        let mut got = None;
        for frame in sender.frames(&reading(k), None) {
            let taken = receiver.take(&BusFrame::from(frame), u32::from(k) * 2_000);
            assert_eq!(taken.fault, None);
            got = got.or(taken.tick);
        }
        let got = got.expect("all three axes came");
        assert_eq!(got.status, reading(k).status);
        let bits = |p: PlanarPose<f32>| p.to_array().map(f32::to_bits);
        assert_eq!(bits(got.pose), bits(reading(k).pose.planar));
    }
    let vertical = receiver
        .vertical()
        .map(|axis| axis.map(|a| a.value.to_bits()));
    // In every fourth tick: Z when the tick's number is 0 modulo 4, Rx at 1, Ry at 2.
    let sent = |k, of: fn(Pose) -> f32| Some(of(reading(k).pose).to_bits());
    assert_eq!(vertical[0], sent(96, |p| p.vertical.z_m));
    assert_eq!(vertical[1], sent(97, |p| p.vertical.rx_rad));
    assert_eq!(vertical[2], sent(98, |p| p.vertical.ry_rad));
}

/// X, Y and Rz of a first tick.
fn planar_frames(reading: &Reading) -> [BusFrame; 3] {
    let mut frames = PoseSender::default().frames(reading, None);
    [(); 3].map(|()| BusFrame::from(frames.next().expect("three axes")))
}

#[test]
fn a_pose_that_is_no_number_disagrees_on_its_status_or_lacks_an_axis_is_invalid() {
    let [x, y, rz] = planar_frames(&reading(2));
    let mut forged = reading(2);
    forged.pose.planar.y_m = f32::INFINITY;
    let [_, infinite, _] = planar_frames(&forged);
    let [_, _, other] = planar_frames(&reading(3));
    for frames in [&[x, infinite, rz][..], &[x, y, other], &[x, y]] {
        let mut receiver = PoseReceiver::new(Timing::default());
        let taken = frames.iter().map(|frame| receiver.take(frame, 0).tick);
        let whole = taken.fold(None, Option::or);
        let got = whole.or_else(|| receiver.poll(1_000).tick).expect("a tick");
        assert_eq!(got.valid(), None);
        assert!(frames.len() == 3 || got.status.any(Status::FRAMES_MISSED));
    }
}

fn codes(sequence: u32, time_us: u32) -> RawFrame {
    RawFrame::new([0; 3], [0; 3], sequence, time_us)
}

/// A host that loses frames: the counters of 15 to 18 ticks look like 0 to 2, and a time frame may arrive after
/// its poses were lost.
#[test]
fn a_pose_after_any_loss_has_its_own_time_or_none() {
    for lost in 0..100u16 {
        for start in 40..56u16 {
            let mut sender = PoseSender::default();
            let mut receiver = PoseReceiver::new(Timing::default());
            let mut dated = 0;
            for k in 0..200u16 {
                let time_us = 2_000 * u32::from(k);
                let late_us = u32::from(k) * 7919 % 3_000;
                let is_lost = (start..start + lost).contains(&k);
                for frame in sender.frames(&reading(k), Some(&codes(k.into(), time_us))) {
                    // The last time frame of the loss gets through.
                    let last_time = frame.message == Message::PoseTime && k + 16 >= start + lost;
                    if is_lost && !last_time {
                        continue;
                    }
                    let taken = receiver.take(&BusFrame::from(frame), time_us + late_us);
                    let Some(pose) = taken.tick.filter(|pose| pose.valid().is_some()) else {
                        continue;
                    };
                    // X is the tick.
                    let number = (pose.pose.x_m / 1.3e-7).round() as u32;
                    if let Some(sampled_us) = receiver.sampled_us(&pose, 2_000) {
                        assert_eq!(sampled_us, 2_000 * number, "{lost} from {start} on");
                        dated += 1;
                    }
                }
            }
            assert!(
                dated + u32::from(lost) > 140,
                "{lost} from {start} on: {dated}"
            );
        }
    }
}

/// Each bit means the same in the decoder and on the bus, which has all but "held".
#[test]
fn every_bit_but_held_is_sent_at_its_own_place() {
    let held = Status::PLANAR_HELD.with(Status::VERTICAL_HELD);
    for (bit, name) in Status::NAMES {
        let sent = if bit.any(held) { 0 } else { bit.bits() };
        assert_eq!(status_to_bus(bit), sent, "{name}");
    }
    let status = Status::TEMPERATURE_MISSING.with(Status::FORCED);
    let mut receiver = PoseReceiver::new(Timing::default());
    let marked = Reading {
        status,
        ..reading(1)
    };
    let frames = planar_frames(&marked).into_iter();
    let got = frames.fold(None, |got, frame| got.or(receiver.take(&frame, 0).tick));
    assert_eq!(got.map(|pose| pose.status), Some(status));
}

#[test]
fn poses_between_two_time_frames_are_dated_by_their_numbers() {
    let (mut sender, mut receiver) = (PoseSender::default(), PoseReceiver::new(Timing::default()));
    let (mut undated, mut time_frames) = (0, 0);
    for k in 0..100u16 {
        // The node misses three ticks before its 40th, and says so in the status.
        let number = u32::from(k) + if k >= 40 { 3 } else { 0 };
        let time_us = (u32::MAX - 50_000).wrapping_add(2_000 * number);
        let mut reading = reading(k);
        if k == 40 {
            reading.status = Status::FRAMES_MISSED;
        }
        let mut pose = None;
        for frame in sender.frames(&reading, Some(&codes(number, time_us))) {
            time_frames += u32::from(frame.message == Message::PoseTime);
            pose = pose.or(receiver.take(&BusFrame::from(frame), time_us).tick);
        }
        let pose = pose.expect("three axes came");
        match receiver.sampled_us(&pose, 2_000) {
            Some(dated_us) => assert_eq!(dated_us, time_us, "{k}"),
            None => undated += 1,
        }
    }
    assert_eq!(time_frames, 7);
    // From the 40th to the 47th: the 48th comes with a time frame.
    assert_eq!(undated, 8);
}
