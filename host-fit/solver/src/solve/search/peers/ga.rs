//! A real-coded genetic algorithm after the breeder GA (Mühlenbein and Schlierkamp-Voosen,
//! 1993): tournament of two, extended intermediate crossover, mutation on all scales, and the
//! best individual always survives.

use crate::solve::search::cost::ranks_before;
use crate::solve::search::population::{Breeding, Individual, Parents, best_index};
use crate::solve::search::random::RandomSource;
use hallstage_input::stage::Range;

/// A child lies between its parents or up to this share of their distance beyond.
const EXTENSION: f64 = 0.25;
/// Largest mutation, as a share of the range.
const MUTATION: f64 = 0.1;
/// Mutations are smaller than that by 2^-0 to 2^-15.
const SCALES: usize = 16;

/// A search by the genetic algorithm: every generation replaces all but the best individual.
#[derive(Clone, Copy, Debug)]
pub struct Genetic;

/// The better of two individuals drawn at random.
fn tournament<'p>(population: &'p [Individual], random: &mut impl RandomSource) -> &'p [f64] {
    let [a, b] = [(); 2].map(|()| &population[random.index(population.len())]);
    let better = ranks_before(b.cost, a.cost);
    &(if better { b } else { a }).place
}

impl Breeding for Genetic {
    type Note = ();

    fn make(&self, parents: Parents<'_>, random: &mut impl RandomSource, new: &mut [f64]) {
        let mother = tournament(parents.population, random);
        let father = tournament(parents.population, random);
        let rate = 1.0 / new.len() as f64;
        for (i, x) in new.iter_mut().enumerate() {
            let share = (1.0 + 2.0 * EXTENSION) * random.uniform() - EXTENSION;
            *x = mother[i] + share * (father[i] - mother[i]);
            if random.uniform() < rate {
                let scale = (1u64 << random.index(SCALES)) as f64;
                let sign = if random.uniform() < 0.5 { -1.0 } else { 1.0 };
                *x += sign * MUTATION * parents.bounds[i].width() / scale;
            }
        }
    }

    /// The best of old and new takes the place of the worst child, unless it is a child.
    fn select(
        &mut self,
        population: &mut [Individual],
        children: &mut [Individual],
        _: &[()],
        _: &[Range],
    ) {
        let best = population[best_index(population)].clone();
        population.swap_with_slice(children);
        if ranks_before(best.cost, population[best_index(population)].cost) {
            let worse = |worst: usize, k: usize| {
                let better = ranks_before(population[k].cost, population[worst].cost);
                if better { worst } else { k }
            };
            let worst = (0..population.len()).fold(0, worse);
            population[worst] = best;
        }
    }
}
