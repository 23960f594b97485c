//! The function to be minimized, and the ranking of its costs.

use hallstage_input::stage::Range;
use rayon::prelude::*;

/// Individuals that a thread evaluates at a time. To hand work to another thread takes 5 to 10 us, an
/// evaluation on a few hundred rows 2 to 3 us.
const PIECE: usize = 8;

/// A point of the box and its cost.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Individual {
    /// One number for each unknown.
    pub place: Vec<f64>,
    /// Its cost.
    pub cost: f64,
}

/// A cost over a box. NaN means that the cost could not be computed: it ranks worst.
pub trait CostFunction: Sync {
    /// The box, one interval for each unknown, in the unit of the unknown.
    fn bounds(&self) -> &[Range];

    /// The cost of one individual: one number for each unknown, inside the bounds.
    fn cost(&self, individual: &[f64]) -> f64;

    /// Writes the cost of each individual, on the threads of the current rayon pool.
    fn costs(&self, individuals: &mut [Individual]) {
        individuals.par_chunks_mut(PIECE).for_each(|piece| {
            for individual in piece {
                individual.cost = self.cost(&individual.place);
            }
        });
    }
}

/// Whether cost `a` ranks before cost `b`: smaller, or a number where `b` is NaN.
pub fn ranks_before(a: f64, b: f64) -> bool {
    a < b || (b.is_nan() && !a.is_nan())
}

/// Moves each number that lies outside its interval to the nearer end; NaN to the lower one.
pub fn clip(individual: &mut [f64], bounds: &[Range]) {
    for (x, range) in individual.iter_mut().zip(bounds) {
        // `max` of NaN and a number is the number.
        *x = x.max(range.low).min(range.high);
    }
}

#[cfg(test)]
pub(crate) mod known {
    //! Functions with a known minimum of 0.
    use super::{CostFunction, Range};

    /// A function over a cube.
    pub struct KnownFunction {
        bounds: Vec<Range>,
        function: fn(&[f64]) -> f64,
    }

    impl KnownFunction {
        pub fn new(dimensions: usize, low: f64, high: f64, function: fn(&[f64]) -> f64) -> Self {
            Self {
                bounds: vec![Range { low, high }; dimensions],
                function,
            }
        }
    }

    impl CostFunction for KnownFunction {
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
