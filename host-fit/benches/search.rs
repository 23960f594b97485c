//! Times of the population searches on the log that ships with the program: the paper's experiment, and
//! the way to the least-squares optimum.
//!
//! `cargo bench -p host-fit --bench search`
//!
//! `cargo bench -p host-fit --bench search -- --export DIR` writes the 200 rows of the paper's
//! experiment, its bounds and one individual with its fitness into DIR, for other programs to
//! be measured on the same problem, and prints what this one does with it.

use host_fit::input::log::{ReadOptions, read_bytes};
use host_fit::input::stage::Stage;
use host_fit::problem::Problem;
use host_fit::problem::draw::{Draw, draw_rows};
use host_fit::problem::model::Model;
use host_fit::solve::objective::Objective;
use host_fit::solve::search::cost::CostFunction;
use host_fit::solve::search::kind::SearchKind;
use host_fit::solve::search::run::{Start, StopCriteria};
use host_fit::solve::{Projection, Solver, SolverOptions};
use runtime::ModelKind;
use std::error::Error;
use std::fmt::Write;
use std::path::Path;
use std::time::Instant;

/// Np and Gm of the paper.
const PAPER: usize = 100;
/// Rows of the paper's experiment.
const ROWS: usize = 200;
/// Individuals for the form `linear`: nine unknowns want no more.
const FEW: usize = 16;

/// Median of some numbers.
fn median(mut numbers: Vec<f64>) -> f64 {
    numbers.sort_by(f64::total_cmp);
    let middle = numbers.len() / 2;
    if numbers.len().is_multiple_of(2) {
        0.5 * (numbers[middle - 1] + numbers[middle])
    } else {
        numbers[middle]
    }
}

/// Times of several calls in us: the fastest and the median.
fn time_us(repeats: usize, mut call: impl FnMut()) -> (f64, f64) {
    let time = |_| {
        let started = Instant::now();
        call();
        started.elapsed().as_secs_f64() * 1e6
    };
    let times: Vec<f64> = (0..repeats).map(time).collect();
    (
        times.iter().copied().fold(f64::INFINITY, f64::min),
        median(times),
    )
}

/// An individual inside the middle half of the box.
fn inside(cost: &Objective<'_>, number: usize) -> Vec<f64> {
    let place = |(j, range): (usize, &host_fit::input::stage::Range)| {
        let share = 0.25 + 0.5 * ((number * 31 + j * 17) % 97) as f64 / 96.0;
        range.low + share * range.width()
    };
    cost.bounds().iter().enumerate().map(place).collect()
}

fn objective<'a>(problem: &'a Problem<'a>, projection: Projection) -> Objective<'a> {
    Objective::new(problem, projection).expect("Model (31) has slopes")
}

fn start(seed: u64, population: usize) -> Start<'static> {
    Start {
        seed,
        population,
        individuals: &[],
    }
}

fn generations(count: usize) -> StopCriteria<'static> {
    StopCriteria {
        generations: Some(count),
        ..StopCriteria::default()
    }
}

/// The paper's experiment: time and fitness of ten seeds, each with its own plain draw.
fn papers_experiment(problem: &impl Fn(usize, Draw, u64) -> Problem<'static>) {
    let run = |seed| {
        let problem = problem(ROWS, Draw::Plain, seed);
        let cost = objective(&problem, Projection::None);
        let mut fitness = 0.0;
        let (least, middle) = time_us(5, || {
            let found =
                SearchKind::Shtlbo.minimize(&cost, &start(seed, PAPER), &generations(PAPER));
            fitness = found.cost;
        });
        (fitness, least, middle)
    };
    let runs: Vec<_> = (1..=10).map(run).collect();
    let fitness =
        |numbers: &dyn Fn(f64, f64) -> f64, start| runs.iter().map(|r| r.0).fold(start, numbers);
    println!(
        "the paper's experiment (192 unknowns, 200 rows, 20,100 evaluations), ten seeds, one core: \
         {:.1} ms (median {:.1}) = {:.3} us per evaluation; train fitness {:.2} ({:.2} to {:.2})",
        runs.iter().map(|r| r.1).fold(f64::INFINITY, f64::min) / 1e3,
        median(runs.iter().map(|r| r.2).collect()) / 1e3,
        median(runs.iter().map(|r| r.2).collect()) / 20_100.0,
        median(runs.iter().map(|r| r.0).collect()),
        fitness(&f64::min, f64::INFINITY),
        fitness(&f64::max, 0.0),
    );
}

/// How long a search takes to a share above the least-squares optimum, ten seeds.
fn to_the_floor(cost: &Objective<'_>, floor: f64, share: f64, population: usize) {
    let target = floor * (1.0 + share);
    let criteria = StopCriteria {
        evaluations: Some(40_000),
        ..StopCriteria::default()
    };
    let way = |seed| {
        let started = Instant::now();
        let start = Start {
            individuals: &cost.first_population(population, seed),
            ..start(seed, population)
        };
        let found = SearchKind::Shtlbo.minimize(cost, &start, &criteria);
        let each_ms = started.elapsed().as_secs_f64() * 1e3 / found.evaluations as f64;
        let mut history = found.history.iter();
        let there = history.find(|point| point.best_cost <= target)?;
        Some((there.evaluations as f64, there.evaluations as f64 * each_ms))
    };
    let ways: Vec<_> = (1..=10).filter_map(way).collect();
    println!(
        "shtlbo, form {}, Np {population}: {} of 10 seeds within {share:e} of the least-squares \
         fitness {floor:.6}, median {:.0} evaluations, {:.2} ms",
        cost.projection.name(),
        ways.len(),
        median(ways.iter().map(|way| way.0).collect()),
        median(ways.iter().map(|way| way.1).collect()),
    );
}

/// Writes the paper's problem of seed 1 for other programs, and measures this one on it.
fn export(folder: &Path, problem: &Problem<'_>) -> Result<(), Box<dyn Error>> {
    std::fs::create_dir_all(folder)?;
    let mut rows =
        String::from("movement,s_a_um,s_b_um,s_c_um,z_m,rx_rad,ry_rad,x_um,y_um,rz_urad\n");
    for group in &problem.groups {
        for row in &problem.rows[group.rows.clone()] {
            let [z, rx, ry] = row.vertical;
            let numbers = [row.signal_um, [z, rx, ry], row.reference_um].concat();
            let text: Vec<String> = numbers.iter().map(f64::to_string).collect();
            writeln!(rows, "{},{}", group.movement, text.join(","))?;
        }
    }
    std::fs::write(folder.join("rows.csv"), rows)?;
    let cost = objective(problem, Projection::None);
    let individual = inside(&cost, 1);
    let mut unknowns = String::from("low,high,individual\n");
    for (range, x) in cost.bounds().iter().zip(&individual) {
        writeln!(unknowns, "{},{},{x}", range.low, range.high)?;
    }
    std::fs::write(folder.join("unknowns.csv"), unknowns)?;
    for (kind, name) in [(SearchKind::Tlbo, "tlbo"), (SearchKind::Shtlbo, "shtlbo")] {
        let mut fitness = Vec::new();
        let (_, middle) = time_us(5, || {
            let seed = fitness.len() as u64 + 1;
            let found = kind.minimize(&cost, &start(seed, PAPER), &generations(PAPER));
            fitness.push(found.cost);
        });
        println!("RESULT {name}_us_per_evaluation={:.4}", middle / 20_100.0);
        println!("RESULT {name}_fitness={:.4}", median(fitness));
    }
    println!(
        "RESULT fitness_of_individual={:.12}",
        cost.cost(&individual)
    );
    Ok(())
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args()
        .skip(1)
        .filter(|a| a != "--bench")
        .collect();
    let named: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let shipped = Path::new("the log that ships with the program");
    let stage = Stage::from_toml(host_fit::input::shipped::STAGE_TOML, shipped)?;
    let log = host_fit::input::shipped::LOG_GZ;
    let reading = read_bytes(log, shipped, &stage, &ReadOptions::default())?;
    // Lives as long as the program.
    let stage: &'static Stage = Box::leak(Box::new(stage));
    let problem = |count, draw, seed| {
        let rows = draw_rows(&reading.dataset, count, draw, seed);
        Problem::new(&reading.dataset, &rows, stage, Model::of(ModelKind::M31))
    };
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    if let ["--export", folder] = named[..] {
        return one
            .install(|| {
                export(Path::new(folder), &problem(ROWS, Draw::Plain, 1)).map_err(|e| e.to_string())
            })
            .map_err(Into::into);
    }
    let few = problem(ROWS, Draw::Stratified, 1);
    let lm = SolverOptions::new(Projection::Linear, 1);
    let floor = few.fitness(Solver::LeastSquares.solve(&few, &lm)?.cost);
    one.install(|| {
        papers_experiment(&problem);
        // 1e-6 of the sum of squares is 5e-7 of its root.
        to_the_floor(&objective(&few, Projection::Linear), floor, 5e-7, FEW);
    });
    Ok(())
}
