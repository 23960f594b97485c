//! Random search: uniform draws from the box. Whatever does not beat it is no search.

use crate::solve::search::cost::{CostFunction, Evaluator, best_index, ranks_before};
use crate::solve::search::population::{Candidates, Population};
use crate::solve::search::random::{Phase, RandomSource, RandomStreams};
use crate::solve::search::run::{Method, Start};

/// Keeps the best of all draws; a generation is one population of draws.
pub struct RandomSearch<S> {
    streams: S,
    candidates: Candidates<()>,
    best: Vec<f64>,
    cost: f64,
}

impl<S: RandomStreams> RandomSearch<S> {
    /// Draws and evaluates the first population.
    pub fn new<F: CostFunction + ?Sized>(
        streams: S,
        evaluator: &mut Evaluator<'_, F>,
        start: &Start<'_>,
    ) -> Self {
        let population = Population::draw(evaluator, &streams, start);
        let (best, cost) = population.best();
        Self {
            best: best.to_vec(),
            cost,
            candidates: Candidates::for_population(&population, ()),
            streams,
        }
    }
}

impl<S: RandomStreams, F: CostFunction + ?Sized> Method<F> for RandomSearch<S> {
    fn generation(&mut self, number: usize, evaluator: &mut Evaluator<'_, F>) -> bool {
        let bounds = evaluator.function.bounds();
        let streams = &self.streams;
        let Candidates {
            places,
            costs,
            notes,
        } = &mut self.candidates;
        evaluator.breed(places, costs, notes, |k, place| {
            streams
                .stream(number, Phase::Teacher, k)
                .fill_uniform(place);
            for (x, range) in place.iter_mut().zip(bounds) {
                *x = range.low + *x * range.width();
            }
        });
        let k = best_index(&self.candidates.costs);
        if ranks_before(self.candidates.costs[k], self.cost) {
            self.cost = self.candidates.costs[k];
            self.best.copy_from_slice(self.candidates.candidate(k));
        }
        true
    }

    fn best(&self) -> (&[f64], f64) {
        (&self.best, self.cost)
    }
}
