//! Random numbers of a search: each individual of each generation has a stream of its own.
//!
//! The stream's seed is a hash of the seed of the run, the generation, the phase and the individual.
//! So the draws of an individual do not depend on the others. The generator is xoshiro256++: it gives
//! the same words on every platform and in every version of the crate, and starts from a 64-bit seed in
//! a few ns. Nothing comes from the operating system.
//!
//! Normal numbers come from the ziggurat of Marsaglia and Tsang (2000), with logarithms and
//! exponentials from `libm`. (`rand_distr` uses the standard library, and its last digits differ
//! between systems.)

use hallstage_input::stage::Range;
use rand::rngs::Xoshiro256PlusPlus;
use rand::{Rng, SeedableRng};
use std::sync::LazyLock;

/// Where an operator takes its random numbers from. Tests script it.
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
    fn fill_normal(&mut self, numbers: &mut [f64]) {
        for number in numbers {
            *number = self.normal();
        }
    }
}

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
pub fn stream(seed: u64, generation: usize, phase: Phase, individual: usize) -> SeededSource {
    let step = mix((generation as u64) << 2 | phase as u64).wrapping_add(seed);
    let key = mix(mix(step).wrapping_add(individual as u64));
    SeededSource(Xoshiro256PlusPlus::seed_from_u64(key))
}

/// The finalizer of SplitMix64: a bijection where every output bit depends on every input bit.
const fn mix(mut word: u64) -> u64 {
    word = (word ^ (word >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    word = (word ^ (word >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    word ^ (word >> 31)
}

/// The stream that [`stream`] gives.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SeededSource(Xoshiro256PlusPlus);

/// 2^-53: the spacing of the uniform numbers.
const SPACING: f64 = 1.0 / 9_007_199_254_740_992.0;

/// Where the tail of the ziggurat begins, in standard deviations, for 128 layers.
const TAIL: f64 = 3.442_619_855_899;
/// Area of each layer under exp(-x^2 / 2).
const LAYER_AREA: f64 = 9.912_563_035_262_17e-3;

/// The right ends of the layers, from the lowest to the top at 0. The lowest layer includes the tail: its
/// end is the width of a rectangle with the same area.
static LAYERS: LazyLock<[f64; 129]> = LazyLock::new(|| {
    let mut ends = [0.0; 129];
    ends[0] = LAYER_AREA / density(TAIL);
    ends[1] = TAIL;
    for k in 2..128 {
        let height = LAYER_AREA / ends[k - 1] + density(ends[k - 1]);
        ends[k] = libm::sqrt(-2.0 * libm::log(height));
    }
    ends
});

/// exp(-x^2 / 2).
fn density(x: f64) -> f64 {
    libm::exp(-0.5 * x * x)
}

impl SeededSource {
    /// A number beyond [`TAIL`].
    #[cold]
    fn tail(&mut self) -> f64 {
        loop {
            let beyond = -libm::log(1.0 - self.uniform()) / TAIL;
            if -2.0 * libm::log(1.0 - self.uniform()) > beyond * beyond {
                return TAIL + beyond;
            }
        }
    }
}

impl RandomSource for SeededSource {
    #[inline]
    fn uniform(&mut self) -> f64 {
        (self.0.next_u64() >> 11) as f64 * SPACING
    }

    #[inline]
    fn normal(&mut self) -> f64 {
        let layers = &*LAYERS;
        loop {
            let word = self.0.next_u64();
            let layer = (word & 127) as usize;
            let side = (word >> 11) as f64 * (2.0 * SPACING) - 1.0;
            let x = side * layers[layer];
            if x.abs() < layers[layer + 1] {
                return x;
            }
            if layer == 0 {
                return self.tail().copysign(side);
            }
            let (low, high) = (density(layers[layer]), density(layers[layer + 1]));
            if low + self.uniform() * (high - low) < density(x) {
                return x;
            }
        }
    }
}

#[cfg(test)]
pub(crate) mod script {
    //! Random numbers from a list.
    use super::{Phase, RandomSource};
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

    /// The stream that gives the script of each (generation, phase, individual).
    pub fn scripted(
        scripts: Vec<((usize, Phase, usize), Script)>,
    ) -> impl Fn(usize, Phase, usize) -> Script + Sync {
        move |generation, phase, individual| {
            let key = (generation, phase, individual);
            let found = scripts.iter().find(|(k, _)| *k == key);
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

    #[test]
    fn uniform_numbers_have_the_moments_of_their_distribution() {
        let mut numbers = vec![0.0; 100_000];
        stream(1, 0, Phase::Start, 0).fill_uniform(&mut numbers);
        let moment = |power| numbers.iter().map(|x| x.powi(power)).sum::<f64>() * 1e-5;
        assert!((moment(1) - 0.5).abs() < 0.004 && (moment(2) - 1.0 / 3.0).abs() < 0.004);
    }

    /// A million numbers: the share below each of 81 places, and beyond the layers.
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

    #[test]
    fn an_index_is_below_its_count_even_at_the_end_of_the_range() {
        let mut source = script::Script::new(&[0.0, 0.34, 1.0 - SPACING], &[]);
        assert_eq!([0, 0, 0].map(|_: i32| source.index(3)), [0, 1, 2]);
        assert_eq!(script::Script::new(&[0.5], &[]).index(0), 0);
    }
}
