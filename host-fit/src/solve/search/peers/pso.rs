//! Particle swarm optimization, global best, with the constants of Clerc and Kennedy (2002).

use crate::solve::search::cost::{CostFunction, Evaluator};
use crate::solve::search::population::{Candidates, Population};
use crate::solve::search::random::{Phase, RandomSource, RandomStreams};
use crate::solve::search::run::{Method, Start};

/// Share of the velocity that is kept: the constriction factor for 2.05 + 2.05.
const INERTIA: f64 = 0.729_843_788;
/// Pull towards the particle's own best and towards the swarm's.
const PULL: f64 = 1.496_179_765;

/// A particle swarm. Particles start at rest; one that meets a bound loses its velocity
/// along that axis. The swarm's best is that of the start of a generation.
pub struct Swarm<S> {
    streams: S,
    /// The best position of each particle.
    bests: Population,
    /// Where each particle is.
    particles: Candidates<()>,
    /// Where each particle was before.
    previous: Vec<f64>,
    /// Velocity of each particle, per generation.
    velocities: Vec<f64>,
}

impl<S: RandomStreams> Swarm<S> {
    /// Draws and evaluates the first positions.
    pub fn new<F: CostFunction + ?Sized>(
        streams: S,
        evaluator: &mut Evaluator<'_, F>,
        start: &Start<'_>,
    ) -> Self {
        let bests = Population::draw(evaluator, &streams, start);
        let mut particles = Candidates::for_population(&bests, ());
        for k in 0..bests.size() {
            let place = k * bests.dimensions();
            particles.places[place..][..bests.dimensions()].copy_from_slice(bests.individual(k));
        }
        Self {
            previous: particles.places.clone(),
            velocities: vec![0.0; particles.places.len()],
            streams,
            bests,
            particles,
        }
    }
}

impl<S: RandomStreams, F: CostFunction + ?Sized> Method<F> for Swarm<S> {
    fn generation(&mut self, number: usize, evaluator: &mut Evaluator<'_, F>) -> bool {
        let dimensions = self.bests.dimensions();
        let swarm_best = self.bests.best().0;
        let (streams, bests, velocities) = (&self.streams, &self.bests, &self.velocities);
        let Candidates {
            places,
            costs,
            notes,
        } = &mut self.particles;
        self.previous.copy_from_slice(places);
        evaluator.breed(places, costs, notes, |k, place| {
            let mut random = streams.stream(number, Phase::Teacher, k);
            let velocity = &velocities[k * dimensions..][..dimensions];
            let own_best = bests.individual(k);
            for (i, x) in place.iter_mut().enumerate() {
                let to_own = PULL * random.uniform() * (own_best[i] - *x);
                let to_swarm = PULL * random.uniform() * (swarm_best[i] - *x);
                *x += INERTIA * velocity[i] + to_own + to_swarm;
            }
        });
        let bounds = evaluator.function.bounds().iter().cycle();
        let moved = self.particles.places.iter().zip(&self.previous).zip(bounds);
        for (velocity, ((x, before), range)) in self.velocities.iter_mut().zip(moved) {
            let at_bound = *x <= range.low || *x >= range.high;
            *velocity = if at_bound { 0.0 } else { x - before };
        }
        for k in 0..self.bests.size() {
            self.bests
                .improve(k, self.particles.candidate(k), self.particles.costs[k]);
        }
        true
    }

    fn best(&self) -> (&[f64], f64) {
        self.bests.best()
    }
}
