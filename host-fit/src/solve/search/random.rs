//! Random numbers of a search: each individual of each generation has a stream of its own.
//!
//! The stream's seed is a hash of (seed of the run, generation, phase, individual), so what
//! an individual draws does not depend on who was worked on before it or on which thread.
//! The generator is xoshiro256++: its words are the same on every platform
//! and for every version of the crate, it starts from a 64-bit seed in a few ns, and it gives
//! the 192 numbers that a candidate needs in well under 1 us. Nothing comes from the operating system.

use super::normal::{normal_of, normals_of};
use crate::input::stage::Range;
use rand::rngs::Xoshiro256PlusPlus;
use rand::{Rng, SeedableRng};

/// What an operator draws from. Tests script it.
pub trait RandomSource {
    /// A number in [0, 1), all equally likely.
    fn uniform(&mut self) -> f64;

    /// A number of the standard normal distribution N(0, 1).
    fn normal(&mut self) -> f64;

    /// An index below `count` (0 for none), from one uniform number.
    fn index(&mut self, count: usize) -> usize {
        let index = (self.uniform() * count as f64) as usize;
        index.min(count.saturating_sub(1))
    }

    /// Fills `numbers` with [`RandomSource::uniform`], one after the other.
    #[inline(always)]
    fn fill_uniform(&mut self, numbers: &mut [f64]) {
        for number in numbers {
            *number = self.uniform();
        }
    }

    /// Fills `place` with uniform numbers from a box, one for each interval.
    fn fill_within(&mut self, bounds: &[Range], place: &mut [f64]) {
        self.fill_uniform(place);
        for (x, range) in place.iter_mut().zip(bounds) {
            *x = range.low + *x * range.width();
        }
    }

    /// Fills `numbers` with [`RandomSource::normal`], one after the other.
    #[inline(always)]
    fn fill_normal(&mut self, numbers: &mut [f64]) {
        for number in numbers {
            *number = self.normal();
        }
    }
}

/// Which draw of a generation a stream serves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// The first population.
    Start,
    /// The teacher phase; the only one of methods that have one phase.
    Teacher,
    /// The learner phase.
    Learner,
}

/// Gives every individual of every phase of every generation its own stream.
pub trait RandomStreams: Sync {
    /// What a stream is.
    type Source: RandomSource;
    /// The stream of one individual; generation 0 is the first population.
    fn stream(&self, generation: usize, phase: Phase, individual: usize) -> Self::Source;
}

/// Streams that follow from one seed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SeededStreams {
    seed: u64,
}

/// One stream of [`SeededStreams`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SeededSource(Xoshiro256PlusPlus);

impl SeededStreams {
    /// The streams of a seed; every seed is as good as any other.
    pub const fn new(seed: u64) -> Self {
        Self { seed }
    }
}

/// The finalizer of SplitMix64: a bijection whose every output bit depends on every input bit.
const fn mix(mut word: u64) -> u64 {
    word = (word ^ (word >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    word = (word ^ (word >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    word ^ (word >> 31)
}

impl RandomStreams for SeededStreams {
    type Source = SeededSource;

    #[inline(always)]
    fn stream(&self, generation: usize, phase: Phase, individual: usize) -> SeededSource {
        let step = mix((generation as u64) << 2 | phase as u64).wrapping_add(self.seed);
        let key = mix(mix(step).wrapping_add(individual as u64));
        SeededSource(Xoshiro256PlusPlus::seed_from_u64(key))
    }
}

/// 2^-53: the spacing of the uniform numbers.
const SPACING: f64 = 1.0 / 9_007_199_254_740_992.0;

impl SeededSource {
    /// A uniform number in the open interval (0, 1), in the middle of its spacing.
    #[inline(always)]
    fn open_uniform(&mut self) -> f64 {
        ((self.0.next_u64() >> 12) as f64 + 0.5) * (2.0 * SPACING)
    }
}

impl RandomSource for SeededSource {
    #[inline(always)]
    fn uniform(&mut self) -> f64 {
        (self.0.next_u64() >> 11) as f64 * SPACING
    }

    #[inline(always)]
    fn normal(&mut self) -> f64 {
        normal_of(self.open_uniform())
    }

    #[inline(always)]
    fn fill_normal(&mut self, numbers: &mut [f64]) {
        for number in &mut *numbers {
            *number = self.open_uniform();
        }
        normals_of(numbers);
    }
}

#[cfg(test)]
pub(crate) mod script {
    //! A random source that gives prepared numbers.
    use super::{Phase, RandomSource, RandomStreams};
    use std::collections::VecDeque;

    /// Gives the numbers of two lists, then panics.
    #[derive(Clone, Debug, Default)]
    pub struct Script {
        pub uniform: VecDeque<f64>,
        pub normal: VecDeque<f64>,
    }

    impl Script {
        pub fn new(uniform: &[f64], normal: &[f64]) -> Self {
            Self {
                uniform: uniform.iter().copied().collect(),
                normal: normal.iter().copied().collect(),
            }
        }
    }

    impl RandomSource for Script {
        fn uniform(&mut self) -> f64 {
            self.uniform.pop_front().expect("a scripted uniform number")
        }
        fn normal(&mut self) -> f64 {
            self.normal.pop_front().expect("a scripted normal number")
        }
    }

    /// The script of each (generation, phase, individual).
    pub struct Scripts(pub Vec<((usize, Phase, usize), Script)>);

    impl RandomStreams for Scripts {
        type Source = Script;
        fn stream(&self, generation: usize, phase: Phase, individual: usize) -> Script {
            let key = (generation, phase, individual);
            let found = self.0.iter().find(|(k, _)| *k == key);
            found.expect("a script for this individual").1.clone()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn streams_differ_in_each_part_of_their_key() {
        let first = |seed, generation, phase, individual| {
            SeededStreams::new(seed)
                .stream(generation, phase, individual)
                .uniform()
                .to_bits()
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

    #[test]
    fn numbers_have_the_moments_of_their_distribution() {
        let n = 100_000;
        let mut numbers = vec![0.0; n];
        let moments = |numbers: &[f64]| {
            let mean = numbers.iter().sum::<f64>() / n as f64;
            let variance = numbers.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / n as f64;
            (mean, variance)
        };
        let mut source = SeededStreams::new(1).stream(0, Phase::Start, 0);
        source.fill_uniform(&mut numbers);
        let (mean, variance) = moments(&numbers);
        assert!((mean - 0.5).abs() < 0.004 && (variance - 1.0 / 12.0).abs() < 0.002);
        source.fill_normal(&mut numbers);
        let (mean, variance) = moments(&numbers);
        assert!(mean.abs() < 0.013 && (variance - 1.0).abs() < 0.02);
        let beyond_three = numbers.iter().filter(|x| x.abs() > 3.0).count();
        assert!((220..320).contains(&beyond_three), "{beyond_three} of 270");
    }

    #[test]
    fn an_index_is_below_its_count_even_at_the_end_of_the_range() {
        let mut source = script::Script::new(&[0.0, 0.34, 1.0 - SPACING], &[]);
        assert_eq!([0, 0, 0].map(|_: i32| source.index(3)), [0, 1, 2]);
        assert_eq!(script::Script::new(&[0.5], &[]).index(0), 0);
    }
}
