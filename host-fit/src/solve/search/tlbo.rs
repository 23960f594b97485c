//! Teaching-learning-based optimization and its relatives up to SHTLBO (equations 16-29).
//!
//! | variant | teacher phase | learner phase | p |
//! |---|---|---|---|
//! | [`Variant::Tlbo`] | 16, 17 | 18 | - |
//! | [`Variant::Gbtlbo`] | 19 | 20 | - |
//! | [`Variant::Mutation`] | 21 | 22 | - |
//! | [`Variant::Hybrid`] | 23 | 24 | fixed |
//! | [`Variant::SuccessRatio`] | 23 | 24 | 25 |
//! | [`Variant::Shtlbo`] | 23 | 24 | 27, 28, 29 |
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

use super::breeding::{Breeding, Parents};
use super::cost::ranks_before;
use super::mixing::{Adaptation, Kind, P_START, Tally};
use super::operators::{
    learn_from_partner, learn_from_teacher, mutate_about_self, scatter_about_middle,
    teaching_factor,
};
use super::population::{Candidates, Population};
use super::random::{Phase, RandomSource};
use crate::input::stage::Range;

/// Which relative of TLBO.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Variant {
    /// The original (equations 16-18).
    Tlbo,
    /// Gaussian bare-bones TLBO (equations 19, 20).
    Gbtlbo,
    /// The paper's mutation alone (equations 21, 22).
    Mutation,
    /// TLBO and mutation with p fixed at one half (equations 23, 24).
    Hybrid,
    /// The hybrid with p by the success ratio (equation 25).
    SuccessRatio,
    /// SHTLBO: the hybrid with p by the decline of the cost (equations 27-29).
    Shtlbo,
}

/// The step that one individual takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Step {
    /// Equations 16-18.
    Learn,
    /// Equations 19, 20.
    Scatter,
    /// Equations 21, 22.
    Mutate,
}

/// A search by one of the variants.
#[derive(Clone, Debug)]
pub struct Tlbo {
    variant: Variant,
    learning_period: usize,
    teacher: usize,
    mean: Vec<f64>,
    p: f64,
    tally: Tally,
}

impl Tlbo {
    /// A search that updates p every `learning_period` generations (the default of the program
    /// is 1).
    pub fn new(variant: Variant, learning_period: usize) -> Self {
        Self {
            variant,
            learning_period: learning_period.max(1),
            teacher: 0,
            mean: Vec::new(),
            p: P_START,
            tally: Tally::default(),
        }
    }

    const fn adaptation(&self) -> Option<Adaptation> {
        match self.variant {
            Variant::Tlbo | Variant::Gbtlbo | Variant::Mutation => None,
            Variant::Hybrid => Some(Adaptation::Fixed),
            Variant::SuccessRatio => Some(Adaptation::SuccessRatio),
            Variant::Shtlbo => Some(Adaptation::DeclineRatio),
        }
    }

    /// The step of one individual: equations 23, 24 and 26 for the hybrids.
    #[inline(always)]
    fn choose(&self, random: &mut impl RandomSource) -> Step {
        match self.variant {
            Variant::Tlbo => Step::Learn,
            Variant::Gbtlbo => Step::Scatter,
            Variant::Mutation => Step::Mutate,
            Variant::Hybrid | Variant::SuccessRatio | Variant::Shtlbo => {
                if random.uniform() < self.p {
                    Step::Learn
                } else {
                    Step::Mutate
                }
            }
        }
    }

    /// The individual that a step looks at: the teacher, or a partner.
    #[inline(always)]
    fn other(&self, parents: &Parents<'_>, random: &mut impl RandomSource) -> usize {
        if parents.phase != Phase::Learner {
            return self.teacher;
        }
        let drawn = random.index(parents.population.size() - 1);
        if drawn < parents.k { drawn } else { drawn + 1 }
    }
}

impl Breeding for Tlbo {
    type Note = Kind;

    const PHASES: &'static [Phase] = &[Phase::Teacher, Phase::Learner];

    fn begin(&mut self, population: &Population) {
        self.teacher = population.best_index();
        population.mean_into(&mut self.mean);
    }

    /// Equations 16, 19, 21 in the teacher phase, 18, 20, 22 in the learner phase; `new` holds
    /// the random numbers on the way.
    #[inline(always)]
    fn make(&self, parents: Parents<'_>, random: &mut impl RandomSource, new: &mut [f64]) -> Kind {
        let Parents { population, k, .. } = parents;
        let step = self.choose(random);
        let other = self.other(&parents, random);
        let old = population.individual(k);
        let model = population.individual(other);
        match step {
            Step::Learn if parents.phase == Phase::Learner => {
                let better = ranks_before(population.cost(other), population.cost(k));
                random.fill_uniform(new);
                learn_from_partner(old, model, better, new);
            }
            Step::Learn => {
                let factor = teaching_factor(random.uniform());
                random.fill_uniform(new);
                learn_from_teacher(old, model, &self.mean, factor, new);
            }
            Step::Scatter => {
                random.fill_normal(new);
                scatter_about_middle(old, model, new);
            }
            Step::Mutate => {
                random.fill_normal(new);
                mutate_about_self(old, model, new);
            }
        }
        if step == Step::Learn {
            Kind::Learning
        } else {
            Kind::Mutation
        }
    }

    fn select(&mut self, population: &mut Population, students: &Candidates<Kind>, _: &[Range]) {
        for (k, (&cost, &kind)) in students.costs.iter().zip(&students.notes).enumerate() {
            self.tally.count(kind, population.cost(k), cost);
        }
        population.improve_all(students);
    }

    fn end(&mut self, generation: usize) {
        if let Some(adaptation) = self.adaptation()
            && generation.is_multiple_of(self.learning_period)
        {
            self.p = self.tally.next_p(adaptation, self.p);
            self.tally = Tally::default();
        }
    }

    fn p(&self) -> Option<f64> {
        self.adaptation().map(|_| self.p)
    }
}

#[cfg(test)]
#[path = "tlbo_tests.rs"]
mod tests;
