//! Times of the population searches on a log: per evaluation, for the paper's experiment, and
//! to the least-squares optimum.
//!
//! `cargo bench -p host-fit --bench search -- LOG STAGE`

use host_fit::least_squares::starts::LeastSquares;
use host_fit::log::{ReadOptions, read};
use host_fit::objective::delta::DeltaCost;
use host_fit::objective::full::FullCost;
use host_fit::objective::linear::LinearCost;
use host_fit::problem::Problem;
use host_fit::search::cost::CostFunction;
use host_fit::search::kind::{SearchKind, Settings};
use host_fit::search::run::{Start, StopCriteria};
use host_fit::solver::{Projection, Solver, SolverOptions};
use host_fit::stage::Stage;
use host_fit::train::{Draw, draw_rows};
use runtime::ModelKind;
use std::hint::black_box;
use std::path::Path;
use std::time::{Duration, Instant};

/// Median of some numbers.
fn median(mut numbers: Vec<f64>) -> f64 {
    numbers.sort_by(f64::total_cmp);
    numbers[numbers.len() / 2]
}

/// Median time of several calls, in us.
fn time_us(repeats: usize, mut call: impl FnMut()) -> f64 {
    let time = |_| {
        let started = Instant::now();
        call();
        started.elapsed().as_secs_f64() * 1e6
    };
    median((0..repeats).map(time).collect())
}

/// Time of one evaluation, objective alone: 96 individuals from the middle half of the box.
fn objective(name: &str, cost: &impl CostFunction) {
    let count = 96;
    let individuals: Vec<f64> = (0..count)
        .flat_map(|k| {
            cost.bounds().iter().enumerate().map(move |(j, range)| {
                let share = 0.25 + 0.5 * ((k * 31 + j * 17) % 97) as f64 / 96.0;
                range.low + share * range.width()
            })
        })
        .collect();
    let mut costs = vec![0.0; count];
    let together = time_us(201, || cost.costs(black_box(&individuals), &mut costs)) / count as f64;
    let one = &individuals[..cost.bounds().len()];
    let alone = time_us(2001, || {
        black_box(cost.cost(black_box(one)));
    });
    println!(
        "objective {name:<6} {:>4} unknowns: {together:8.3} us each of {count}, {alone:8.3} us alone",
        cost.bounds().len()
    );
}

fn generations(count: usize) -> StopCriteria<'static> {
    StopCriteria {
        generations: Some(count),
        ..StopCriteria::default()
    }
}

fn settings(seed: u64, population: usize) -> Settings<'static> {
    Settings {
        seed,
        start: Start {
            population,
            individuals: &[],
        },
        ..Settings::default()
    }
}

fn main() {
    let arguments: Vec<String> = std::env::args()
        .skip(1)
        .filter(|a| a != "--bench")
        .collect();
    let [log, stage] = &arguments[..] else {
        println!("usage: cargo bench -p host-fit --bench search -- LOG STAGE");
        return;
    };
    let stage = Stage::from_file(Path::new(stage)).expect("a readable stage file");
    let reading = read(&[log], &stage, &ReadOptions::default()).expect("a readable log");
    let rows = |count, draw, seed| draw_rows(&reading.dataset, count, draw, seed);
    let problem = |rows: &[usize]| Problem::new(&reading.dataset, rows, &stage, ModelKind::M31);

    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .expect("a thread pool");
    pool.install(|| {
        let few = problem(&rows(200, Draw::Stratified, 1));
        objective("none", &FullCost::new(&few));
        objective("delta", &DeltaCost::new(&few));
        objective("linear", &LinearCost::new(&few).expect("Model (31)"));

        let mut fitness = Vec::new();
        let mut elapsed = Vec::new();
        for seed in 1..=10 {
            let paper = problem(&rows(200, Draw::Plain, seed));
            let cost = FullCost::new(&paper);
            let started = Instant::now();
            let found = SearchKind::Shtlbo.minimize(&cost, &settings(seed, 100), &generations(100));
            elapsed.push(started.elapsed());
            fitness.push(found.cost);
        }
        let ms = median(elapsed.iter().map(Duration::as_secs_f64).collect()) * 1e3;
        fitness.sort_by(f64::total_cmp);
        println!(
            "the paper's experiment, ten seeds, one core: median {ms:.1} ms = {:.3} us per evaluation; \
             train fitness median {:.2}, {:.2} to {:.2}",
            ms * 1e3 / 20_100.0, 0.5 * (fitness[4] + fitness[5]), fitness[0], fitness[9]
        );
        let lm_options = SolverOptions {
            projection: Projection::Linear,
            seed: 1,
            population: 0,
            generations: 0,
        };
        let floor = few.fitness(LeastSquares.solve(&few, &lm_options).expect("a fit").cost);
        println!("floor {floor:.6}");
        for (name, form, share) in [
            ("linear", &LinearCost::new(&few).expect("Model (31)") as &dyn CostFunction, 5e-7),
            ("delta", &DeltaCost::new(&few), 0.01),
        ] {
            for kind in SearchKind::ALL {
                for population in [30, 50, 100] {
                let mut evaluations = Vec::new();
                let mut times = Vec::new();
                let mut reached = 0;
                for seed in 1..=20 {
                    let criteria = StopCriteria {
                        evaluations: Some(100_000),
                        target_cost: Some(floor * (1.0 + share)),
                        ..StopCriteria::default()
                    };
                    let started = Instant::now();
                    let found = kind.minimize(form, &settings(seed, population), &criteria);
                    times.push(started.elapsed().as_secs_f64() * 1e3);
                    evaluations.push(found.evaluations as f64);
                    reached += usize::from(found.cost <= floor * (1.0 + share));
                }
                println!("{name:<7} {:<14} Np {population:>3}: {reached:>2} of 20 reach {share:e} of the floor, median {} evaluations, {:.2} ms",
                    kind.name(), median(evaluations), median(times));
                }
            }
        }
        for kind in SearchKind::ALL {
            if kind == SearchKind::Cmaes {
                continue;
            }
            let cost = FullCost::new(&few);
            let criteria = StopCriteria { evaluations: Some(20_100), ..StopCriteria::default() };
            let us = time_us(3, || {
                black_box(kind.minimize(&cost, &settings(1, 100), &criteria));
            });
            println!("{:<14} {:.3} us per evaluation", kind.name(), us / 20_100.0);
        }
    });
}
