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
//! Choices where the paper is silent:
//! - Each phase works on the population at its start: teacher, mean and partners do not change within
//!   a phase. So all candidates of a phase can be evaluated at once.
//! - One `rand < p` and one T_F for each individual and phase; r and N(0, 1) for each coordinate. An
//!   individual draws in this order: rand (hybrids only), the partner (learner phase only; any other
//!   individual, all equally likely), T_F, then r or N(0, 1).
//! - A candidate outside the bounds is clipped to them.
//! - A candidate replaces its individual when its cost is lower. An equal cost is not enough.
//! - p: see [`super::mixing`]. The paper's "LP > 100" is read as the end after Gm = 100 learning
//!   periods.
//!
//! The best individual is never lost, so the last teacher is the result.

use super::cost::{CostFunction, Individual, clip, ranks_before};
use super::mixing::{Mixing, P_START, Step, Tally};
use super::operators::{
    learn_from_partner, learn_from_teacher, mutate_about_self, scatter_about_middle,
    teaching_factor,
};
use super::random::{Phase, Stream, stream};

/// The individuals of a search, and p.
pub struct Population<'f> {
    mixing: Mixing,
    p: f64,
    function: &'f dyn CostFunction,
    seed: u64,
    individuals: Vec<Individual>,
    candidates: Vec<Individual>,
    /// Evaluations so far.
    pub evaluations: usize,
    /// The number of evaluations that gave NaN.
    pub nan_costs: usize,
}

impl<'f> Population<'f> {
    /// The first population (generation 0), evaluated: `first`, clipped to the bounds, then uniform draws
    /// from the box; `size` in all, at least 2. Entries of `first` with a wrong length are left out.
    pub fn new(
        mixing: Mixing,
        seed: u64,
        function: &'f dyn CostFunction,
        size: usize,
        first: &[Vec<f64>],
    ) -> Self {
        let bounds = function.bounds();
        let individual = |k: usize| {
            let given = first.get(k).filter(|given| given.len() == bounds.len());
            let place = given.cloned().unwrap_or_else(|| {
                let mut place = vec![0.0; bounds.len()];
                stream(seed, 0, Phase::Start, k).fill_within(bounds, &mut place);
                place
            });
            let cost = f64::NAN;
            Individual { place, cost }
        };
        let mut population = Self {
            candidates: (0..size.max(2)).map(individual).collect(),
            individuals: Vec::new(),
            p: P_START,
            evaluations: 0,
            nan_costs: 0,
            mixing,
            seed,
            function,
        };
        population.evaluate();
        population.individuals = population.candidates.clone();
        population
    }

    /// The best individual so far.
    pub fn best(&self) -> &Individual {
        &self.individuals[self.teacher()]
    }

    /// p of a hybrid.
    pub fn p(&self) -> Option<f64> {
        matches!(self.mixing, Mixing::Hybrid(_)).then_some(self.p)
    }

    /// Runs one generation, numbered from 1: the teacher phase, the learner phase, the update of p.
    pub fn run_generation(&mut self, number: usize) {
        let mut tally = Tally::default();
        for phase in [Phase::Teacher, Phase::Learner] {
            let steps = self.make_candidates(number, phase);
            self.evaluate();
            let pairs = self.individuals.iter_mut().zip(&mut self.candidates);
            for ((old, new), step) in pairs.zip(steps) {
                tally.count(step, old.cost, new.cost);
                if ranks_before(new.cost, old.cost) {
                    std::mem::swap(old, new);
                }
            }
        }
        if let Mixing::Hybrid(adaptation) = self.mixing {
            self.p = tally.next_p(adaptation, self.p);
        }
    }

    /// Makes a candidate for each individual: equations 16, 19, 21 in the teacher phase, 18, 20, 22 in
    /// the learner phase, and the choice between them (equations 23, 24, 26). Returns the steps.
    fn make_candidates(&mut self, generation: usize, phase: Phase) -> Vec<Step> {
        let (teacher, mean) = (self.teacher(), self.mean());
        let individuals = &self.individuals;
        let make = |(k, candidate): (usize, &mut Individual)| {
            let mut random = stream(self.seed, generation, phase, k);
            let step = match self.mixing {
                Mixing::Pure(step) => step,
                Mixing::Hybrid(_) if random.uniform() < self.p => Step::Learn,
                Mixing::Hybrid(_) => Step::Mutate,
            };
            let other = match phase {
                Phase::Learner => another(k, individuals.len(), &mut random),
                _ => teacher,
            };
            let (old, other, new) = (&individuals[k], &individuals[other], &mut candidate.place);
            match step {
                Step::Learn if phase == Phase::Learner => {
                    random.fill_uniform(new);
                    let is_better = ranks_before(other.cost, old.cost);
                    learn_from_partner(&old.place, &other.place, is_better, new);
                }
                Step::Learn => {
                    let factor = teaching_factor(random.uniform());
                    random.fill_uniform(new);
                    learn_from_teacher(&old.place, &other.place, &mean, factor, new);
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
        };
        self.candidates.iter_mut().enumerate().map(make).collect()
    }

    /// Clips and evaluates the candidates.
    fn evaluate(&mut self) {
        for candidate in &mut self.candidates {
            clip(&mut candidate.place, self.function.bounds());
        }
        self.function.costs(&mut self.candidates);
        let costs = self.candidates.iter().map(|candidate| candidate.cost);
        self.evaluations += costs.len();
        self.nan_costs += costs.filter(|cost| cost.is_nan()).count();
    }

    /// The index of the individual that ranks first; of equal ones the first.
    fn teacher(&self) -> usize {
        let all = &self.individuals;
        let better = |best: usize, k: usize| match ranks_before(all[k].cost, all[best].cost) {
            true => k,
            false => best,
        };
        (0..all.len()).fold(0, better)
    }

    /// The mean of the individuals, summed in their order.
    fn mean(&self) -> Vec<f64> {
        let mut mean = vec![0.0; self.function.bounds().len()];
        for individual in &self.individuals {
            for (sum, x) in mean.iter_mut().zip(&individual.place) {
                *sum += x;
            }
        }
        let count = self.individuals.len() as f64;
        mean.iter_mut().for_each(|sum| *sum /= count);
        mean
    }
}

/// The index of a partner: any of `count` individuals but `k`, all equally likely.
fn another(k: usize, count: usize, random: &mut Stream) -> usize {
    let drawn = random.index(count - 1);
    if drawn < k { drawn } else { drawn + 1 }
}

#[cfg(test)]
#[path = "tlbo_tests.rs"]
mod tests;
