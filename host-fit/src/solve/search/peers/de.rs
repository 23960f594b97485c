//! Differential evolution, DE/rand/1/bin (Storn and Price, 1997), with F = 0.5, CR = 0.9.

use crate::solve::search::cost::{CostFunction, Evaluator};
use crate::solve::search::population::{Candidates, Population};
use crate::solve::search::random::{Phase, RandomSource, RandomStreams};
use crate::solve::search::run::{Method, Start};

/// F: how much of the difference of two individuals is added to a third.
const WEIGHT: f64 = 0.5;
/// CR: the probability with which a coordinate is taken from the mutant.
const CROSSOVER: f64 = 0.9;

/// A search by differential evolution. Candidates of a generation are all made from the
/// population at its start.
pub struct Differential<S> {
    streams: S,
    population: Population,
    candidates: Candidates<()>,
}

impl<S: RandomStreams> Differential<S> {
    /// Draws and evaluates the first population, of at least four.
    pub fn new<F: CostFunction + ?Sized>(
        streams: S,
        evaluator: &mut Evaluator<'_, F>,
        start: &Start<'_>,
    ) -> Self {
        let start = Start {
            population: start.population.max(4),
            ..*start
        };
        let population = Population::draw(evaluator, &streams, &start);
        Self {
            candidates: Candidates::for_population(&population, ()),
            population,
            streams,
        }
    }
}

/// Three individuals that differ from `k` and from each other.
fn three_others(k: usize, size: usize, random: &mut impl RandomSource) -> [usize; 3] {
    let mut taken = [k; 4];
    for n in 1..4 {
        // The index among those not yet taken, then past each taken one that lies below.
        let mut index = random.index(size - n);
        let mut sorted = taken;
        sorted[..n].sort_unstable();
        for &below in &sorted[..n] {
            if index >= below {
                index += 1;
            }
        }
        taken[n] = index;
    }
    [taken[1], taken[2], taken[3]]
}

impl<S: RandomStreams, F: CostFunction + ?Sized> Method<F> for Differential<S> {
    fn generation(&mut self, number: usize, evaluator: &mut Evaluator<'_, F>) -> bool {
        let (population, streams) = (&self.population, &self.streams);
        let Candidates {
            places,
            costs,
            notes,
        } = &mut self.candidates;
        evaluator.breed(places, costs, notes, |k, place| {
            let mut random = streams.stream(number, Phase::Teacher, k);
            let chosen = three_others(k, population.size(), &mut random);
            let [base, plus, minus] = chosen.map(|k| population.individual(k));
            let old = population.individual(k);
            let always = random.index(place.len());
            for (i, x) in place.iter_mut().enumerate() {
                let crossed = random.uniform() < CROSSOVER || i == always;
                let mutant = base[i] + WEIGHT * (plus[i] - minus[i]);
                *x = if crossed { mutant } else { old[i] };
            }
        });
        for k in 0..self.population.size() {
            let cost = self.candidates.costs[k];
            self.population
                .improve(k, self.candidates.candidate(k), cost);
        }
        true
    }

    fn best(&self) -> (&[f64], f64) {
        self.population.best()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solve::search::random::script::Script;

    #[test]
    fn the_three_others_are_different_and_every_triple_can_come() {
        let mut seen = std::collections::BTreeSet::new();
        for a in 0..4 {
            for b in 0..3 {
                for c in 0..2 {
                    let draws = [
                        a as f64 / 4.0,
                        f64::from(b) / 3.0 + 1e-9,
                        f64::from(c) / 2.0,
                    ];
                    let triple = three_others(2, 5, &mut Script::new(&draws, &[]));
                    let [x, y, z] = triple;
                    assert!(
                        x != y && y != z && x != z && !triple.contains(&2),
                        "{triple:?}"
                    );
                    seen.insert(triple);
                }
            }
        }
        assert_eq!(seen.len(), 24);
    }
}
