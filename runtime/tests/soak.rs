//! Hours of ticks with faults: the injected fault explains every status, held poses equal the last
//! valid pose to the bit, and the counters add up.

use runtime::frame::MISSING_CODE;
use runtime::tracker::Health;
use runtime::{
    Decode, OnInvalid, ParameterSet, PlanarPose, Pose, PoseTracker, RawFrame, Reading, Status,
};
use std::collections::BTreeMap;

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
    /// No code of a channel, 0 to 2 Hall, 3 to 5 capacitive: missing, or at a rail.
    Bad {
        channel: usize,
        code: i32,
    },
    /// Codes of a pose outside the calibrated range.
    FarPlanar,
    FarVertical,
    /// This number of frames was lost before, and no one noticed.
    Gap(u32),
    /// The tick passes without a frame.
    NoFrame,
    /// The last frame comes again, or an older one.
    Late(u32),
    /// Another zero deviation from this tick on.
    Zero(PlanarPose<f32>),
    /// The source was restarted, and the servo knows; the first tick passes without a frame.
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
        if matches!(before, Event::Bad { .. } | Event::NoFrame | Event::Late(_))
            && self.below(4) > 0
        {
            return before;
        }
        let rails = [MISSING_CODE, -32768, 32767, i32::MAX, 8_388_608];
        match self.below(100_000) {
            0..4_000 => Event::Bad {
                channel: self.below(6) as usize,
                code: rails[self.below(5) as usize],
            },
            4_000..5_000 => Event::FarPlanar,
            5_000..6_000 => Event::FarVertical,
            6_000..7_000 => Event::Gap(1 + self.below(20)),
            7_000..7_002 => Event::Gap(0x4000_0000),
            7_100..8_000 => Event::NoFrame,
            8_000..8_500 => Event::Late(self.below(50)),
            8_500..8_510 => Event::Zero(PlanarPose {
                x_m: (self.below(3) as f32) * 1e-6,
                y_m: 0.0,
                rz_rad: 0.0,
            }),
            8_510..8_512 => Event::Restart(self.below(u32::MAX)),
            _ => Event::Sound,
        }
    }
}

/// What the servo must do, worked out from the events alone.
#[derive(Default)]
struct Account {
    holds_left: [u16; 2],
    last: Pose,
    zero: PlanarPose<f32>,
    health: Health,
    seen: BTreeMap<u32, u64>,
}

impl Account {
    /// Checks a reading against what its event explains; `decoded` is the decoder's own reading of the
    /// frame, if there was a new frame.
    fn check(&mut self, event: Event, reading: &Reading, decoded: Option<Reading>) {
        let mut status = match event {
            Event::Sound | Event::Zero(_) => Status::GOOD,
            Event::Bad { channel, .. } if channel < 3 => {
                Status::from_bits(1 << channel).with(Status::PLANAR_INVALID)
            }
            Event::Bad { channel, .. } => Status::from_bits(1 << channel).with(INVALID),
            Event::FarPlanar => Status::PLANAR_EXTRAPOLATED,
            Event::FarVertical => Status::VERTICAL_EXTRAPOLATED,
            Event::Gap(_) => Status::FRAMES_MISSED,
            Event::NoFrame | Event::Restart(_) => Status::FRAMES_MISSED.with(INVALID),
            Event::Late(_) => Status::FRAME_REPEATED.with(INVALID),
        };
        // What an implausible code decodes to says nothing: it may be anything.
        let free = if status.any(Status::VERTICAL_INVALID) {
            DECODED
        } else if status.any(Status::PLANAR_INVALID) {
            PLANAR_DECODED
        } else {
            Status::GOOD
        };
        let found = Status::from_bits(reading.status.bits() & !free.bits());
        let health = &mut self.health;
        health.ticks += 1;
        match event {
            Event::Gap(lost) => health.frames_missed = health.frames_missed.saturating_add(lost),
            Event::NoFrame | Event::Restart(_) => {
                health.frames_missed = health.frames_missed.saturating_add(1);
            }
            Event::Late(_) => health.frames_repeated += 1,
            _ => {}
        }
        if self.zero != PlanarPose::ZERO {
            status = status.with(Status::ZERO_SET);
        }
        let mut expected = decoded.map(|decoded| decoded.pose).unwrap_or_default();
        let mut held = false;
        if status.any(Status::PLANAR_INVALID) {
            health.planar_invalid += 1;
            expected.planar = PlanarPose::ZERO;
            if self.holds_left[0] > 0 {
                self.holds_left[0] -= 1;
                expected.planar = self.last.planar;
                status = status.with(Status::PLANAR_HELD);
                held = true;
            }
        } else {
            (self.holds_left[0], self.last.planar) = (HOLD, expected.planar);
        }
        if status.any(Status::VERTICAL_INVALID) {
            health.vertical_invalid += 1;
            expected.vertical = Pose::default().vertical;
            if self.holds_left[1] > 0 {
                self.holds_left[1] -= 1;
                expected.vertical = self.last.vertical;
                status = status.with(Status::VERTICAL_HELD);
                held = true;
            }
        } else {
            (self.holds_left[1], self.last.vertical) = (HOLD, expected.vertical);
        }
        health.held += u32::from(held);
        assert_eq!(found, status, "{event:?} in tick {}", health.ticks);
        let words = |pose: &Pose| {
            let (q, v) = (pose.planar.to_array(), pose.vertical.to_array());
            (q.map(f32::to_bits), v.map(f32::to_bits))
        };
        assert_eq!(words(&reading.pose), words(&expected), "{event:?}");
        *self.seen.entry(reading.status.bits()).or_default() += 1;
    }
}

/// A sound frame of a stage that moves: each code goes up and down at a pace of its own.
fn frame(n: u32, sequence: u32) -> RawFrame {
    let swing = |period: u32, amplitude: i32| {
        let phase = (n % period) as i32 * 4 * amplitude / period as i32;
        (phase - 2 * amplitude).abs() - amplitude
    };
    RawFrame::new(
        [swing(997, 400), swing(1009, 400), swing(1013, 400)],
        [swing(499, 2000), swing(503, 2000), swing(509, 2000)],
        sequence,
        n.wrapping_mul(2_000),
    )
}

/// Runs a stage for `ticks`, from a sequence number that wraps on the way.
fn soak(blob: &[u8], ticks: u32, seed: u64) {
    let set = ParameterSet::from_bytes(blob).expect("a golden blob");
    let decoder = set.decoder();
    let mut tracker = PoseTracker::new(decoder, OnInvalid::Hold { ticks: HOLD });
    let (mut random, mut account) = (Random(seed), Account::default());
    let mut sequence = u32::MAX - ticks / 2;
    let mut event = Event::Sound;
    let mut is_first = true;
    for n in 0..ticks {
        event = random.event(event);
        // After a restart no frame is late, and none was missed before the first.
        if n == 0 || is_first && matches!(event, Event::Late(_) | Event::Gap(_)) {
            event = Event::Sound;
        }
        sequence = sequence.wrapping_add(1);
        let mut frame = frame(n, sequence);
        match event {
            Event::Sound => {}
            Event::Bad { channel, code } => match frame.capacitive.get_mut(channel.wrapping_sub(3))
            {
                Some(gap) => *gap = code,
                None => frame.hall[channel] = code,
            },
            Event::FarPlanar => frame.hall = [30_000; 3],
            Event::FarVertical => frame.capacitive = [30_000; 3],
            Event::Gap(lost) => {
                sequence = sequence.wrapping_add(lost);
                frame.sequence = sequence;
            }
            Event::NoFrame => {
                account.check(event, &tracker.tick_without_frame(), None);
                continue;
            }
            Event::Late(by) => {
                sequence = sequence.wrapping_sub(1);
                frame.sequence = sequence.wrapping_sub(by);
                account.check(event, &tracker.tick(&frame), None);
                continue;
            }
            Event::Zero(zero) => {
                assert!(tracker.set_zero(zero));
                (account.zero, account.holds_left[0]) = (zero, 0);
            }
            Event::Restart(anew) => {
                tracker.forget();
                is_first = true;
                account.holds_left = [0; 2];
                sequence = anew;
                account.check(event, &tracker.tick_without_frame(), None);
                continue;
            }
        }
        is_first = false;
        let decoded = decoder.decode(&frame, &account.zero);
        account.check(event, &tracker.tick(&frame), Some(decoded));
    }
    assert_eq!(tracker.health(), account.health);
    let good: u64 = (account.seen.iter())
        .filter(|(status, _)| Status::from_bits(**status).is_good())
        .map(|(_, ticks)| ticks)
        .sum();
    println!(
        "RESULT soak_ticks={ticks} good={good} statuses={} held={} missed={} repeated={}",
        account.seen.len(),
        account.health.held,
        account.health.frames_missed,
        account.health.frames_repeated
    );
    // Each fault came, and most ticks were sound.
    let seen = account.seen.keys().fold(0, |all, status| all | status);
    let unseen = Status::SENSITIVITY
        .with(Status::PLANAR_NOT_FINITE)
        .with(Status::VERTICAL_NOT_FINITE)
        .with(Status::TEMPERATURE_MISSING);
    assert_eq!(seen | unseen.bits(), 0x1f_ffff);
    assert!(good > u64::from(ticks) / 2);
}

const MODEL_31: &[u8] = include_bytes!("../examples/stage.bin");
const FIELD_MODEL: &[u8] = include_bytes!("../examples/field.bin");

#[test]
fn hours_of_ticks_with_faults_are_accounted_for() {
    soak(MODEL_31, 3 * HOUR, 3);
    soak(FIELD_MODEL, 3 * HOUR, 4);
}
