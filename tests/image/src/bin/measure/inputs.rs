//! What is measured with: a sound stage, random codes, random parameters.

use image::job::{self, FRAME_WORDS};
use runtime::decoder::{Decoder, DecoderConstants};
use runtime::frame::CodeWindow;
use runtime::model::{FieldProbe, Sensitivity, Shape};
use runtime::{Model, PlanarPose, RawFrame, Temperature};

/// A sound stage, in round numbers.
pub const SOUND: DecoderConstants<f32> = DecoderConstants {
    vertical_per_code: [
        [7.8e-9, 7.8e-9, 0.0],
        [6.5e-8, 6.5e-8, -1.3e-7],
        [-6.5e-8, 6.5e-8, 0.0],
    ],
    planar_per_code: [
        [5.7e-8, -5.7e-8, 6.2e-8],
        [3.1e-8, 3.1e-8, 1e-10],
        [1.6e-7, -1.6e-7, 2e-10],
    ],
    calibrated_vertical: [3e-4, 1e-3, 1e-3],
    calibrated_planar: [6e-4, 6e-4, 5e-4],
    sensitivity_min: 0.1,
    hall_window: CodeWindow {
        low: -32767,
        high: 32766,
    },
    capacitive_window: CodeWindow {
        low: -32767,
        high: 32766,
    },
    temperature: Temperature::NONE,
};

/// Its probes.
pub const PROBES: [Sensitivity<f32>; 3] = [
    Sensitivity {
        eta: 0.86,
        per_z_m: -186.0,
        per_rx_rad: -63.0,
        per_ry_rad: 36.0,
    },
    Sensitivity {
        eta: 0.70,
        per_z_m: -164.0,
        per_rx_rad: -58.0,
        per_ry_rad: -36.0,
    },
    Sensitivity {
        eta: 0.86,
        per_z_m: -188.0,
        per_rx_rad: -62.0,
        per_ry_rad: 37.0,
    },
];

/// A plain pseudo-random sequence (xorshift), for inputs only.
pub struct Words(pub u32);

impl Words {
    /// The next word.
    pub fn next(&mut self) -> u32 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 17;
        self.0 ^= self.0 << 5;
        self.0
    }
}

/// The probes of [`PROBES`] with terms of the field model, in round numbers.
pub const FIELD_PROBES: [FieldProbe<f32>; 3] = {
    let probe = FieldProbe {
        sensitivity: PROBES[0],
        carry: [4e5, -3e5, 2e5],
        shape: Shape {
            u_w_w: [5e-11, 1e-10],
            u_w: [1e-7, -2e-7],
            u_z_z: [0.1, 0.2],
            u_u_u: [-1e-11, 4e-11],
            u_u: [2e-7, 4e-7],
            w_w: [-3e-7, 5e-7],
            w_z: [0.01, -0.02],
            z_z: [900.0, -900.0],
            u_u_w: 5e-12,
            w_w_w: -5e-12,
        },
        lateral: [0.1, -0.2, 0.9],
    };
    let [mut b, mut c] = [probe; 2];
    (b.sensitivity, c.sensitivity) = (PROBES[1], PROBES[2]);
    [probe, b, c]
};

/// Codes of 16 bits, or of any in each fourth round.
pub fn codes(words: &mut Words, k: u32) -> RawFrame {
    job::frame(core::array::from_fn::<u32, FRAME_WORDS, _>(|_| {
        match k % 4 {
            3 => words.next(),
            _ => (words.next() as i32 >> 16) as u32,
        }
    }))
}

/// Words of constants, zero deviation and coefficients in the field model.
const PARAMETER_WORDS: usize = 126;

/// Reads a probe's coefficients one by one.
type Probe<M> = fn(&mut dyn FnMut() -> f32) -> <M as Model>::Probe<f32>;

/// A probe of Model (31).
pub fn linear_probe(next: &mut dyn FnMut() -> f32) -> Sensitivity<f32> {
    Sensitivity {
        eta: next(),
        per_z_m: next(),
        per_rx_rad: next(),
        per_ry_rad: next(),
    }
}

/// A probe of the field model.
pub fn field_probe(next: &mut dyn FnMut() -> f32) -> FieldProbe<f32> {
    FieldProbe {
        sensitivity: linear_probe(next),
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

/// A decoder and a zero deviation of these words, unchecked.
fn from_words<M: Model>(
    words: [u32; PARAMETER_WORDS],
    probe: Probe<M>,
) -> (Decoder<M>, PlanarPose<f32>) {
    let mut rest = words.into_iter();
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
    let mut probe = || probe(&mut number);
    (Decoder::new(constants, [probe(), probe(), probe()]), zero)
}

/// The decoder of one round: sound parameters, any words, or nothing but NaN.
pub fn decoder_of<M: Model>(
    words: &mut Words,
    k: u32,
    probes: [M::Probe<f32>; 3],
    probe: Probe<M>,
) -> (Decoder<M>, PlanarPose<f32>) {
    match k % 3 {
        0 => (Decoder::new(SOUND, probes), PlanarPose::ZERO),
        1 => from_words(core::array::from_fn(|_| words.next()), probe),
        _ => from_words([f32::NAN.to_bits(); PARAMETER_WORDS], probe),
    }
}
