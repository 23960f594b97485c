//! Random numbers of a search: each individual of each generation has a stream of its own.
//!
//! The stream's seed is a hash of the seed of the run, the generation, the phase and the individual.
//! So the draws of an individual do not depend on the others. The generator is xoshiro256++: it gives
//! the same words on every platform and in every version of the crate, and starts from a 64-bit seed in
//! a few ns. Nothing comes from the operating system.
//!
//! Normal numbers are made by Box and Muller with `libm`. (`rand_distr` uses the standard library, and its
//! last digits differ between systems.)

use hallstage_input::stage::Range;
use rand::rngs::Xoshiro256PlusPlus;
use rand::{Rng, SeedableRng};
use std::f64::consts::TAU;

/// The purpose of a stream within a generation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// The first population.
    Start,
    /// The teacher phase.
    Teacher,
    /// The learner phase.
    Learner,
}

/// The stream of one individual in one phase; generation 0 is the first population.
pub fn stream(seed: u64, generation: usize, phase: Phase, individual: usize) -> Stream {
    let step = mix((generation as u64) << 2 | phase as u64).wrapping_add(seed);
    let key = mix(mix(step).wrapping_add(individual as u64));
    Stream(Xoshiro256PlusPlus::seed_from_u64(key))
}

/// The finalizer of SplitMix64: a bijection where every output bit depends on every input bit.
const fn mix(mut word: u64) -> u64 {
    word = (word ^ (word >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    word = (word ^ (word >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    word ^ (word >> 31)
}

/// The stream that [`stream`] gives.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Stream(Xoshiro256PlusPlus);

impl Stream {
    /// A number in [0, 1), all equally likely: 53 bits of one word.
    #[inline]
    pub fn uniform(&mut self) -> f64 {
        (self.0.next_u64() >> 11) as f64 * (1.0 / 9_007_199_254_740_992.0)
    }

    /// A number of the standard normal distribution N(0, 1), from two uniform ones.
    #[inline]
    pub fn normal(&mut self) -> f64 {
        let radius = libm::sqrt(-2.0 * libm::log(1.0 - self.uniform()));
        radius * libm::cos(TAU * self.uniform())
    }

    /// An index below `count` (0 for none), from one uniform number.
    pub fn index(&mut self, count: usize) -> usize {
        let index = (self.uniform() * count as f64) as usize;
        index.min(count.saturating_sub(1))
    }

    /// Fills `numbers` with [`Stream::uniform`], one after the other.
    pub fn fill_uniform(&mut self, numbers: &mut [f64]) {
        numbers.fill_with(|| self.uniform());
    }

    /// Fills `place` with uniform numbers from a box, one for each interval.
    pub fn fill_within(&mut self, bounds: &[Range], place: &mut [f64]) {
        self.fill_uniform(place);
        for (x, range) in place.iter_mut().zip(bounds) {
            *x = range.low + *x * range.width();
        }
    }

    /// Fills `numbers` with [`Stream::normal`], one after the other.
    pub fn fill_normal(&mut self, numbers: &mut [f64]) {
        numbers.fill_with(|| self.normal());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn streams_differ_in_each_part_of_their_key() {
        let first = |seed, generation, phase, individual| {
            let mut source = stream(seed, generation, phase, individual);
            source.uniform().to_bits()
        };
        let mut seen = std::collections::BTreeSet::new();
        for seed in 0..4 {
            for generation in 0..10 {
                for phase in [Phase::Start, Phase::Teacher, Phase::Learner] {
                    for individual in 0..10 {
                        seen.insert(first(seed, generation, phase, individual));
                    }
                }
            }
        }
        assert_eq!(seen.len(), 4 * 10 * 3 * 10);
    }

    /// A million numbers: the share below each of 81 places.
    #[test]
    fn normal_numbers_follow_the_normal_distribution() {
        let mut source = stream(2, 0, Phase::Start, 0);
        let n = 1_000_000;
        let mut numbers = vec![0.0; n];
        source.fill_normal(&mut numbers);
        for place in -40..=40 {
            let x = f64::from(place) / 10.0;
            let expected = 0.5 * libm::erfc(-x / core::f64::consts::SQRT_2);
            let found = numbers.iter().filter(|number| **number < x).count() as f64 / n as f64;
            let deviation = (expected * (1.0 - expected) / n as f64).sqrt();
            assert!(
                (found - expected).abs() < 4.5 * deviation,
                "{x}: {found}, not {expected}"
            );
        }
    }
}
