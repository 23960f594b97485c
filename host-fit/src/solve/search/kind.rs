//! The searches by name.

use super::breeding::{Breeding, PopulationSearch};
use super::cost::{CostFunction, Evaluator};
use super::peers::cmaes::Covariance;
use super::peers::de::Differential;
use super::peers::ga::Genetic;
use super::peers::pso::Swarm;
use super::peers::random::RandomDraws;
use super::random::SeededStreams;
use super::run::{Outcome, Start, StopCriteria, run};
use super::tlbo::{Tlbo, Variant};

/// A search method.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum SearchKind {
    /// SHTLBO (equations 23, 24, 27-29).
    Shtlbo,
    /// TLBO (equations 16-18).
    Tlbo,
    /// Gaussian bare-bones TLBO (equations 19, 20).
    Gbtlbo,
    /// The paper's mutation alone (equations 21, 22).
    Mutation,
    /// The hybrid with a fixed p (equations 23, 24).
    Hybrid,
    /// The hybrid with p by the success ratio (equation 25).
    SuccessRatio,
    /// Differential evolution.
    De,
    /// Particle swarm.
    Pso,
    /// Genetic algorithm.
    Ga,
    /// CMA-ES.
    Cmaes,
    /// Random draws.
    Random,
}

/// What a search needs besides the function and the stop criteria.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings<'a> {
    /// Seed of all random numbers.
    pub seed: u64,
    /// The first population; the paper's Np is 100.
    pub start: Start<'a>,
    /// Generations from one update of p to the next.
    pub learning_period: usize,
}

impl Default for Settings<'_> {
    /// Np = 100, drawn with seed 1; p is updated every generation.
    fn default() -> Self {
        Self {
            seed: 1,
            start: Start {
                population: 100,
                individuals: &[],
            },
            learning_period: 1,
        }
    }
}

impl SearchKind {
    /// All of them, the paper's and its ablations first.
    pub const ALL: [Self; 11] = [
        Self::Shtlbo,
        Self::Tlbo,
        Self::Gbtlbo,
        Self::Mutation,
        Self::Hybrid,
        Self::SuccessRatio,
        Self::De,
        Self::Pso,
        Self::Ga,
        Self::Cmaes,
        Self::Random,
    ];

    /// The names of all, in the same order.
    pub const NAMES: [&'static str; 11] = {
        let mut names = [""; 11];
        let mut index = 0;
        while index < names.len() {
            names[index] = Self::ALL[index].name();
            index += 1;
        }
        names
    };

    /// The name on the command line and in reports.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Shtlbo => "shtlbo",
            Self::Tlbo => "tlbo",
            Self::Gbtlbo => "gbtlbo",
            Self::Mutation => "mutation",
            Self::Hybrid => "hybrid",
            Self::SuccessRatio => "success-ratio",
            Self::De => "de",
            Self::Pso => "pso",
            Self::Ga => "ga",
            Self::Cmaes => "cmaes",
            Self::Random => "random",
        }
    }

    /// The method of that name.
    pub fn by_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.name() == name)
    }

    /// The equations of the paper that the method consists of, or where it comes from.
    pub const fn source(self) -> &'static str {
        match self {
            Self::Shtlbo => "eqs 23, 24, 27-29",
            Self::Tlbo => "eqs 16-18",
            Self::Gbtlbo => "eqs 19, 20",
            Self::Mutation => "eqs 21, 22",
            Self::Hybrid => "eqs 23, 24",
            Self::SuccessRatio => "eqs 23-25",
            Self::De => "DE/rand/1/bin",
            Self::Pso => "global best",
            Self::Ga => "breeder GA",
            Self::Cmaes => "tutorial of 2016",
            Self::Random => "uniform draws",
        }
    }

    /// Searches for the minimum of `function`. Without any stop criterion it runs until the
    /// interrupt flag is set.
    pub fn minimize<F: CostFunction + ?Sized>(
        self,
        function: &F,
        settings: &Settings<'_>,
        criteria: &StopCriteria<'_>,
    ) -> Outcome {
        let tlbo = |variant| {
            let breeding = Tlbo::new(variant, settings.learning_period);
            bred(breeding, function, settings, criteria)
        };
        match self {
            Self::Shtlbo => tlbo(Variant::Shtlbo),
            Self::Tlbo => tlbo(Variant::Tlbo),
            Self::Gbtlbo => tlbo(Variant::Gbtlbo),
            Self::Mutation => tlbo(Variant::Mutation),
            Self::Hybrid => tlbo(Variant::Hybrid),
            Self::SuccessRatio => tlbo(Variant::SuccessRatio),
            Self::De => bred(Differential, function, settings, criteria),
            Self::Pso => bred(Swarm::default(), function, settings, criteria),
            Self::Ga => bred(Genetic, function, settings, criteria),
            Self::Random => bred(RandomDraws, function, settings, criteria),
            Self::Cmaes => {
                let streams = SeededStreams::new(settings.seed);
                let mut evaluator = Evaluator::new(function);
                let method = Covariance::new(streams, &mut evaluator, &settings.start);
                run(method, evaluator, criteria)
            }
        }
    }
}

/// A search with a population.
fn bred<F: CostFunction + ?Sized>(
    breeding: impl Breeding,
    function: &F,
    settings: &Settings<'_>,
    criteria: &StopCriteria<'_>,
) -> Outcome {
    let streams = SeededStreams::new(settings.seed);
    let mut evaluator = Evaluator::new(function);
    let method = PopulationSearch::new(breeding, streams, &mut evaluator, &settings.start);
    run(method, evaluator, criteria)
}

#[cfg(test)]
#[path = "kind_tests.rs"]
mod tests;
