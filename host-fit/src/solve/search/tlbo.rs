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

use super::cost::{CostFunction, Evaluator, ranks_before};
use super::mixing::{Adaptation, Kind, P_START, Tally};
use super::operators::{
    learn_from_partner, learn_from_teacher, mutate_about_self, scatter_about_middle,
    teaching_factor,
};
use super::population::{Candidates, Population};
use super::random::{Phase, RandomSource, RandomStreams};
use super::run::{Method, Start};

/// Which relative of TLBO.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Variant {
    /// The original (equations 16-18).
    Tlbo,
    /// Gaussian bare-bones TLBO (equations 19, 20).
    Gbtlbo,
    /// The paper's mutation alone (equations 21, 22).
    Mutation,
    /// TLBO and mutation with a fixed p (equations 23, 24).
    Hybrid {
        /// Share of individuals that learn, 0 to 1.
        p: f64,
    },
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
pub struct Tlbo<S> {
    variant: Variant,
    streams: S,
    learning_period: usize,
    population: Population,
    mean: Vec<f64>,
    candidates: Candidates<Kind>,
    p: f64,
    tally: Tally,
}

impl<S: RandomStreams> Tlbo<S> {
    /// Draws and evaluates the first population. p is updated every `learning_period`
    /// generations (the default of the program is 1).
    pub fn new<F: CostFunction + ?Sized>(
        variant: Variant,
        learning_period: usize,
        streams: S,
        evaluator: &mut Evaluator<'_, F>,
        start: &Start<'_>,
    ) -> Self {
        let population = Population::draw(evaluator, &streams, start);
        Self {
            variant,
            learning_period: learning_period.max(1),
            mean: vec![0.0; population.dimensions()],
            candidates: Candidates::for_population(&population, Kind::Learning),
            p: match variant {
                Variant::Hybrid { p } => p,
                _ => P_START,
            },
            tally: Tally::default(),
            population,
            streams,
        }
    }

    /// The population.
    pub fn population(&self) -> &Population {
        &self.population
    }

    fn adaptation(&self) -> Option<Adaptation> {
        match self.variant {
            Variant::Tlbo | Variant::Gbtlbo | Variant::Mutation => None,
            Variant::Hybrid { .. } => Some(Adaptation::Fixed),
            Variant::SuccessRatio => Some(Adaptation::SuccessRatio),
            Variant::Shtlbo => Some(Adaptation::DeclineRatio),
        }
    }

    /// The step of one individual: equations 23, 24 and 26 for the hybrids.
    #[inline(always)]
    fn choose(&self, random: &mut S::Source) -> Step {
        match self.variant {
            Variant::Tlbo => Step::Learn,
            Variant::Gbtlbo => Step::Scatter,
            Variant::Mutation => Step::Mutate,
            Variant::Hybrid { .. } | Variant::SuccessRatio | Variant::Shtlbo => {
                if random.uniform() < self.p {
                    Step::Learn
                } else {
                    Step::Mutate
                }
            }
        }
    }

    /// Runs one phase: candidates of all individuals, their costs, the better of old and new.
    fn phase<F: CostFunction + ?Sized>(
        &mut self,
        generation: usize,
        phase: Phase,
        evaluator: &mut Evaluator<'_, F>,
    ) {
        let mut mean = core::mem::take(&mut self.mean);
        let mut candidates = core::mem::replace(&mut self.candidates, Candidates::empty());
        self.population.mean_into(&mut mean);
        let Candidates {
            places,
            costs,
            notes,
        } = &mut candidates;
        let teacher = self.population.best().0;
        evaluator.breed(
            places,
            costs,
            notes,
            #[inline(always)]
            |k, new| {
                let mut random = self.streams.stream(generation, phase, k);
                let step = self.choose(&mut random);
                if phase == Phase::Learner {
                    self.learner_step(k, step, &mut random, new);
                } else {
                    self.teacher_step(k, step, teacher, &mean, &mut random, new);
                }
                if step == Step::Learn {
                    Kind::Learning
                } else {
                    Kind::Mutation
                }
            },
        );
        for k in 0..self.population.size() {
            let (cost, kind) = (candidates.costs[k], candidates.notes[k]);
            self.tally.count(kind, self.population.cost(k), cost);
            self.population.improve(k, candidates.candidate(k), cost);
        }
        self.mean = mean;
        self.candidates = candidates;
    }

    /// Equations 16, 19, 21; `new` holds the random numbers on the way.
    #[inline(always)]
    fn teacher_step(
        &self,
        k: usize,
        step: Step,
        teacher: &[f64],
        mean: &[f64],
        random: &mut S::Source,
        new: &mut [f64],
    ) {
        let old = self.population.individual(k);
        match step {
            Step::Learn => {
                let factor = teaching_factor(random.uniform());
                random.fill_uniform(new);
                learn_from_teacher(old, teacher, mean, factor, new);
            }
            Step::Scatter => {
                random.fill_normal(new);
                scatter_about_middle(old, teacher, new);
            }
            Step::Mutate => {
                random.fill_normal(new);
                mutate_about_self(old, teacher, new);
            }
        }
    }

    /// Equations 18, 20, 22; `new` holds the random numbers on the way.
    #[inline(always)]
    fn learner_step(&self, k: usize, step: Step, random: &mut S::Source, new: &mut [f64]) {
        let drawn = random.index(self.population.size() - 1);
        let other = if drawn < k { drawn } else { drawn + 1 };
        let old = self.population.individual(k);
        let partner = self.population.individual(other);
        match step {
            Step::Learn => {
                let better = ranks_before(self.population.cost(other), self.population.cost(k));
                random.fill_uniform(new);
                learn_from_partner(old, partner, better, new);
            }
            Step::Scatter => {
                random.fill_normal(new);
                scatter_about_middle(old, partner, new);
            }
            Step::Mutate => {
                random.fill_normal(new);
                mutate_about_self(old, partner, new);
            }
        }
    }
}

impl<S: RandomStreams, F: CostFunction + ?Sized> Method<F> for Tlbo<S> {
    fn generation(&mut self, number: usize, evaluator: &mut Evaluator<'_, F>) -> bool {
        self.phase(number, Phase::Teacher, evaluator);
        self.phase(number, Phase::Learner, evaluator);
        if let Some(adaptation) = self.adaptation()
            && number.is_multiple_of(self.learning_period)
        {
            self.p = self.tally.next_p(adaptation, self.p);
            self.tally = Tally::default();
        }
        true
    }

    fn best(&self) -> (&[f64], f64) {
        self.population.best()
    }

    fn p(&self) -> Option<f64> {
        self.adaptation().map(|_| self.p)
    }
}

#[cfg(test)]
#[path = "tlbo_tests.rs"]
mod tests;
