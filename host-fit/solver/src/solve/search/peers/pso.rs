//! Particle swarm optimization, global best, with the constants of Clerc and Kennedy (2002).

use crate::solve::search::population::{Breeding, Individual, Parents, best_index, improve};
use crate::solve::search::random::RandomSource;
use hallstage_input::stage::Range;

/// Share of the velocity that is kept: the constriction factor for 2.05 + 2.05.
const INERTIA: f64 = 0.729_843_788;
/// Pull towards the particle's own best and towards the swarm's.
const PULL: f64 = 1.496_179_765;

/// A particle swarm. Particles start at rest; one that meets a bound loses its velocity along that
/// axis. The population holds the best position of each particle; the swarm's best is that of the
/// start of a generation.
#[derive(Clone, Debug, Default)]
pub struct Swarm {
    /// Place and velocity (per generation) of each particle; empty before the first generation.
    particles: Vec<(Vec<f64>, Vec<f64>)>,
    /// The particle with the best position of all.
    best: usize,
}

impl Breeding for Swarm {
    type Note = ();

    fn begin(&mut self, bests: &[Individual], bounds: &[Range]) {
        if self.particles.is_empty() {
            let at_rest = |best: &Individual| (best.place.clone(), vec![0.0; bounds.len()]);
            self.particles = bests.iter().map(at_rest).collect();
        }
        self.best = best_index(bests);
    }

    fn make(&self, parents: Parents<'_>, random: &mut impl RandomSource, new: &mut [f64]) {
        let own_best = &parents.population[parents.k].place;
        let swarm_best = &parents.population[self.best].place;
        let (place, velocity) = &self.particles[parents.k];
        for (i, new) in new.iter_mut().enumerate() {
            let x = place[i];
            let to_own = PULL * random.uniform() * (own_best[i] - x);
            let to_swarm = PULL * random.uniform() * (swarm_best[i] - x);
            *new = x + (INERTIA * velocity[i] + to_own + to_swarm);
        }
    }

    fn select(
        &mut self,
        bests: &mut [Individual],
        moved: &mut [Individual],
        _: &[()],
        bounds: &[Range],
    ) {
        for ((place, velocity), moved) in self.particles.iter_mut().zip(&*moved) {
            for (i, range) in bounds.iter().enumerate() {
                let x = moved.place[i];
                let at_bound = x <= range.low || x >= range.high;
                velocity[i] = if at_bound { 0.0 } else { x - place[i] };
                place[i] = x;
            }
        }
        improve(bests, moved);
    }
}
