//! The function to be minimized, and how whole populations of candidates are evaluated.

use crate::input::stage::Range;
use rayon::prelude::*;

/// Individuals that are bred and evaluated together: a multiple of the SIMD lanes.
const BLOCK: usize = 16;

/// Work in one batch, in ns, from which a second thread pays: handing a batch of blocks to
/// threads and waiting for them takes 5 to 10 us here.
const PARALLEL_PAYS_NS: f64 = 60_000.0;

/// A cost over a box. NaN means that the cost could not be computed: it ranks worst.
pub trait CostFunction: Sync {
    /// The box, one interval for each unknown, in the unit of the unknown.
    fn bounds(&self) -> &[Range];

    /// The cost of one individual: one number for each unknown, inside the bounds.
    fn cost(&self, individual: &[f64]) -> f64;

    /// The costs of several individuals, one after the other in `individuals`: the same bits
    /// as [`CostFunction::cost`] of each. Functions that can, work on several at once.
    fn costs(&self, individuals: &[f64], costs: &mut [f64]) {
        let each = individuals.chunks_exact(self.bounds().len().max(1));
        for (individual, cost) in each.zip(costs) {
            *cost = self.cost(individual);
        }
    }

    /// About how long one evaluation takes, ns. It decides only whether threads pay.
    fn evaluation_ns(&self) -> f64 {
        100.0
    }
}

/// Whether cost `a` ranks before cost `b`: smaller, or a number where `b` is NaN.
#[inline(always)]
pub fn ranks_before(a: f64, b: f64) -> bool {
    a < b || (b.is_nan() && !a.is_nan())
}

/// The index of the best cost, the first of equals; 0 when there is none.
pub fn best_index(costs: &[f64]) -> usize {
    let mut best = 0;
    for (k, &cost) in costs.iter().enumerate() {
        if ranks_before(cost, costs[best]) {
            best = k;
        }
    }
    best
}

/// Evaluates populations and counts.
pub struct Evaluator<'f, F: ?Sized> {
    /// The function.
    pub function: &'f F,
    /// Evaluations so far.
    pub evaluations: usize,
    /// How many of them gave NaN.
    pub nan_costs: usize,
}

impl<'f, F: CostFunction + ?Sized> Evaluator<'f, F> {
    /// An evaluator that has evaluated nothing.
    pub const fn new(function: &'f F) -> Self {
        Self {
            function,
            evaluations: 0,
            nan_costs: 0,
        }
    }

    /// Makes and evaluates candidates: `make(k, place)` writes candidate k into its place and
    /// says something of it, which comes back in `notes`; the candidate is then clipped to the
    /// bounds and evaluated. Blocks of candidates run on the threads of the current rayon
    /// pool where that pays; the outcome is the same on any number of threads.
    pub fn breed<T: Send>(
        &mut self,
        candidates: &mut [f64],
        costs: &mut [f64],
        notes: &mut [T],
        make: impl Fn(usize, &mut [f64]) -> T + Sync,
    ) {
        let function = self.function;
        let dimensions = function.bounds().len().max(1);
        let work_ns = costs.len() as f64 * function.evaluation_ns();
        if work_ns > PARALLEL_PAYS_NS && rayon::current_num_threads() > 1 {
            candidates
                .par_chunks_mut(BLOCK * dimensions)
                .zip(costs.par_chunks_mut(BLOCK))
                .zip(notes.par_chunks_mut(BLOCK))
                .enumerate()
                .for_each(|(block, ((places, costs), notes))| {
                    breed_block(function, block * BLOCK, places, costs, notes, &make);
                });
        } else {
            candidates
                .chunks_mut(BLOCK * dimensions)
                .zip(costs.chunks_mut(BLOCK))
                .zip(notes.chunks_mut(BLOCK))
                .enumerate()
                .for_each(|(block, ((places, costs), notes))| {
                    breed_block(function, block * BLOCK, places, costs, notes, &make);
                });
        }
        self.evaluations += costs.len();
        self.nan_costs += costs.iter().filter(|cost| cost.is_nan()).count();
    }
}

/// Makes, clips and evaluates one block of candidates, numbered from `first`.
fn breed_block<F: CostFunction + ?Sized, T>(
    function: &F,
    first: usize,
    places: &mut [f64],
    costs: &mut [f64],
    notes: &mut [T],
    make: &impl Fn(usize, &mut [f64]) -> T,
) {
    pulp::Arch::new().dispatch(MakeBlock {
        bounds: function.bounds(),
        first,
        places,
        notes,
        make,
    });
    function.costs(places, costs);
}

/// The loop over a block, compiled for each instruction set with `make` inlined; the
/// arithmetic is the same on all. A type, since closures are not always inlined.
struct MakeBlock<'a, T, M> {
    bounds: &'a [Range],
    first: usize,
    places: &'a mut [f64],
    notes: &'a mut [T],
    make: &'a M,
}

impl<T, M: Fn(usize, &mut [f64]) -> T> pulp::WithSimd for MakeBlock<'_, T, M> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let each = self.places.chunks_exact_mut(self.bounds.len().max(1));
        for (k, (place, note)) in each.zip(self.notes).enumerate() {
            *note = (self.make)(self.first + k, place);
            clip(place, self.bounds);
        }
    }
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
        /// Claimed time of an evaluation, ns: large ones make threads pay.
        pub evaluation_ns: f64,
    }

    impl Known {
        pub fn new(dimensions: usize, low: f64, high: f64, function: fn(&[f64]) -> f64) -> Self {
            Self {
                bounds: vec![Range { low, high }; dimensions],
                function,
                evaluation_ns: 10.0,
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
        fn evaluation_ns(&self) -> f64 {
            self.evaluation_ns
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
        assert_eq!(best_index(&[f64::NAN, 3.0, 1.0, 1.0]), 2);
        assert_eq!(best_index(&[f64::NAN, f64::NAN]), 0);
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

    #[test]
    fn every_evaluation_and_every_nan_is_counted() {
        let function = known::Known::new(2, 0.0, 1.0, |x| if x[0] > 0.5 { f64::NAN } else { x[0] });
        let mut evaluator = Evaluator::new(&function);
        let (mut places, mut costs, mut notes) = (vec![0.0; 80], vec![0.0; 40], vec![0; 40]);
        evaluator.breed(&mut places, &mut costs, &mut notes, |k, place| {
            place[0] = k as f64 / 40.0;
            k
        });
        assert_eq!((evaluator.evaluations, evaluator.nan_costs), (40, 19));
        assert_eq!(notes, (0..40).collect::<Vec<_>>());
        assert!(costs[20] == 0.5 && costs[21].is_nan());
    }
}
