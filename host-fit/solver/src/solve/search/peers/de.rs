//! Differential evolution, DE/rand/1/bin (Storn and Price, 1997), with F = 0.5, CR = 0.9.

use crate::solve::search::population::{Breeding, Parents};
use crate::solve::search::random::RandomSource;

/// F: how much of the difference of two individuals is added to a third.
const WEIGHT: f64 = 0.5;
/// CR: the probability with which a coordinate is taken from the mutant.
const CROSSOVER: f64 = 0.9;

/// A search by differential evolution.
#[derive(Clone, Copy, Debug)]
pub struct Differential;

impl Breeding for Differential {
    type Note = ();

    /// Three others for each individual.
    const SIZE_MIN: usize = 4;

    fn make(&self, parents: Parents<'_>, random: &mut impl RandomSource, new: &mut [f64]) {
        let Parents { population, k, .. } = parents;
        let chosen = three_others(k, population.len(), random);
        let [base, plus, minus] = chosen.map(|k| &population[k].place);
        let old = &population[k].place;
        let always = random.index(new.len());
        for (i, x) in new.iter_mut().enumerate() {
            let crossed = random.uniform() < CROSSOVER || i == always;
            let mutant = base[i] + WEIGHT * (plus[i] - minus[i]);
            *x = if crossed { mutant } else { old[i] };
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
