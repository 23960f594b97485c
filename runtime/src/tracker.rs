//! What lasts from tick to tick: the last valid pose, the sequence of the frames, counters,
//! and a re-zero in progress.
//!
//! [`PoseTracker::tick`] is what a controller calls every servo period. Time is not read here:
//! the frame carries its sequence number, and the caller reports a period without a frame by
//! [`PoseTracker::tick_without_frame`].

use crate::decoder::{AnyDecoder, Decode, Reading};
use crate::frame::RawFrame;
use crate::pose::{PlanarPose, Pose, VerticalPose};
use crate::status::Status;
use crate::zero_offset::{ZeroOffsetRefusal, ZeroOffsetRun, ZeroOffsetSettings, ZeroOffsetState};

/// What an invalid field reads.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum OnInvalid {
    /// Zero, marked invalid.
    #[default]
    Zero,
    /// The last valid value, marked invalid and held, for at most `ticks` ticks in a row;
    /// zero after that.
    Hold {
        /// How many ticks in a row a value may be repeated.
        ticks: u16,
    },
}

/// Counters since start. They saturate: they never wrap to a good-looking zero.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(C)]
pub struct Health {
    /// Ticks, with and without a frame.
    pub ticks: u32,
    /// Ticks with an invalid planar pose.
    pub planar_invalid: u32,
    /// Ticks with an invalid vertical pose.
    pub vertical_invalid: u32,
    /// Ticks with a held value.
    pub held: u32,
    /// Servo periods that had no frame.
    pub frames_missed: u32,
    /// Frames that repeated an earlier sequence number.
    pub frames_repeated: u32,
}

/// Runs a decoder from tick to tick: one of its own, of whatever model, or a borrowed one.
///
/// ```
/// use runtime::{OnInvalid, ParameterSet, RawFrame, PoseTracker, Status};
/// use runtime::frame::MISSING_CODE;
/// # const BLOB: &[u8] = include_bytes!(concat!(env!("CARGO_MANIFEST_DIR"), "/examples/stage.bin"));
/// # fn main() -> Result<(), runtime::BlobError> {
/// let decoder = ParameterSet::from_bytes(BLOB)?.decoder();
/// let mut tracker = PoseTracker::new(decoder, OnInvalid::Hold { ticks: 2 });
/// let mut frame = RawFrame::new([1200, 900, 700], [300, -200, 100], 1, 0);
/// let good = tracker.tick(&frame);
///
/// (frame.hall[0], frame.sequence) = (MISSING_CODE, 2);
/// let held = tracker.tick(&frame);
/// assert!(held.status.any(Status::PLANAR_HELD));
/// assert_eq!((held.planar(), held.planar_or_held()), (None, good.planar()));
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug)]
pub struct PoseTracker<D = AnyDecoder> {
    decoder: D,
    on_invalid: OnInvalid,
    zero: PlanarPose<f32>,
    /// [`Status::ZERO_SET`] while `zero` is not zero.
    zero_status: Status,
    last: Pose,
    planar_holds_left: u16,
    vertical_holds_left: u16,
    last_sequence: Option<u32>,
    zero_offset: ZeroOffsetState,
    run: Option<ZeroOffsetRun>,
    health: Health,
}

/// A pose of zeros, in a `const`.
const NO_POSE: Pose = Pose {
    planar: PlanarPose::ZERO,
    vertical: VerticalPose::ZERO,
};

/// The reading of a period without new codes.
const NOTHING: Reading = Reading {
    pose: NO_POSE,
    status: Status::PLANAR_INVALID.with(Status::VERTICAL_INVALID),
};

impl<D: Decode> PoseTracker<D> {
    /// A tracker with no zero deviation, no pose to hold and all counters zero.
    pub const fn new(decoder: D, on_invalid: OnInvalid) -> Self {
        Self {
            decoder,
            on_invalid,
            zero: NO_POSE.planar,
            zero_status: Status::GOOD,
            last: NO_POSE,
            planar_holds_left: 0,
            vertical_holds_left: 0,
            last_sequence: None,
            zero_offset: ZeroOffsetState::Idle,
            run: None,
            health: Health {
                ticks: 0,
                planar_invalid: 0,
                vertical_invalid: 0,
                held: 0,
                frames_missed: 0,
                frames_repeated: 0,
            },
        }
    }

    /// The decoder.
    pub const fn decoder(&self) -> &D {
        &self.decoder
    }

    /// One servo period: decodes the frame, subtracts the zero deviation, holds or zeroes
    /// what is invalid, counts, and feeds a re-zero in progress.
    ///
    /// A frame is new if its sequence number is ahead of the last frame's (modulo 2^32, by less
    /// than half of it). Other frames are not decoded. A source that starts to count
    /// again from a lower number is refused until it has caught up: call [`PoseTracker::forget`] when
    /// it restarts.
    pub fn tick(&mut self, frame: &RawFrame) -> Reading {
        self.step(frame.sequence, |decoder, zero| decoder.decode(frame, zero))
    }

    /// As [`PoseTracker::tick`] with a decoder of the caller, which subtracts the zero deviation that it
    /// is given: for a vertical pose that is known by other means (a log in SI columns), see
    /// [`Decoder::decode_at`](crate::Decoder::decode_at).
    #[inline(always)]
    pub fn tick_with(
        &mut self,
        sequence: u32,
        decode: impl FnOnce(&PlanarPose<f32>) -> Reading,
    ) -> Reading {
        self.step(sequence, |_, zero| decode(zero))
    }

    #[inline(always)]
    fn step(
        &mut self,
        sequence: u32,
        decode: impl FnOnce(&D, &PlanarPose<f32>) -> Reading,
    ) -> Reading {
        let Some(sequence) = self.follow(sequence) else {
            return self.conclude(NOTHING, Status::FRAME_REPEATED);
        };
        let reading = decode(&self.decoder, &self.zero);
        let reading = self.conclude(reading, sequence);
        if self.run.is_some() {
            self.feed_zero_offset(&reading);
        }
        reading
    }

    /// Takes note of a frame's sequence number. Returns the status of missed frames, or `None`
    /// if the frame is not new.
    #[inline(always)]
    fn follow(&mut self, sequence: u32) -> Option<Status> {
        let ahead = match self.last_sequence {
            None => 1,
            Some(last) => sequence.wrapping_sub(last),
        };
        if ahead == 0 || ahead > u32::MAX / 2 {
            self.health.frames_repeated = self.health.frames_repeated.saturating_add(1);
            return None;
        }
        self.last_sequence = Some(sequence);
        let missed = ahead - 1;
        self.health.frames_missed = self.health.frames_missed.saturating_add(missed);
        Some(if missed == 0 {
            Status::GOOD
        } else {
            Status::FRAMES_MISSED
        })
    }

    /// One servo period without a frame: there is no measurement, values are held or zero.
    ///
    /// The period takes a sequence number, as in a source that numbers periods: a frame of that
    /// number that comes after all is late, and is judged repeated. A source that numbers only
    /// the frames that it sends loses one more frame for each such period.
    pub fn tick_without_frame(&mut self) -> Reading {
        self.health.frames_missed = self.health.frames_missed.saturating_add(1);
        self.last_sequence = self.last_sequence.map(|last| last.wrapping_add(1));
        if self.run.take().is_some() {
            let status = Status::FRAMES_MISSED;
            self.zero_offset = ZeroOffsetState::Refused(ZeroOffsetRefusal::NoPose { status });
        }
        self.conclude(NOTHING, Status::FRAMES_MISSED)
    }

    /// Starts to average at rest; [`PoseTracker::zero_offset_state`] reports the progress. The zero
    /// deviation in use stays until the run is done, and also if the run is refused.
    pub fn start_zero_offset(&mut self, settings: ZeroOffsetSettings) {
        match ZeroOffsetRun::start(settings) {
            Ok(run) => {
                self.run = Some(run);
                self.zero_offset = ZeroOffsetState::Running {
                    ticks_left: settings.ticks & !1,
                };
            }
            Err(refusal) => {
                self.run = None;
                self.zero_offset = ZeroOffsetState::Refused(refusal);
            }
        }
    }

    /// Gives up a re-zero that runs; the zero deviation in use stays.
    pub const fn cancel_zero_offset(&mut self) {
        self.run = None;
        self.zero_offset = ZeroOffsetState::Idle;
    }

    /// Where the re-zero stands.
    pub const fn zero_offset_state(&self) -> ZeroOffsetState {
        self.zero_offset
    }

    /// The zero deviation that is subtracted, as a pose.
    pub const fn zero(&self) -> PlanarPose<f32> {
        self.zero
    }

    /// Subtracts a zero deviation that is known, for instance from before a restart, and forgets
    /// X, Y, Rz to hold. One that is not finite is ignored and `false` returned.
    pub fn set_zero(&mut self, zero: PlanarPose<f32>) -> bool {
        let finite = zero.to_array().iter().all(|x| x.is_finite());
        if finite {
            self.subtract(zero);
        }
        finite
    }

    /// Subtracts `zero` from the next tick on. A pose to hold has the old one subtracted: it is
    /// forgotten.
    fn subtract(&mut self, zero: PlanarPose<f32>) {
        self.planar_holds_left = 0;
        self.zero = zero;
        self.zero_status = Status::ZERO_SET.when(zero != NO_POSE.planar);
    }

    /// The counters.
    pub const fn health(&self) -> Health {
        self.health
    }

    /// Forgets the pose to hold and the sequence, for a new movement or after a pause; zero
    /// deviation and counters stay.
    pub const fn forget(&mut self) {
        self.planar_holds_left = 0;
        self.vertical_holds_left = 0;
        self.last_sequence = None;
    }

    /// Feeds a re-zero in progress with the reading, the zero deviation in use put back. A
    /// function of its own: the tick stays short while no re-zero runs.
    #[cold]
    #[inline(never)]
    fn feed_zero_offset(&mut self, reading: &Reading) {
        let Some(run) = &mut self.run else { return };
        let mut unzeroed = *reading;
        unzeroed.pose.planar.x_m += self.zero.x_m;
        unzeroed.pose.planar.y_m += self.zero.y_m;
        unzeroed.pose.planar.rz_rad += self.zero.rz_rad;
        self.zero_offset = run.take(&unzeroed);
        match self.zero_offset {
            ZeroOffsetState::Running { .. } => {}
            ZeroOffsetState::Done { zero } => {
                self.subtract(zero);
                self.run = None;
            }
            ZeroOffsetState::Idle | ZeroOffsetState::Refused(_) => self.run = None,
        }
    }

    /// Holds or zeroes what is invalid, and counts.
    fn conclude(&mut self, mut reading: Reading, sequence: Status) -> Reading {
        reading.status = reading.status.with(sequence).with(self.zero_status);
        let hold = match self.on_invalid {
            OnInvalid::Zero => 0,
            OnInvalid::Hold { ticks } => ticks,
        };
        let health = &mut self.health;
        health.ticks = health.ticks.saturating_add(1);
        let mut held = false;
        if reading.status.any(Status::PLANAR_INVALID) {
            health.planar_invalid = health.planar_invalid.saturating_add(1);
            if let Some(left) = self.planar_holds_left.checked_sub(1) {
                self.planar_holds_left = left;
                reading.pose.planar = self.last.planar;
                reading.status = reading.status.with(Status::PLANAR_HELD);
                held = true;
            }
        } else {
            self.last.planar = reading.pose.planar;
            self.planar_holds_left = hold;
        }
        if reading.status.any(Status::VERTICAL_INVALID) {
            health.vertical_invalid = health.vertical_invalid.saturating_add(1);
            if let Some(left) = self.vertical_holds_left.checked_sub(1) {
                self.vertical_holds_left = left;
                reading.pose.vertical = self.last.vertical;
                reading.status = reading.status.with(Status::VERTICAL_HELD);
                held = true;
            }
        } else {
            self.last.vertical = reading.pose.vertical;
            self.vertical_holds_left = hold;
        }
        health.held = health.held.saturating_add(u32::from(held));
        reading
    }
}

#[cfg(test)]
#[path = "tracker_tests.rs"]
mod tests;
