//! The loop over the generations of a search: its options, why it stops, its result.

use super::cost::CostFunction;
use super::mixing::Mixing;
use super::tlbo::Population;
use hallstage_input::watch::Watch;

/// How a search starts and when it stops. It checks after each generation, in the order of
/// [`StopReason`].
#[derive(Clone, Copy, Debug)]
pub struct SearchOptions<'a> {
    /// Seed of all random numbers.
    pub seed: u64,
    /// Np: the number of individuals, at least 2.
    pub population: usize,
    /// Gm: the number of generations after the first population.
    pub generations: usize,
    /// Individuals that take the first places of the first population, clipped to the bounds. One of
    /// a wrong length is left out. The other individuals are drawn.
    pub first: &'a [Vec<f64>],
    /// Stop after this number of evaluations, the first population included.
    pub evaluations: Option<usize>,
    /// Stop once the best cost hardly falls.
    pub stall: Option<Stall>,
    /// Shows how far the search is, and can stop it.
    pub watch: Watch<'a>,
}

impl SearchOptions<'_> {
    /// No individuals given; the search stops after the last generation only.
    pub const fn new(seed: u64, population: usize, generations: usize) -> Self {
        Self {
            seed,
            population,
            generations,
            first: &[],
            evaluations: None,
            stall: None,
            watch: Watch::NONE,
        }
    }
}

/// A search stalls when its best cost falls by less than a share over some generations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stall {
    /// The number of generations.
    pub generations: usize,
    /// The share of the best cost, such as 1e-9.
    pub relative_decline: f64,
}

/// Why a search stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StopReason {
    /// The watch ended the search: the best so far is kept.
    Interrupted,
    /// The number of generations was reached.
    Generations,
    /// The number of evaluations was reached.
    Evaluations,
    /// The best cost hardly fell any more.
    Stall,
}

/// The state after one generation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Checkpoint {
    /// Evaluations so far.
    pub evaluations: usize,
    /// Best cost so far.
    pub best_cost: f64,
    /// p of a hybrid after the generation.
    pub p: Option<f64>,
}

/// The result of a search.
#[derive(Clone, Debug, PartialEq)]
pub struct SearchResult {
    /// The best individual.
    pub best: Vec<f64>,
    /// Its cost.
    pub cost: f64,
    /// The number of evaluations.
    pub evaluations: usize,
    /// The number of evaluations that gave NaN.
    pub nan_costs: usize,
    /// Why the search stopped.
    pub reason: StopReason,
    /// The first population and every generation.
    pub history: Vec<Checkpoint>,
}

/// Runs generations until a stop criterion is met.
pub(super) fn run(
    mixing: Mixing,
    function: &dyn CostFunction,
    options: &SearchOptions<'_>,
) -> SearchResult {
    let mut population = Population::new(
        mixing,
        options.seed,
        function,
        options.population,
        options.first,
    );
    let progress = options.watch.begin("searching", options.generations as u64);
    let mut history = Vec::new();
    let reason = loop {
        history.push(Checkpoint {
            evaluations: population.evaluations,
            best_cost: population.best().cost,
            p: population.p(),
        });
        progress.reach(history.len() as u64);
        if let Some(reason) = options.stop(&history) {
            break reason;
        }
        population.run_generation(history.len());
    };
    let best = population.best();
    SearchResult {
        best: best.place.clone(),
        cost: best.cost,
        evaluations: population.evaluations,
        nan_costs: population.nan_costs,
        reason,
        history,
    }
}

impl SearchOptions<'_> {
    /// The first stop criterion that the history meets.
    fn stop(&self, history: &[Checkpoint]) -> Option<StopReason> {
        let now = history.last()?;
        let generations = history.len() - 1;
        if self.watch.is_stopped() {
            return Some(StopReason::Interrupted);
        }
        if generations >= self.generations {
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
    use std::sync::atomic::AtomicBool;

    #[test]
    fn each_criterion_stops_at_its_limit_and_not_before() {
        let history = |costs: &[f64]| -> Vec<Checkpoint> {
            let point = |(k, &best_cost): (usize, &f64)| Checkpoint {
                evaluations: 100 + 200 * k,
                best_cost,
                p: None,
            };
            costs.iter().enumerate().map(point).collect()
        };
        let flag = AtomicBool::new(true);
        let none = SearchOptions::new(1, 100, 1_000);
        let generations = |count| SearchOptions::new(1, 100, count);
        let evaluations = |count| SearchOptions {
            evaluations: Some(count),
            ..none
        };
        let stall = SearchOptions {
            stall: Some(Stall {
                generations: 2,
                relative_decline: 0.01,
            }),
            ..none
        };
        let interrupted = SearchOptions {
            watch: Watch {
                stop: &flag,
                ..Watch::NONE
            },
            ..generations(0)
        };
        let falls = [8.0, 4.0, 2.0];
        for (options, costs, reason) in [
            (none, &falls[..], None),
            (generations(3), &falls, None),
            (generations(2), &falls, Some(StopReason::Generations)),
            (evaluations(501), &falls, None),
            (evaluations(500), &falls, Some(StopReason::Evaluations)),
            (stall, &[1.0, 1.0], None),
            (stall, &[1.0, 0.995, 0.98], None),
            (stall, &[2.0, 1.0, 0.995, 0.991], Some(StopReason::Stall)),
            (interrupted, &[1.0], Some(StopReason::Interrupted)),
        ] {
            assert_eq!(options.stop(&history(costs)), reason, "{options:?}");
        }
    }
}
