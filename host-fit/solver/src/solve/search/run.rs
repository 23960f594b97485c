//! The loop that all searches share: generations, stop criteria, history, outcome.

use super::cost::CostFunction;
use super::population::{Breeding, Search};
use super::random::stream;
use hallstage_input::progress::Progress;
use std::sync::atomic::{AtomicBool, Ordering};

/// The seed and the first population of a search.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Start<'a> {
    /// Seed of all random numbers.
    pub seed: u64,
    /// Np: how many individuals; fewer than a method needs are raised to that.
    pub population: usize,
    /// Warm start: these take the first places, clipped to the bounds. Those of a wrong length
    /// are left out. The other individuals are drawn.
    pub individuals: &'a [Vec<f64>],
}

/// When to stop. The criteria are checked after each generation, in the order of
/// [`StopReason`]; at least one of them should be set.
#[derive(Clone, Copy, Debug, Default)]
pub struct StopCriteria<'a> {
    /// Gm: after so many generations beyond the first population.
    pub generations: Option<usize>,
    /// Once so many candidates were evaluated, the first population included.
    pub evaluations: Option<usize>,
    /// Once the best cost has hardly fallen for long.
    pub stall: Option<Stall>,
    /// Once this flag is set, by Ctrl-C or another thread.
    pub interrupt: Option<&'a AtomicBool>,
}

/// A search stalls when its best cost falls by less than a share over some generations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stall {
    /// How many generations.
    pub generations: usize,
    /// The share of the best cost, such as 1e-9.
    pub relative_decline: f64,
}

/// Why a search stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StopReason {
    /// The interrupt flag was set: the best so far is kept.
    Interrupted,
    /// The number of generations was reached.
    Generations,
    /// The number of evaluations was reached.
    Evaluations,
    /// The best cost hardly fell any more.
    Stall,
}

impl core::fmt::Display for StopReason {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            Self::Interrupted => "interrupted; the best so far is kept",
            Self::Generations => "all generations were run",
            Self::Evaluations => "the budget of evaluations was used",
            Self::Stall => "the best cost no longer fell",
        })
    }
}

/// The state after one generation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Checkpoint {
    /// Evaluations so far.
    pub evaluations: usize,
    /// Best cost so far.
    pub best_cost: f64,
    /// p after the generation, for methods that have one.
    pub p: Option<f64>,
}

/// What a search found.
#[derive(Clone, Debug, PartialEq)]
pub struct Outcome {
    /// The best individual.
    pub best: Vec<f64>,
    /// Its cost.
    pub cost: f64,
    /// Candidates evaluated.
    pub evaluations: usize,
    /// How many of them had no cost (NaN).
    pub nan_costs: usize,
    /// Generations run after the first population.
    pub generations: usize,
    /// Why the search stopped.
    pub reason: StopReason,
    /// The first population and every generation.
    pub history: Vec<Checkpoint>,
}

/// Breeds until a criterion says stop.
pub fn run<B: Breeding>(
    breeding: B,
    function: &dyn CostFunction,
    start: &Start<'_>,
    criteria: &StopCriteria<'_>,
) -> Outcome {
    let streams = |generation, phase, k| stream(start.seed, generation, phase, k);
    let mut search = Search::new(
        breeding,
        streams,
        function,
        start.population,
        start.individuals,
    );
    let progress = Progress::new("searching", criteria.generations.unwrap_or(0) as u64);
    let mut history = Vec::new();
    let reason = loop {
        history.push(Checkpoint {
            evaluations: search.evaluations,
            best_cost: search.best().cost,
            p: search.breeding.p(),
        });
        progress.reach(history.len() as u64);
        if let Some(reason) = criteria.reached(&history) {
            break reason;
        }
        search.generation(history.len());
    };
    let best = search.best();
    Outcome {
        best: best.place.clone(),
        cost: best.cost,
        evaluations: search.evaluations,
        nan_costs: search.nan_costs,
        generations: history.len() - 1,
        reason,
        history,
    }
}

impl StopCriteria<'_> {
    /// The first criterion that the history meets.
    pub fn reached(&self, history: &[Checkpoint]) -> Option<StopReason> {
        let now = history.last()?;
        let generations = history.len() - 1;
        if self
            .interrupt
            .is_some_and(|flag| flag.load(Ordering::Relaxed))
        {
            return Some(StopReason::Interrupted);
        }
        if self.generations.is_some_and(|most| generations >= most) {
            return Some(StopReason::Generations);
        }
        if self.evaluations.is_some_and(|most| now.evaluations >= most) {
            return Some(StopReason::Evaluations);
        }
        let stall = self.stall?;
        let before = history.get(generations.checked_sub(stall.generations)?)?;
        let least = stall.relative_decline * before.best_cost.abs();
        (before.best_cost - now.best_cost <= least).then_some(StopReason::Stall)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn history(costs: &[f64]) -> Vec<Checkpoint> {
        let point = |(k, &best_cost): (usize, &f64)| Checkpoint {
            evaluations: 100 + 200 * k,
            best_cost,
            p: None,
        };
        costs.iter().enumerate().map(point).collect()
    }

    #[test]
    fn each_criterion_stops_at_its_limit_and_not_before() {
        let none = StopCriteria::default();
        let (generations, evaluations) = (
            |count| StopCriteria {
                generations: Some(count),
                ..none
            },
            |count| StopCriteria {
                evaluations: Some(count),
                ..none
            },
        );
        let stall = StopCriteria {
            stall: Some(Stall {
                generations: 2,
                relative_decline: 0.01,
            }),
            ..none
        };
        let flag = AtomicBool::new(true);
        let interrupted = StopCriteria {
            interrupt: Some(&flag),
            ..generations(0)
        };
        for (criteria, costs, reason) in [
            (none, &[8.0, 4.0, 2.0][..], None),
            (generations(3), &[8.0, 4.0, 2.0], None),
            (
                generations(2),
                &[8.0, 4.0, 2.0],
                Some(StopReason::Generations),
            ),
            (evaluations(501), &[8.0, 4.0, 2.0], None),
            (
                evaluations(500),
                &[8.0, 4.0, 2.0],
                Some(StopReason::Evaluations),
            ),
            (stall, &[1.0, 1.0], None),
            (stall, &[1.0, 0.995, 0.98], None),
            (stall, &[2.0, 1.0, 0.995, 0.991], Some(StopReason::Stall)),
            (interrupted, &[1.0], Some(StopReason::Interrupted)),
        ] {
            assert_eq!(criteria.reached(&history(costs)), reason, "{criteria:?}");
        }
    }
}
