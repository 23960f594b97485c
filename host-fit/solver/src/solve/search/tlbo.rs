//! Teaching-learning-based optimization and its relatives up to SHTLBO (equations 16-29).
//!
//! | search | teacher phase | learner phase | p |
//! |---|---|---|---|
//! | `tlbo` | 16, 17 | 18 | - |
//! | `gbtlbo` | 19 | 20 | - |
//! | `mutation` | 21 | 22 | - |
//! | `hybrid` | 23 | 24 | fixed |
//! | `success-ratio` | 23 | 24 | 25 |
//! | `shtlbo` | 23 | 24 | 27, 28, 29 |
//!
//! Choices that the paper leaves open:
//! - A phase works on the population as it was at the phase's start: teacher, mean and
//!   partners are those of that moment, and the better of old and new is kept at its end. So
//!   all candidates of a phase can be evaluated at once, on any number of threads.
//! - One `rand < p` for each individual and phase; T_F for each individual; r and N(0, 1) for
//!   each coordinate. An individual draws in this order: rand (hybrids only), the partner
//!   (learner phase only; any other individual, all equally likely), T_F, then r or N(0, 1).
//! - A candidate outside the bounds is clipped to them.
//! - The new student replaces the old one when its cost is lower, not when it is equal.
//! - p: see [`super::mixing`]. "LP > 100" is read as the end after Gm = 100 learning periods.
//!
//! The best student is never lost, so the last teacher is the result.

use super::cost::ranks_before;
use super::mixing::{Adaptation, P_START, Step, Tally};
use super::operators::{
    learn_from_partner, learn_from_teacher, mutate_about_self, scatter_about_middle,
    teaching_factor,
};
use super::population::{Breeding, Individual, Parents, best_index, improve};
use super::random::{Phase, RandomSource};
use hallstage_input::stage::Range;

/// A search by TLBO or one of its relatives.
#[derive(Clone, Debug)]
pub struct Tlbo {
    /// The step of every individual; hybrids have none and choose.
    step: Option<Step>,
    adaptation: Adaptation,
    learning_period: usize,
    teacher: usize,
    mean: Vec<f64>,
    p: f64,
    tally: Tally,
}

impl Tlbo {
    /// Every individual takes the same step: TLBO, GBTLBO, the mutation alone.
    pub fn pure(step: Step) -> Self {
        Self {
            step: Some(step),
            ..Self::hybrid(Adaptation::Fixed, 1)
        }
    }

    /// Individuals learn or mutate. p is updated every `learning_period` generations (the default of
    /// the program is 1).
    pub fn hybrid(adaptation: Adaptation, learning_period: usize) -> Self {
        Self {
            step: None,
            adaptation,
            learning_period: learning_period.max(1),
            teacher: 0,
            mean: Vec::new(),
            p: P_START,
            tally: Tally::default(),
        }
    }

    /// The step of one individual: equations 23, 24 and 26 for the hybrids.
    #[inline(always)]
    fn choose(&self, random: &mut impl RandomSource) -> Step {
        match self.step {
            Some(step) => step,
            None if random.uniform() < self.p => Step::Learn,
            None => Step::Mutate,
        }
    }

    /// The individual that a step looks at: the teacher, or a partner.
    #[inline(always)]
    fn other(&self, parents: &Parents<'_>, random: &mut impl RandomSource) -> usize {
        if parents.phase != Phase::Learner {
            return self.teacher;
        }
        let drawn = random.index(parents.population.len() - 1);
        if drawn < parents.k { drawn } else { drawn + 1 }
    }
}

impl Breeding for Tlbo {
    type Note = Step;

    const PHASES: &'static [Phase] = &[Phase::Teacher, Phase::Learner];

    /// The teacher, and the mean, summed in the order of the individuals.
    fn begin(&mut self, population: &[Individual], bounds: &[Range]) {
        self.teacher = best_index(population);
        self.mean.clear();
        self.mean.resize(bounds.len(), 0.0);
        for individual in population {
            for (sum, x) in self.mean.iter_mut().zip(&individual.place) {
                *sum += x;
            }
        }
        for sum in &mut self.mean {
            *sum /= population.len() as f64;
        }
    }

    /// Equations 16, 19, 21 in the teacher phase, 18, 20, 22 in the learner phase; `new` holds
    /// the random numbers on the way.
    #[inline(always)]
    fn make(&self, parents: Parents<'_>, random: &mut impl RandomSource, new: &mut [f64]) -> Step {
        let step = self.choose(random);
        let old = &parents.population[parents.k];
        let other = &parents.population[self.other(&parents, random)];
        match step {
            Step::Learn if parents.phase == Phase::Learner => {
                random.fill_uniform(new);
                let better = ranks_before(other.cost, old.cost);
                learn_from_partner(&old.place, &other.place, better, new);
            }
            Step::Learn => {
                let factor = teaching_factor(random.uniform());
                random.fill_uniform(new);
                learn_from_teacher(&old.place, &other.place, &self.mean, factor, new);
            }
            Step::Scatter => {
                random.fill_normal(new);
                scatter_about_middle(&old.place, &other.place, new);
            }
            Step::Mutate => {
                random.fill_normal(new);
                mutate_about_self(&old.place, &other.place, new);
            }
        }
        step
    }

    fn select(
        &mut self,
        population: &mut [Individual],
        students: &mut [Individual],
        steps: &[Step],
        _: &[Range],
    ) {
        for ((old, new), step) in population.iter().zip(&*students).zip(steps) {
            self.tally.count(*step, old.cost, new.cost);
        }
        improve(population, students);
    }

    fn end(&mut self, generation: usize) {
        if generation.is_multiple_of(self.learning_period) {
            self.p = self.tally.next_p(self.adaptation, self.p);
            self.tally = Tally::default();
        }
    }

    fn p(&self) -> Option<f64> {
        self.step.is_none().then_some(self.p)
    }
}

#[cfg(test)]
#[path = "tlbo_tests.rs"]
mod tests;
