//! A real-coded genetic algorithm after the breeder GA (Mühlenbein and Schlierkamp-Voosen,
//! 1993): tournament of two, extended intermediate crossover, mutation on all scales, and the
//! best individual always survives.

use crate::solve::search::cost::{CostFunction, Evaluator, ranks_before};
use crate::solve::search::population::{Candidates, Population};
use crate::solve::search::random::{Phase, RandomSource, RandomStreams};
use crate::solve::search::run::{Method, Start};

/// A child lies between its parents or up to this share of their distance beyond.
const EXTENSION: f64 = 0.25;
/// Largest mutation, as a share of the range.
const MUTATION: f64 = 0.1;
/// Mutations are smaller than that by 2^-0 to 2^-15.
const SCALES: usize = 16;

/// A search by the genetic algorithm: every generation replaces the whole population but for
/// its best.
pub struct Genetic<S> {
    streams: S,
    population: Population,
    candidates: Candidates<()>,
}

impl<S: RandomStreams> Genetic<S> {
    /// Draws and evaluates the first population.
    pub fn new<F: CostFunction + ?Sized>(
        streams: S,
        evaluator: &mut Evaluator<'_, F>,
        start: &Start<'_>,
    ) -> Self {
        let population = Population::draw(evaluator, &streams, start);
        Self {
            candidates: Candidates::for_population(&population, ()),
            population,
            streams,
        }
    }
}

/// The better of two individuals drawn at random.
fn tournament<'p>(population: &'p Population, random: &mut impl RandomSource) -> &'p [f64] {
    let [a, b] = [(); 2].map(|()| random.index(population.size()));
    let better = ranks_before(population.cost(b), population.cost(a));
    population.individual(if better { b } else { a })
}

impl<S: RandomStreams, F: CostFunction + ?Sized> Method<F> for Genetic<S> {
    fn generation(&mut self, number: usize, evaluator: &mut Evaluator<'_, F>) -> bool {
        let bounds = evaluator.function.bounds();
        let (population, streams) = (&self.population, &self.streams);
        let Candidates {
            places,
            costs,
            notes,
        } = &mut self.candidates;
        evaluator.breed(places, costs, notes, |k, place| {
            let mut random = streams.stream(number, Phase::Teacher, k);
            let mother = tournament(population, &mut random);
            let father = tournament(population, &mut random);
            let rate = 1.0 / place.len() as f64;
            for (i, x) in place.iter_mut().enumerate() {
                let share = (1.0 + 2.0 * EXTENSION) * random.uniform() - EXTENSION;
                *x = mother[i] + share * (father[i] - mother[i]);
                if random.uniform() < rate {
                    let scale = (1u64 << random.index(SCALES)) as f64;
                    let sign = if random.uniform() < 0.5 { -1.0 } else { 1.0 };
                    *x += sign * MUTATION * bounds[i].width() / scale;
                }
            }
        });
        let (best, cost) = self.population.best();
        let best = best.to_vec();
        for k in 0..self.population.size() {
            let child = self.candidates.candidate(k);
            self.population.replace(k, child, self.candidates.costs[k]);
        }
        if ranks_before(cost, self.population.best().1) {
            self.population
                .replace(self.population.worst_index(), &best, cost);
        }
        true
    }

    fn best(&self) -> (&[f64], f64) {
        self.population.best()
    }
}
