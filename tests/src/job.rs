//! One job that host and target both do: frames in, words out.
//!
//! A job file is a row of sections of little-endian words. A section is a head of four words,
//! the parameters, and the frames; the answer is seven words for each frame.
//!
//! | words | what |
//! |---|---|
//! | 4 | source ([`WORDS`] or [`BLOB`]), frames, hold in ticks, bytes of the blob |
//! | 44, or the blob | the decoder's constants and a zero deviation as bare words, or a blob padded with 0xFF to whole words |
//! | 7 a frame | Hall codes A, B, C, capacitive codes 1, 2, 3, sequence number |
//!
//! Bare words go straight into a decoder, unchecked: they may be anything. A blob is loaded
//! as from flash and run by a servo. This file is compiled into the host's tool and into the
//! image, so it uses `core` only.

use runtime::decoder::DecoderConstants;
use runtime::frame::CodeWindow;
use runtime::model::Sensitivity;
use runtime::{Decode, Decoder, LinearModel, OnInvalid, PlanarPose, RawFrame, Reading};

/// Source: constants and a zero deviation as bare words.
pub const WORDS: u32 = 1;
/// Source: a parameter blob.
pub const BLOB: u32 = 2;
/// Words of a section's head.
pub const HEAD_WORDS: usize = 4;
/// Words of the constants and of the zero deviation.
pub const PARAMETER_WORDS: usize = 44;
/// Words of a frame.
pub const FRAME_WORDS: usize = 7;
/// Words of an answer: X, Y, Rz, Z, Rx, Ry, status.
pub const ANSWER_WORDS: usize = 7;
/// Words that a blob takes at most.
pub const BLOB_WORDS: usize = runtime::blob::MAX_BYTES / 4;

/// The head of a section.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Head {
    /// [`WORDS`] or [`BLOB`].
    pub source: u32,
    /// Frames that follow the parameters.
    pub frames: u32,
    /// Ticks for which a servo holds what is invalid; 0: it reads zero.
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
            WORDS => Some(PARAMETER_WORDS),
            BLOB => {
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

/// A decoder and a zero deviation of bare words, unchecked.
pub fn from_words(words: &[u32; PARAMETER_WORDS]) -> (Decoder<LinearModel>, PlanarPose<f32>) {
    let mut rest = words.iter().copied();
    let mut next = || rest.next().unwrap_or_default();
    let mut three = || {
        [
            f32::from_bits(next()),
            f32::from_bits(next()),
            f32::from_bits(next()),
        ]
    };
    let vertical_per_code = [three(), three(), three()];
    let [[a0, a1, a2], [a3, b0, b1], [b2, b3, c0], [c1, c2, c3]] =
        [three(), three(), three(), three()];
    let sensitivity = |eta, per_z_m, per_rx_rad, per_ry_rad| Sensitivity {
        eta,
        per_z_m,
        per_rx_rad,
        per_ry_rad,
    };
    let planar_per_code = [three(), three(), three()];
    let calibrated_vertical = three();
    let calibrated_planar = three();
    let zero = PlanarPose::from_array(three());
    let mut window = || CodeWindow {
        low: next() as i32,
        high: next() as i32,
    };
    let constants = DecoderConstants {
        vertical_per_code,
        planar_per_code,
        calibrated_vertical,
        calibrated_planar,
        hall_window: window(),
        capacitive_window: window(),
        sensitivity_min: f32::from_bits(next()),
    };
    let probes = [
        sensitivity(a0, a1, a2, a3),
        sensitivity(b0, b1, b2, b3),
        sensitivity(c0, c1, c2, c3),
    ];
    (Decoder::new(constants, probes), zero)
}

/// The words of a decoder and a zero deviation, as [`from_words`] reads them.
pub fn to_words(decoder: &Decoder<LinearModel>, zero: &PlanarPose<f32>) -> [u32; PARAMETER_WORDS] {
    let c = decoder.constants();
    let [hall, gaps] = [&c.hall_window, &c.capacitive_window];
    let windows = [hall.low, hall.high, gaps.low, gaps.high].map(|code| code as u32);
    let probes = decoder
        .probes()
        .map(|s| [s.eta, s.per_z_m, s.per_rx_rad, s.per_ry_rad]);
    let numbers = (c.vertical_per_code.as_flattened().iter())
        .chain(probes.as_flattened())
        .chain(c.planar_per_code.as_flattened())
        .chain(&c.calibrated_vertical)
        .chain(&c.calibrated_planar)
        .map(|number| number.to_bits());
    let zero = zero.to_array().map(f32::to_bits);
    let all = numbers
        .chain(zero)
        .chain(windows)
        .chain([c.sensitivity_min.to_bits()]);
    let mut words = [0; PARAMETER_WORDS];
    for (word, value) in words.iter_mut().zip(all) {
        *word = value;
    }
    words
}

/// The frame of these words.
pub const fn frame([a, b, c, g1, g2, g3, sequence]: [u32; FRAME_WORDS]) -> RawFrame {
    RawFrame {
        hall: [a as i32, b as i32, c as i32],
        capacitive: [g1 as i32, g2 as i32, g3 as i32],
        sequence,
        time_us: 0,
    }
}

/// The words of a frame.
pub const fn frame_words(frame: &RawFrame) -> [u32; FRAME_WORDS] {
    let ([a, b, c], [g1, g2, g3]) = (frame.hall, frame.capacitive);
    [
        a as u32,
        b as u32,
        c as u32,
        g1 as u32,
        g2 as u32,
        g3 as u32,
        frame.sequence,
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
