//! Damaged frames of the bus never become a pose that is called valid: a million,
//! through coder, damage, receiver and decoder.

use hal_adapters::can::{BusFrame, Layout, SensorReceiver, StampedFrame, Timing, sensor};
use runtime::{AnyDecoder, Decode, ParameterSet, PlanarPose, RawFrame, Reading, Status};
use tests::fault::{Fault, FaultRates, Faulty};

fn decoder() -> AnyDecoder {
    let blob = include_bytes!("../../runtime/examples/stage.bin");
    ParameterSet::from_bytes(blob).expect("sound").decoder()
}

/// A tick whose six codes tell its number and where they belong.
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

/// Sends ticks over a bus with faults.
struct Ticks {
    next: u32,
    end: u32,
    left: Vec<BusFrame>,
}

impl Iterator for Ticks {
    type Item = StampedFrame;

    fn next(&mut self) -> Option<StampedFrame> {
        if self.left.is_empty() {
            if self.next == self.end {
                return None;
            }
            let frames = sensor::frames(Layout::Bits16, &tick(self.next));
            self.left = frames.map(BusFrame::from).collect();
            self.left.reverse();
            self.next += 1;
        }
        let time_us = u64::from(self.next) * 2_000;
        let frame = self.left.pop()?;
        Some(StampedFrame { time_us, frame })
    }
}

fn bits(reading: &Reading) -> [u32; 7] {
    let (p, v) = (&reading.pose.planar, &reading.pose.vertical);
    [
        p.x_m.to_bits(),
        p.y_m.to_bits(),
        p.rz_rad.to_bits(),
        v.z_m.to_bits(),
        v.rx_rad.to_bits(),
        v.ry_rad.to_bits(),
        reading.status.bits(),
    ]
}

struct Outcome {
    frames: u32,
    damaged: u32,
    valid_poses: u32,
    wrong_poses: u32,
}

/// Runs `ticks` ticks; counts poses that are called valid, and those among them that are not
/// the pose of one tick that was sent.
fn run(ticks: u32, rates: FaultRates, damaging: &[Fault], seed: u64) -> Outcome {
    let decoder = decoder();
    let source = Ticks {
        next: 0,
        end: ticks,
        left: Vec::new(),
    };
    let mut source = Faulty::new(source, rates, seed);
    let mut receiver = SensorReceiver::new(Layout::Bits16, Timing::default());
    let mut out = Outcome {
        frames: 0,
        damaged: 0,
        valid_poses: 0,
        wrong_poses: 0,
    };
    for stamped in source.by_ref() {
        out.frames += 1;
        let now_us = stamped.time_us as u32;
        let Some(got) = receiver.take(&stamped.frame, now_us).tick else {
            continue;
        };
        let reading = decoder.decode(&got, &PlanarPose::ZERO);
        if reading.status.any(Status::PLANAR_INVALID) {
            continue;
        }
        out.valid_poses += 1;
        let sent = tick(number(got.hall[0], got.hall[1]));
        let same = (sent.hall, sent.capacitive) == (got.hall, got.capacitive);
        let want = decoder.decode(&sent, &PlanarPose::ZERO);
        out.wrong_poses += u32::from(!same || bits(&want) != bits(&reading));
    }
    out.damaged = damaging.iter().map(|f| source.injected(*f)).sum();
    out
}

#[test]
fn no_pose_is_valid_from_three_flipped_bits_or_a_burst_of_eight() {
    let rates = FaultRates::each(10_000)
        .with(Fault::Flip, 200_000)
        .with(Fault::Burst, 200_000)
        .with(Fault::Noise, 0);
    let out = run(600_000, rates, &[Fault::Flip, Fault::Burst], 1);
    println!(
        "RESULT light_damage_frames={} damaged={} valid_poses={} wrong_poses={} expected=0",
        out.frames, out.damaged, out.valid_poses, out.wrong_poses
    );
    assert!(out.frames >= 1_000_000 && out.damaged >= 400_000);
    // Nearly half of the frames have a fault, so a quarter of the ticks is whole: the check
    // above means something only if many poses are valid.
    assert!(out.valid_poses >= 100_000);
    assert_eq!(out.wrong_poses, 0);
}
