//! A million damaged frames through coder, damage, receiver and decoder: none becomes a valid pose.

use hal_adapters::can::{BusFrame, Layout, SensorReceiver, Timing, sensor};
use runtime::{AnyDecoder, Decode, ParameterSet, PlanarPose, RawFrame, Status};
use tests::fault::{Channel, Fault};
use tests::job::answer;

fn decoder() -> AnyDecoder {
    let blob = include_bytes!("../../runtime/examples/stage.bin");
    ParameterSet::from_bytes(blob).expect("sound").decoder()
}

/// A tick with its number and their own places in its six codes.
fn tick(n: u32) -> RawFrame {
    let part = |shift: u32, channel: i32| ((n >> shift & 0xfff) as i32) * 8 + channel - 16_384;
    RawFrame::new(
        [part(0, 0), part(12, 1), part(0, 2)],
        [part(0, 3), part(12, 4), part(0, 5)],
        n,
        n.wrapping_mul(2_000),
    )
}

/// The number of the tick that a received code belongs to, by its two parts.
fn number(low: i32, high: i32) -> u32 {
    let part = |code: i32| ((code + 16_384) >> 3) as u32;
    part(low) | part(high) << 12
}

#[test]
fn no_pose_is_valid_from_three_flipped_bits_or_a_burst_of_eight() {
    let each = Fault::ALL.map(|fault| (fault, 10_000));
    let more = [
        (Fault::Flip, 200_000),
        (Fault::Burst, 200_000),
        (Fault::Noise, 0),
    ];
    let mut bus = Channel::new(&[&each[..], &more].concat(), 1);
    let mut receiver = SensorReceiver::new(Layout::Bits16, Timing::default());
    let decoder = decoder();
    let (mut frames, mut valid_poses, mut wrong_poses) = (0, 0, 0);
    let sent = (0..600_000).flat_map(|n| {
        let coded = sensor::frames(Layout::Bits16, &tick(n));
        (0..)
            .zip(coded)
            .map(move |(k, coded)| (2_000 * u64::from(n) + 135 * k, coded))
    });
    for (now_us, coded) in sent {
        bus.send(now_us, BusFrame::from(coded));
        for frame in bus.arrived(now_us) {
            frames += 1;
            let Some(got) = receiver.take(&frame, now_us as u32).tick else {
                continue;
            };
            let reading = decoder.decode(&got, &PlanarPose::ZERO);
            if reading.status.any(Status::PLANAR_INVALID) {
                continue;
            }
            valid_poses += 1;
            // It must be the pose of one tick that was sent.
            let sent = tick(number(got.hall[0], got.hall[1]));
            let same = (sent.hall, sent.capacitive) == (got.hall, got.capacitive);
            let want = decoder.decode(&sent, &PlanarPose::ZERO);
            wrong_poses += u32::from(!same || answer(&want) != answer(&reading));
        }
    }
    let damaged = bus.injected(Fault::Flip) + bus.injected(Fault::Burst);
    println!(
        "RESULT light_damage_frames={frames} damaged={damaged} valid_poses={valid_poses} wrong_poses={wrong_poses} expected=0"
    );
    assert!(frames >= 1_000_000 && damaged >= 400_000);
    // Nearly half of the frames have a fault, so a quarter of the ticks is whole: the check
    // above means something only if many poses are valid.
    assert!(valid_poses >= 100_000);
    assert_eq!(wrong_poses, 0);
}
