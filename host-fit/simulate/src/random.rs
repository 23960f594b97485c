//! Random numbers that are the same on every machine: ChaCha8, and libm for the logarithm and
//! the cosine of a normal number.

use rand::rngs::ChaCha8Rng;
use rand::{Rng, SeedableRng};
use std::f64::consts::TAU;

/// The purpose of a stream. Streams of one seed are independent of each other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u64)]
pub enum Purpose {
    /// The tolerances of a stage.
    Assembly = 1,
    /// The trajectories of a protocol.
    Motion = 2,
    /// Noise, drift and resets.
    Sensors = 3,
    /// The temperature coefficients of the parts, and the errors of the temperature sensors.
    Thermal = 4,
    /// The coils and arms of a stage.
    Dynamics = 5,
}

/// A stream of random numbers.
#[derive(Debug)]
pub struct Stream(ChaCha8Rng);

impl Stream {
    /// The stream of a seed for one purpose and one run of the stage.
    pub fn new(seed: u64, purpose: Purpose, run: u64) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(run << 8 | purpose as u64);
        Self(random)
    }

    /// A number in [0, 1), all equally likely: 53 bits of one word.
    pub fn uniform(&mut self) -> f64 {
        (self.0.next_u64() >> 11) as f64 * (1.0 / 9_007_199_254_740_992.0)
    }

    /// A number between `low` and `high`, all equally likely.
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.uniform()
    }

    /// A normal number of this standard deviation (Box and Muller).
    pub fn normal(&mut self, deviation: f64) -> f64 {
        let radius = libm::sqrt(-2.0 * libm::log(1.0 - self.uniform()));
        deviation * (radius * libm::cos(TAU * self.uniform()))
    }
}
