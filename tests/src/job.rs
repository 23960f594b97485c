//! One job that host and target both do: frames in, words out.
//!
//! A job file is a row of sections of little-endian words. A section is a head of four words,
//! the parameters, and the frames; the answer is seven words for each frame.
//!
//! | words | what |
//! |---|---|
//! | 4 | source ([`WORDS`], [`FIELD_WORDS`], [`BLOB`] or [`PREDICTED`]), frames, hold in ticks, bytes of the blob |
//! | 54, 126 or the blob | the decoder's constants, a zero deviation and the probes' coefficients as bare words, or a blob padded with 0xFF to whole words |
//! | 9 a frame | Hall codes A, B, C, capacitive codes 1, 2, 3, sequence number, temperatures of mount and body |
//!
//! Bare words go straight into a decoder, unchecked: they may be anything. A blob is loaded
//! as from flash and run by a servo; in a section of [`PREDICTED`] a [`Predictor`] gives X, Y,
//! Rz. This file is compiled into the host's tool and into the
//! image, so it uses `core` only.

#[path = "job_run.rs"]
mod run;

pub use run::{Stop, Transfer, run};

use runtime::decoder::DecoderConstants;
use runtime::frame::CodeWindow;
use runtime::model::{FieldProbe, Sensitivity, Shape};
use runtime::{
    Decode, Decoder, FieldModel, LinearModel, Model, OnInvalid, PlanarPose, PoseTracker, Predictor,
    RawFrame, Reading, Temperature,
};

/// Source: a decoder of Model (31) and a zero deviation as bare words.
pub const WORDS: u32 = 1;
/// Source: a parameter blob.
pub const BLOB: u32 = 2;
/// Source: as [`WORDS`], of the field model.
pub const FIELD_WORDS: u32 = 3;
/// Source: as [`BLOB`], with X, Y, Rz predicted by [`PredictingTracker`].
pub const PREDICTED: u32 = 4;
/// Words of a section's head.
pub const HEAD_WORDS: usize = 4;
/// Bare words of constants, zero deviation and coefficients in the field model.
pub const PARAMETER_WORDS: usize = 126;
/// The same in Model (31).
const LINEAR_PARAMETER_WORDS: usize = 54;
/// Words of a frame.
pub const FRAME_WORDS: usize = 9;
/// Words of an answer: X, Y, Rz, Z, Rx, Ry, status.
pub const ANSWER_WORDS: usize = 7;
/// Words that a blob takes at most.
pub const BLOB_WORDS: usize = runtime::blob::MAX_BYTES / 4;

/// The head of a section.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Head {
    /// [`WORDS`], [`FIELD_WORDS`], [`BLOB`] or [`PREDICTED`].
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
            WORDS => Some(LINEAR_PARAMETER_WORDS),
            FIELD_WORDS => Some(PARAMETER_WORDS),
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

/// A model with a decoder that goes through a job file as bare words.
pub trait Bare: Model {
    /// Its source: [`WORDS`] or [`FIELD_WORDS`].
    const SOURCE: u32;
    /// A probe's coefficients, each taken from `next`.
    fn probe(next: &mut impl FnMut() -> f32) -> Self::Probe<f32>;
    /// Gives each of a probe's coefficients to `put`, in the same order.
    fn put(probe: &Self::Probe<f32>, put: &mut impl FnMut(f32));
}

impl Bare for LinearModel {
    const SOURCE: u32 = WORDS;

    fn probe(next: &mut impl FnMut() -> f32) -> Sensitivity<f32> {
        Sensitivity {
            eta: next(),
            per_z_m: next(),
            per_rx_rad: next(),
            per_ry_rad: next(),
        }
    }

    fn put(probe: &Sensitivity<f32>, put: &mut impl FnMut(f32)) {
        put(probe.eta);
        put(probe.per_z_m);
        put(probe.per_rx_rad);
        put(probe.per_ry_rad);
    }
}

impl Bare for FieldModel {
    const SOURCE: u32 = FIELD_WORDS;

    fn probe(next: &mut impl FnMut() -> f32) -> FieldProbe<f32> {
        FieldProbe {
            sensitivity: LinearModel::probe(next),
            carry: [next(), next(), next()],
            shape: Shape {
                u_w_w: [next(), next()],
                u_w: [next(), next()],
                u_z_z: [next(), next()],
                u_u_u: [next(), next()],
                u_u: [next(), next()],
                w_w: [next(), next()],
                w_z: [next(), next()],
                z_z: [next(), next()],
                u_u_w: next(),
                w_w_w: next(),
            },
            lateral: [next(), next(), next()],
        }
    }

    fn put(probe: &FieldProbe<f32>, put: &mut impl FnMut(f32)) {
        LinearModel::put(&probe.sensitivity, put);
        let p = &probe.shape;
        let pairs = [p.u_w_w, p.u_w, p.u_z_z, p.u_u_u, p.u_u, p.w_w, p.w_z, p.z_z];
        let numbers = (probe.carry.iter())
            .chain(pairs.as_flattened())
            .chain([&p.u_u_w, &p.w_w_w])
            .chain(&probe.lateral);
        for number in numbers {
            put(*number);
        }
    }
}

/// A decoder and a zero deviation of bare words, unchecked; words that are missing are 0.
pub fn from_words<M: Bare>(words: &[u32]) -> (Decoder<M>, PlanarPose<f32>) {
    let mut rest = words.iter().copied();
    let mut next = || rest.next().unwrap_or_default();
    let mut window = || CodeWindow {
        low: next() as i32,
        high: next() as i32,
    };
    let (hall_window, capacitive_window) = (window(), window());
    let mut pair = || [next(), next()];
    let (zero_mc, reach_mk) = (pair().map(u32::cast_signed), pair());
    let mut number = || f32::from_bits(next());
    let sensitivity_min = number();
    let mut three = || [number(), number(), number()];
    let (vertical_per_code, planar_per_code) =
        ([three(), three(), three()], [three(), three(), three()]);
    let (calibrated_vertical, calibrated_planar) = (three(), three());
    let mut two = || [number(), number()];
    let constants = DecoderConstants {
        vertical_per_code,
        planar_per_code,
        calibrated_vertical,
        calibrated_planar,
        sensitivity_min,
        hall_window,
        capacitive_window,
        temperature: Temperature {
            per_mk: [two(), two(), two()],
            zero_mc,
            reach_mk,
        },
    };
    let mut three = || [number(), number(), number()];
    let zero = PlanarPose::from_array(three());
    let mut probe = || M::probe(&mut number);
    (Decoder::new(constants, [probe(), probe(), probe()]), zero)
}

/// Gives `put` the words of a decoder and a zero deviation, as [`from_words`] reads them.
pub fn to_words<M: Bare>(decoder: &Decoder<M>, zero: &PlanarPose<f32>, put: &mut impl FnMut(u32)) {
    let c = decoder.constants();
    let [hall, gaps] = [&c.hall_window, &c.capacitive_window];
    let ([mount, body], reach) = (c.temperature.zero_mc, c.temperature.reach_mk);
    for code in [hall.low, hall.high, gaps.low, gaps.high, mount, body] {
        put(code as u32);
    }
    reach.into_iter().for_each(&mut *put);
    let mut put = |number: f32| put(number.to_bits());
    put(c.sensitivity_min);
    let zero = zero.to_array();
    let numbers = (c.vertical_per_code.as_flattened().iter())
        .chain(c.planar_per_code.as_flattened())
        .chain(&c.calibrated_vertical)
        .chain(&c.calibrated_planar)
        .chain(c.temperature.per_mk.as_flattened())
        .chain(&zero);
    for number in numbers {
        put(*number);
    }
    for probe in decoder.probes() {
        M::put(probe, &mut put);
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
