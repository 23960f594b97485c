//! The function to be minimized.

use super::population::Individual;
use hallstage_input::stage::Range;

/// Individuals that a thread takes at a time: handing work to another thread and waiting for it takes
/// 5 to 10 us here, an evaluation on a few hundred rows 2 to 3.
const PIECE: usize = 8;

/// A cost over a box. NaN means that the cost could not be computed: it ranks worst.
pub trait CostFunction: Sync {
    /// The box, one interval for each unknown, in the unit of the unknown.
    fn bounds(&self) -> &[Range];

    /// The cost of one individual: one number for each unknown, inside the bounds.
    fn cost(&self, individual: &[f64]) -> f64;

    /// Writes the cost of each individual: for functions that take many at once.
    fn costs(&self, individuals: &mut [Individual]) {
        for individual in individuals {
            individual.cost = self.cost(&individual.place);
        }
    }

    /// How many individuals [`Self::costs`] gets at most. Several such pieces are on several threads;
    /// a population that is one piece stays on the thread of the caller.
    fn piece(&self) -> usize {
        PIECE
    }
}

/// Whether cost `a` ranks before cost `b`: smaller, or a number where `b` is NaN.
#[inline(always)]
pub fn ranks_before(a: f64, b: f64) -> bool {
    a < b || (b.is_nan() && !a.is_nan())
}

/// Moves each number that lies outside its interval to the nearer end; NaN to the lower one.
#[inline(always)]
pub fn clip(individual: &mut [f64], bounds: &[Range]) {
    for (x, range) in individual.iter_mut().zip(bounds) {
        let not_low = if *x > range.low { *x } else { range.low };
        *x = if not_low < range.high {
            not_low
        } else {
            range.high
        };
    }
}

#[cfg(test)]
pub(crate) mod known {
    //! Functions with a known minimum of 0.
    use super::{CostFunction, Range};

    /// A function over a cube.
    pub struct Known {
        bounds: Vec<Range>,
        function: fn(&[f64]) -> f64,
    }

    impl Known {
        pub fn new(dimensions: usize, low: f64, high: f64, function: fn(&[f64]) -> f64) -> Self {
            Self {
                bounds: vec![Range { low, high }; dimensions],
                function,
            }
        }
    }

    impl CostFunction for Known {
        fn bounds(&self) -> &[Range] {
            &self.bounds
        }
        fn cost(&self, x: &[f64]) -> f64 {
            (self.function)(x)
        }
    }

    pub fn sphere(x: &[f64]) -> f64 {
        x.iter().map(|x| (x - 1.0) * (x - 1.0)).sum()
    }

    pub fn rosenbrock(x: &[f64]) -> f64 {
        let term = |w: &[f64]| 100.0 * (w[1] - w[0] * w[0]).powi(2) + (1.0 - w[0]).powi(2);
        x.windows(2).map(term).sum()
    }

    pub fn rastrigin(x: &[f64]) -> f64 {
        let term =
            |x: &f64| 10.0 + (x - 0.7).powi(2) - 10.0 * (core::f64::consts::TAU * (x - 0.7)).cos();
        x.iter().map(term).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nan_ranks_after_everything_even_infinity() {
        assert!(ranks_before(1.0, 2.0) && !ranks_before(2.0, 2.0));
        assert!(ranks_before(f64::INFINITY, f64::NAN) && !ranks_before(f64::NAN, f64::INFINITY));
        assert!(!ranks_before(f64::NAN, f64::NAN));
    }

    #[test]
    fn clipping_moves_only_what_lies_outside() {
        let bounds = [Range {
            low: -1.0,
            high: 2.0,
        }; 5];
        let mut x = [-1.5, 0.5, 2.5, f64::INFINITY, f64::NAN];
        clip(&mut x, &bounds);
        assert_eq!(x, [-1.0, 0.5, 2.0, 2.0, -1.0]);
    }
}
