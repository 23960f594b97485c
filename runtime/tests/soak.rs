//! Hours of ticks with faults: the injected fault explains every status, held poses equal the last
//! valid pose to the bit, and the counters add up.

use runtime::frame::MISSING_CODE;
use runtime::tracker::Health;
use runtime::{
    Decode, OnInvalid, ParameterSet, PlanarPose, Pose, PoseTracker, RawFrame, Reading, Status,
};
use std::collections::BTreeSet;

/// Ticks of an hour at 2 ms.
const HOUR: u32 = 1_800_000;
/// Longest hold, ticks.
const HOLD: u16 = 5;

const INVALID: Status = Status::PLANAR_INVALID.with(Status::VERTICAL_INVALID);
/// Bits that depend on the numbers and not on the codes: of X, Y, Rz, and of all six.
const PLANAR_DECODED: Status = Status::SENSITIVITY
    .with(Status::PLANAR_NOT_FINITE)
    .with(Status::PLANAR_EXTRAPOLATED);
const DECODED: Status = PLANAR_DECODED
    .with(Status::VERTICAL_NOT_FINITE)
    .with(Status::VERTICAL_EXTRAPOLATED);

/// What happens in a tick.
#[derive(Clone, Copy, Debug)]
enum Event {
    Sound,
    /// A code is missing or at a rail: channels 0 to 2 are Hall, 3 to 5 capacitive.
    Bad(usize, i32),
    /// Codes of a pose outside the calibrated range.
    FarPlanar,
    FarVertical,
    /// This number of frames was lost before, and no one noticed.
    Gap(u32),
    /// The tick passes without a frame.
    NoFrame,
    /// The last frame comes again, or an older one.
    Late(u32),
    /// Another zero deviation of X from this tick on, um.
    Zero(u32),
    /// The source was restarted, and the servo knows.
    Restart(u32),
}

/// Random numbers by the seed alone (xorshift).
struct Random(u64);

impl Random {
    fn below(&mut self, end: u32) -> u32 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 32) as u32 % end
    }

    /// One event in twelve is a fault, and most faults last a few ticks, since they come again.
    fn event(&mut self, before: Event) -> Event {
        let may_last = matches!(before, Event::Bad(..) | Event::NoFrame | Event::Late(_));
        if may_last && self.below(4) > 0 {
            return before;
        }
        let rails = [MISSING_CODE, -32768, 32767, i32::MAX, 8_388_608];
        match self.below(100_000) {
            0..4_000 => Event::Bad(self.below(6) as usize, rails[self.below(5) as usize]),
            4_000..5_000 => Event::FarPlanar,
            5_000..6_000 => Event::FarVertical,
            6_000..7_000 => Event::Gap(1 + self.below(20)),
            7_000..7_002 => Event::Gap(0x4000_0000),
            7_100..8_000 => Event::NoFrame,
            8_000..8_500 => Event::Late(self.below(50)),
            8_500..8_510 => Event::Zero(self.below(3)),
            8_510..8_512 => Event::Restart(self.below(u32::MAX)),
            _ => Event::Sound,
        }
    }
}

/// X, Y, Rz and Z, Rx, Ry to the bit.
fn words(pose: &Pose) -> [[u32; 3]; 2] {
    [pose.planar.to_array(), pose.vertical.to_array()].map(|half| half.map(f32::to_bits))
}

/// What the servo must do, worked out from the events alone.
#[derive(Default)]
struct Account {
    holds_left: [u16; 2],
    last: [[u32; 3]; 2],
    zero: PlanarPose<f32>,
    health: Health,
    good: u32,
    seen: BTreeSet<u32>,
}

impl Account {
    /// Checks a reading against the status that its event explains and the decoder's own pose.
    fn check(&mut self, event: Event, explained: Status, reading: &Reading, decoded: &Pose) {
        let mut status = explained;
        if self.zero != PlanarPose::ZERO {
            status = status.with(Status::ZERO_SET);
        }
        let (mut expected, decoded) = ([[0; 3]; 2], words(decoded));
        let health = &mut self.health;
        health.ticks += 1;
        let halves = [
            (Status::PLANAR_INVALID, Status::PLANAR_HELD),
            (Status::VERTICAL_INVALID, Status::VERTICAL_HELD),
        ];
        for (half, (invalid, held)) in halves.into_iter().enumerate() {
            if !explained.any(invalid) {
                expected[half] = decoded[half];
                (self.holds_left[half], self.last[half]) = (HOLD, decoded[half]);
                continue;
            }
            *[&mut health.planar_invalid, &mut health.vertical_invalid][half] += 1;
            if self.holds_left[half] > 0 {
                self.holds_left[half] -= 1;
                expected[half] = self.last[half];
                status = status.with(held);
            }
        }
        health.held += u32::from(status.any(Status::PLANAR_HELD.with(Status::VERTICAL_HELD)));
        // What an implausible code decodes to says nothing: it may be anything.
        let free = match () {
            () if explained.any(Status::VERTICAL_INVALID) => DECODED,
            () if explained.any(Status::PLANAR_INVALID) => PLANAR_DECODED,
            () => Status::GOOD,
        };
        let found = Status::from_bits(reading.status.bits() & !free.bits());
        assert_eq!(found, status, "{event:?} in tick {}", health.ticks);
        assert_eq!(words(&reading.pose), expected, "{event:?}");
        self.good += u32::from(reading.status.is_good());
        self.seen.insert(reading.status.bits());
    }
}

/// A sound frame of a stage that moves: each code goes up and down at a pace of its own.
fn frame(n: u32, sequence: u32) -> RawFrame {
    let swing = |period: u32, amplitude: i32| {
        let phase = (n % period) as i32 * 4 * amplitude / period as i32;
        (phase - 2 * amplitude).abs() - amplitude
    };
    let hall = [997, 1009, 1013].map(|period| swing(period, 400));
    let capacitive = [499, 503, 509].map(|period| swing(period, 2000));
    RawFrame::new(hall, capacitive, sequence, n.wrapping_mul(2_000))
}

/// Runs a stage for `ticks`, from a sequence number that wraps on the way.
fn soak(blob: &[u8], ticks: u32, seed: u64) {
    let set = ParameterSet::from_bytes(blob).expect("a golden blob");
    let decoder = set.decoder();
    let mut tracker = PoseTracker::new(decoder, OnInvalid::Hold { ticks: HOLD });
    let (mut random, mut account) = (Random(seed), Account::default());
    let mut sequence = u32::MAX - ticks / 2;
    let mut event = Event::Sound;
    for n in 0..ticks {
        if n > 0 {
            event = random.event(event);
        }
        let late = matches!(event, Event::Late(_));
        sequence = sequence.wrapping_add(u32::from(!late));
        let mut frame = frame(n, sequence);
        let mut explained = Status::GOOD;
        let health = &mut account.health;
        match event {
            Event::Sound => {}
            Event::Bad(channel, code) => {
                let codes = frame.hall.iter_mut().chain(&mut frame.capacitive);
                codes.skip(channel).take(1).for_each(|bad| *bad = code);
                let invalid = [Status::PLANAR_INVALID, INVALID][channel / 3];
                explained = Status::from_bits(1 << channel).with(invalid);
            }
            Event::FarPlanar => {
                frame.hall = [30_000; 3];
                explained = Status::PLANAR_EXTRAPOLATED;
            }
            Event::FarVertical => {
                frame.capacitive = [30_000; 3];
                explained = Status::VERTICAL_EXTRAPOLATED;
            }
            Event::Gap(lost) => {
                sequence = sequence.wrapping_add(lost);
                frame.sequence = sequence;
                health.frames_missed = health.frames_missed.saturating_add(lost);
                explained = Status::FRAMES_MISSED;
            }
            Event::NoFrame => {
                health.frames_missed = health.frames_missed.saturating_add(1);
                explained = Status::FRAMES_MISSED.with(INVALID);
            }
            Event::Late(by) => {
                frame.sequence = sequence.wrapping_sub(by);
                health.frames_repeated += 1;
                explained = Status::FRAME_REPEATED.with(INVALID);
            }
            Event::Zero(um) => {
                account.zero.x_m = um as f32 * 1e-6;
                account.holds_left[0] = 0;
                assert!(tracker.set_zero(account.zero));
            }
            Event::Restart(anew) => {
                tracker.forget();
                account.holds_left = [0; 2];
                (sequence, frame.sequence) = (anew, anew);
            }
        }
        let decoded = decoder.decode(&frame, &account.zero).pose;
        let reading = match event {
            Event::NoFrame => tracker.tick_without_frame(),
            _ => tracker.tick(&frame),
        };
        account.check(event, explained, &reading, &decoded);
    }
    assert_eq!(tracker.health(), account.health);
    // Each fault came, and most ticks were sound.
    let seen = account.seen.iter().fold(0, |all, status| all | status);
    let unseen = Status::SENSITIVITY
        .with(Status::PLANAR_NOT_FINITE)
        .with(Status::VERTICAL_NOT_FINITE)
        .with(Status::TEMPERATURE_MISSING)
        .with(Status::FORCED);
    let all = Status::NAMES
        .iter()
        .fold(0, |all, (bit, _)| all | bit.bits());
    assert_eq!(seen | unseen.bits(), all);
    assert!(account.good > ticks / 2);
}

#[test]
fn hours_of_ticks_with_faults_are_accounted_for() {
    soak(include_bytes!("../examples/stage.bin"), 3 * HOUR, 3);
    soak(include_bytes!("../examples/field.bin"), 3 * HOUR, 4);
}
