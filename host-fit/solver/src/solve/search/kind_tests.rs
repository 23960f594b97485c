use super::*;
use crate::solve::search::cost::known::{KnownFunction, rastrigin, rosenbrock, sphere};
use crate::solve::search::random::{Phase, stream};

/// Generations for so many evaluations.
fn options(seed: u64, population: usize, evaluations: usize) -> SearchOptions<'static> {
    SearchOptions::new(seed, population, evaluations / (2 * population))
}

fn best_of_random_draws(function: &KnownFunction, count: usize) -> f64 {
    let mut place = vec![0.0; function.bounds().len()];
    let costs = (0..count).map(|k| {
        stream(1, 0, Phase::Start, k).fill_within(function.bounds(), &mut place);
        function.cost(&place)
    });
    costs.fold(f64::INFINITY, f64::min)
}

/// Every search does far better than random draws, at equal evaluations.
#[test]
fn every_search_beats_random_draws_on_known_functions() {
    let cases = [
        (sphere as fn(&[f64]) -> f64, 5.0, 0.05),
        (rosenbrock, 3.0, 0.2),
        (rastrigin, 5.0, 0.6),
    ];
    for (function, half_width, share) in cases {
        let function = KnownFunction::new(8, -half_width, half_width, function);
        let median = |kind: SearchKind| {
            let run = |seed| kind.minimize(&function, &options(seed, 40, 8_000));
            let mut costs: Vec<f64> = (1..=5).map(|seed| run(seed).cost).collect();
            costs.sort_by(f64::total_cmp);
            costs[2]
        };
        let random = best_of_random_draws(&function, 8_000);
        for kind in SearchKind::ALL {
            let cost = median(kind);
            assert!(
                cost < share * random,
                "{}: {cost}, random {random}",
                kind.name()
            );
        }
    }
}

#[test]
fn the_path_is_the_same_on_any_number_of_threads() {
    let function = KnownFunction::new(7, -3.0, 3.0, rastrigin);
    for kind in SearchKind::ALL {
        let path = |threads, seed| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
            let search = || kind.minimize(&function, &options(seed, 50, 1_500));
            pool.expect("a thread pool").install(search)
        };
        let one = path(1, 5);
        assert_eq!(one, path(3, 5), "{}", kind.name());
        let other = path(1, 6);
        assert_ne!(one.best, other.best, "{}: the seed counts", kind.name());
    }
}

#[test]
fn nan_costs_are_counted_and_never_win() {
    let hole = |x: &[f64]| if x[0] < 0.0 { f64::NAN } else { sphere(x) };
    let function = KnownFunction::new(2, -3.0, 3.0, hole);
    for kind in SearchKind::ALL {
        let found = kind.minimize(&function, &options(4, 30, 3_000));
        assert!(found.nan_costs > 0, "{}", kind.name());
        let is_found = found.best[0] >= 0.0 && found.cost < 0.1;
        assert!(is_found, "{}", kind.name());
        let all = KnownFunction::new(2, -3.0, 3.0, |_| f64::NAN);
        let lost = kind.minimize(&all, &options(4, 30, 300));
        let is_counted = lost.cost.is_nan() && lost.nan_costs == lost.evaluations;
        assert!(is_counted, "{}", kind.name());
    }
}
