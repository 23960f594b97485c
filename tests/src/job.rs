//! One job that host and target both do: frames in, words out.
//!
//! A job file is a row of sections of little-endian words. A section is a head of four words,
//! a parameter blob, and the frames; the answer is seven words for each frame.
//!
//! | words | what |
//! |---|---|
//! | 4 | source ([`BLOB`] or [`PREDICTED`]), frames, hold in ticks, bytes of the blob |
//! | the blob | padded with 0xFF to whole words |
//! | 9 a frame | Hall codes A, B, C, capacitive codes 1, 2, 3, sequence number, temperatures of mount and body |
//!
//! A blob is loaded as from flash and run by a servo; in a section of [`PREDICTED`] a [`Predictor`]
//! gives X, Y, Rz. With a motion correction they are corrected by a motion that follows from the codes. This file is compiled into the host's tool and into the image, so it uses `core` only.

#[path = "job_run.rs"]
mod run;

pub use run::{Stop, Transfer, run};

use runtime::{CommandedMotion, OnInvalid, PlanarPose, PoseTracker, Predictor, RawFrame, Reading};

/// Source: a parameter blob.
pub const BLOB: u32 = 2;
/// Source: as [`BLOB`], with X, Y, Rz predicted by [`PredictingTracker`].
pub const PREDICTED: u32 = 4;
/// Words of a section's head.
pub const HEAD_WORDS: usize = 4;
/// Words of a frame.
pub const FRAME_WORDS: usize = 9;
/// Words of an answer: X, Y, Rz, Z, Rx, Ry, status.
pub const ANSWER_WORDS: usize = 7;
/// Words that a blob takes at most.
pub const BLOB_WORDS: usize = runtime::blob::MAX_BYTES / 4;

/// The head of a section.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Head {
    /// [`BLOB`] or [`PREDICTED`].
    pub source: u32,
    /// Frames that follow the parameters.
    pub frames: u32,
    /// Longest hold of an invalid value, ticks; 0: it reads zero.
    pub hold: u32,
    /// Bytes of the blob before its padding.
    pub blob_bytes: u32,
}

impl Head {
    /// From its words.
    pub const fn from_words([source, frames, hold, blob_bytes]: [u32; HEAD_WORDS]) -> Self {
        Self {
            source,
            frames,
            hold,
            blob_bytes,
        }
    }

    /// Its words.
    pub const fn to_words(self) -> [u32; HEAD_WORDS] {
        [self.source, self.frames, self.hold, self.blob_bytes]
    }

    /// Words of the parameters, or `None` for a head that no job has.
    pub fn parameter_words(&self) -> Option<usize> {
        match self.source {
            BLOB | PREDICTED => {
                let words = usize::try_from(self.blob_bytes).ok()?.div_ceil(4);
                (words <= BLOB_WORDS).then_some(words)
            }
            _ => None,
        }
    }

    /// What the servo does with invalid fields.
    pub fn on_invalid(&self) -> OnInvalid {
        match u16::try_from(self.hold) {
            Ok(0) => OnInvalid::Zero,
            Ok(ticks) => OnInvalid::Hold { ticks },
            Err(_) => OnInvalid::Hold { ticks: u16::MAX },
        }
    }
}

/// A tracker with predicted X, Y, Rz. The time of a frame follows from its sequence number.
pub struct PredictingTracker {
    tracker: PoseTracker,
    predictor: Predictor,
}

impl PredictingTracker {
    /// With the tracker that decodes.
    pub const fn new(tracker: PoseTracker) -> Self {
        Self {
            tracker,
            predictor: Predictor::new(4_000),
        }
    }

    /// The reading with X, Y, Rz predicted to an age of 0 to 4.5 ms, and zero where there is no
    /// prediction.
    pub fn tick(&mut self, frame: &RawFrame) -> Reading {
        // Every 2 ms with some jitter; the time wraps after 32 periods.
        let k = frame.sequence;
        let time_us = (k.wrapping_mul(2_000) | (k.wrapping_mul(k) & 15)).wrapping_sub(64_000);
        let frame = RawFrame { time_us, ..*frame };
        let mut reading = self.tracker.tick(&frame);
        self.predictor.take(&self.tracker, &frame, &reading);
        let at_us = time_us.wrapping_add(k.wrapping_mul(193) % 4_500);
        reading.pose.planar = self.predictor.pose_at(at_us).unwrap_or(PlanarPose::ZERO);
        reading
    }
}

/// A commanded motion made of a frame's codes: up to 3 m/s, m/s2, and in one tick of 64 any words.
pub fn motion(frame: &RawFrame) -> CommandedMotion {
    let number = |code: i32| match frame.sequence % 64 {
        0 => f32::from_bits((code as u32) << 16),
        _ => code as f32 * 1e-4,
    };
    let velocity = frame.hall.map(number);
    let [vx, vy, vrz] = velocity;
    let [x, y, rz] = frame.capacitive.map(number);
    CommandedMotion {
        velocity,
        acceleration: [x, y, rz, vy, vrz, vx],
    }
}

/// The frame of the words.
pub const fn frame([a, b, c, g1, g2, g3, sequence, mount, body]: [u32; FRAME_WORDS]) -> RawFrame {
    RawFrame::new(
        [a as i32, b as i32, c as i32],
        [g1 as i32, g2 as i32, g3 as i32],
        sequence,
        0,
    )
    .with_temperature_mc([mount as i32, body as i32])
}

/// The words of a frame.
pub const fn frame_words(frame: &RawFrame) -> [u32; FRAME_WORDS] {
    let ([a, b, c], [g1, g2, g3]) = (frame.hall, frame.capacitive);
    let [mount, body] = frame.temperature_mc;
    [
        a as u32,
        b as u32,
        c as u32,
        g1 as u32,
        g2 as u32,
        g3 as u32,
        frame.sequence,
        mount as u32,
        body as u32,
    ]
}

/// The words of a reading.
pub const fn answer(reading: &Reading) -> [u32; ANSWER_WORDS] {
    let (q, v) = (&reading.pose.planar, &reading.pose.vertical);
    [
        q.x_m.to_bits(),
        q.y_m.to_bits(),
        q.rz_rad.to_bits(),
        v.z_m.to_bits(),
        v.rx_rad.to_bits(),
        v.ry_rad.to_bits(),
        reading.status.bits(),
    ]
}
