//! Particle swarm optimization, global best, with the constants of Clerc and Kennedy (2002).

use crate::input::stage::Range;
use crate::solve::search::breeding::{Breeding, Parents};
use crate::solve::search::population::{Candidates, Population};
use crate::solve::search::random::RandomSource;

/// Share of the velocity that is kept: the constriction factor for 2.05 + 2.05.
const INERTIA: f64 = 0.729_843_788;
/// Pull towards the particle's own best and towards the swarm's.
const PULL: f64 = 1.496_179_765;

/// A particle swarm. Particles start at rest; one that meets a bound loses its velocity along that
/// axis. The population holds the best position of each particle; the swarm's best is that of the
/// start of a generation.
#[derive(Clone, Debug, Default)]
pub struct Swarm {
    /// Where each particle is; empty before the first generation.
    positions: Vec<f64>,
    /// Velocity of each particle, per generation.
    velocities: Vec<f64>,
    /// The particle with the best position of all.
    best: usize,
}

impl Breeding for Swarm {
    type Note = ();

    fn begin(&mut self, bests: &Population) {
        if self.positions.is_empty() {
            self.positions = bests.places().to_vec();
            self.velocities = vec![0.0; self.positions.len()];
        }
        self.best = bests.best_index();
    }

    fn make(&self, parents: Parents<'_>, random: &mut impl RandomSource, new: &mut [f64]) {
        let own_best = parents.population.individual(parents.k);
        let swarm_best = parents.population.individual(self.best);
        let particle = parents.k * new.len();
        let position = &self.positions[particle..][..new.len()];
        let velocity = &self.velocities[particle..][..new.len()];
        for (i, new) in new.iter_mut().enumerate() {
            let x = position[i];
            let to_own = PULL * random.uniform() * (own_best[i] - x);
            let to_swarm = PULL * random.uniform() * (swarm_best[i] - x);
            *new = x + (INERTIA * velocity[i] + to_own + to_swarm);
        }
    }

    fn select(&mut self, bests: &mut Population, moved: &Candidates<()>, bounds: &[Range]) {
        let places = moved.places.iter().zip(&self.positions);
        let along = places.zip(bounds.iter().cycle());
        for (velocity, ((x, before), range)) in self.velocities.iter_mut().zip(along) {
            let at_bound = *x <= range.low || *x >= range.high;
            *velocity = if at_bound { 0.0 } else { x - before };
        }
        self.positions.copy_from_slice(&moved.places);
        bests.improve_all(moved);
    }
}
