//! What all searches with a population share.
//!
//! A generation has one phase or two. In a phase every individual gets one candidate, made from
//! the population as it was at the start of the phase; all are evaluated together, on any number
//! of threads; then the search says which of them stay.

use super::cost::{CostFunction, Evaluator};
use super::population::{Candidates, Population};
use super::random::{Phase, RandomSource, RandomStreams};
use super::run::{Method, Start};
use crate::input::stage::Range;

/// What a candidate is made from.
#[derive(Clone, Copy, Debug)]
pub struct Parents<'p> {
    /// The population at the start of the phase.
    pub population: &'p Population,
    /// The box.
    pub bounds: &'p [Range],
    /// The phase.
    pub phase: Phase,
    /// Whose candidate it is: the index of an individual.
    pub k: usize,
}

/// How one search makes candidates and which of them it keeps.
pub trait Breeding: Sync {
    /// What is noted of a candidate when it is made.
    type Note: Clone + Default + Send;

    /// The smallest population that the search can work with.
    const SIZE_MIN: usize = 2;

    /// The phases of a generation.
    const PHASES: &'static [Phase] = &[Phase::Teacher];

    /// Looks at the population before a phase.
    fn begin(&mut self, _population: &Population) {}

    /// Writes a candidate into `new`, whose content does not matter; it is clipped afterwards.
    fn make(
        &self,
        parents: Parents<'_>,
        random: &mut impl RandomSource,
        new: &mut [f64],
    ) -> Self::Note;

    /// Takes over the evaluated candidates: as a rule each one that is better than its individual.
    fn select(
        &mut self,
        population: &mut Population,
        candidates: &Candidates<Self::Note>,
        _bounds: &[Range],
    ) {
        population.improve_all(candidates);
    }

    /// Learns from a whole generation; they are numbered from 1.
    fn end(&mut self, _generation: usize) {}

    /// p, if the search has one.
    fn p(&self) -> Option<f64> {
        None
    }
}

/// A population that is bred.
pub struct PopulationSearch<S, B: Breeding> {
    streams: S,
    breeding: B,
    population: Population,
    candidates: Candidates<B::Note>,
}

impl<S: RandomStreams, B: Breeding> PopulationSearch<S, B> {
    /// Draws and evaluates the first population.
    pub fn new<F: CostFunction + ?Sized>(
        breeding: B,
        streams: S,
        evaluator: &mut Evaluator<'_, F>,
        start: &Start<'_>,
    ) -> Self {
        let start = Start {
            population: start.population.max(B::SIZE_MIN),
            ..*start
        };
        let population = Population::draw(evaluator, &streams, &start);
        Self {
            candidates: Candidates::for_population(&population),
            streams,
            breeding,
            population,
        }
    }

    /// The population.
    #[cfg(test)]
    pub(super) fn population(&self) -> &Population {
        &self.population
    }
}

impl<S: RandomStreams, B: Breeding, F: CostFunction + ?Sized> Method<F> for PopulationSearch<S, B> {
    fn generation(&mut self, number: usize, evaluator: &mut Evaluator<'_, F>) -> bool {
        let bounds = evaluator.function.bounds();
        for &phase in B::PHASES {
            self.breeding.begin(&self.population);
            let (breeding, population, streams) = (&self.breeding, &self.population, &self.streams);
            let Candidates {
                places,
                costs,
                notes,
            } = &mut self.candidates;
            evaluator.breed(
                places,
                costs,
                notes,
                #[inline(always)]
                |k, new| {
                    let parents = Parents {
                        population,
                        bounds,
                        phase,
                        k,
                    };
                    breeding.make(parents, &mut streams.stream(number, phase, k), new)
                },
            );
            self.breeding
                .select(&mut self.population, &self.candidates, bounds);
        }
        self.breeding.end(number);
        true
    }

    fn best(&self) -> (&[f64], f64) {
        self.population.best()
    }

    fn p(&self) -> Option<f64> {
        self.breeding.p()
    }
}
