//! A population: its individuals, their costs, its best and its mean.

use super::cost::{CostFunction, Evaluator, best_index, ranks_before};
use super::random::{Phase, RandomSource, RandomStreams};
use super::run::Start;

/// Individuals and their costs. Individual k holds the numbers k d .. (k + 1) d.
#[derive(Clone, Debug, PartialEq)]
pub struct Population {
    dimensions: usize,
    individuals: Vec<f64>,
    costs: Vec<f64>,
}

impl Population {
    /// The first population (generation 0), evaluated: the individuals of `start`, clipped to
    /// the bounds, then uniform draws from the box, `start.population` in all and at least two.
    pub fn draw<F: CostFunction + ?Sized, S: RandomStreams>(
        evaluator: &mut Evaluator<'_, F>,
        streams: &S,
        start: &Start<'_>,
    ) -> Self {
        let bounds = evaluator.function.bounds();
        let dimensions = bounds.len();
        let size = start.population.max(2);
        let mut population = Self {
            dimensions,
            individuals: vec![0.0; dimensions * size],
            costs: vec![0.0; size],
        };
        let mut notes = vec![(); size];
        let Self {
            individuals, costs, ..
        } = &mut population;
        evaluator.breed(individuals, costs, &mut notes, |k, place| {
            if let Some(given) = start.individuals.get(k).filter(|x| x.len() == dimensions) {
                place.copy_from_slice(given);
            } else {
                let mut random = streams.stream(0, Phase::Start, k);
                random.fill_within(bounds, place);
            }
        });
        population
    }

    /// How many individuals there are.
    pub fn size(&self) -> usize {
        self.costs.len()
    }

    /// Unknowns of an individual.
    pub fn dimensions(&self) -> usize {
        self.dimensions
    }

    /// Individual k.
    #[inline(always)]
    pub fn individual(&self, k: usize) -> &[f64] {
        &self.individuals[k * self.dimensions..][..self.dimensions]
    }

    /// The cost of individual k.
    #[inline(always)]
    pub fn cost(&self, k: usize) -> f64 {
        self.costs[k]
    }

    /// All individuals, one after the other.
    pub fn places(&self) -> &[f64] {
        &self.individuals
    }

    /// The index of the best individual, the first of equals.
    pub fn best_index(&self) -> usize {
        best_index(&self.costs)
    }

    /// The best individual and its cost; NaN only when all are NaN.
    pub fn best(&self) -> (&[f64], f64) {
        let k = self.best_index();
        (self.individual(k), self.cost(k))
    }

    /// The mean of all individuals, summed in their order, written to `mean`.
    pub fn mean_into(&self, mean: &mut Vec<f64>) {
        mean.clear();
        mean.resize(self.dimensions, 0.0);
        if self.dimensions == 0 {
            return;
        }
        for individual in self.individuals.chunks_exact(self.dimensions) {
            for (sum, x) in mean.iter_mut().zip(individual) {
                *sum += x;
            }
        }
        let size = self.size() as f64;
        for sum in mean {
            *sum /= size;
        }
    }

    /// Replaces individual k by a candidate that ranks before it.
    fn improve(&mut self, k: usize, candidate: &[f64], cost: f64) {
        if ranks_before(cost, self.costs[k]) {
            self.replace(k, candidate, cost);
        }
    }

    /// Replaces each individual by its candidate where that ranks before it.
    pub fn improve_all<T>(&mut self, candidates: &Candidates<T>) {
        for (k, &cost) in candidates.costs.iter().enumerate() {
            self.improve(k, candidates.candidate(k), cost);
        }
    }

    /// Replaces individual k.
    pub fn replace(&mut self, k: usize, candidate: &[f64], cost: f64) {
        self.individuals[k * self.dimensions..][..self.dimensions].copy_from_slice(candidate);
        self.costs[k] = cost;
    }

    /// The index of the individual that ranks last, the last of equals.
    pub fn worst_index(&self) -> usize {
        let worse = |worst: usize, k: usize| {
            if ranks_before(self.costs[k], self.costs[worst]) {
                worst
            } else {
                k
            }
        };
        (0..self.size()).fold(0, worse)
    }
}

/// Room for one candidate of each individual.
#[derive(Clone, Debug)]
pub struct Candidates<T> {
    /// The candidates, one after the other.
    pub places: Vec<f64>,
    /// Their costs.
    pub costs: Vec<f64>,
    /// What was noted when each was made.
    pub notes: Vec<T>,
}

impl<T: Clone + Default> Candidates<T> {
    /// Room for as many as `population` has.
    pub fn for_population(population: &Population) -> Self {
        Self {
            places: vec![0.0; population.size() * population.dimensions()],
            costs: vec![0.0; population.size()],
            notes: vec![T::default(); population.size()],
        }
    }
}

impl<T> Candidates<T> {
    /// Candidate k.
    pub fn candidate(&self, k: usize) -> &[f64] {
        let dimensions = self.places.len() / self.costs.len().max(1);
        &self.places[k * dimensions..][..dimensions]
    }
}
