//! `cargo bench -p host-fit --bench search -- DIR` writes the 200 rows of the paper's experiment, its
//! bounds and one individual with its fitness into DIR, for other programs to be measured on the same
//! problem, and prints what this one does with it. (`host-fit compare` has the other figures.)

use host_fit::input::log::{ReadOptions, read_bytes};
use host_fit::input::stage::Stage;
use host_fit::problem::Problem;
use host_fit::problem::draw::{Draw, draw_rows};
use host_fit::problem::model::Model;
use host_fit::solve::Projection;
use host_fit::solve::objective::Objective;
use host_fit::solve::search::cost::CostFunction;
use host_fit::solve::search::kind::SearchKind;
use host_fit::solve::search::run::{Start, StopCriteria};
use runtime::ModelKind;
use std::error::Error;
use std::fmt::Write;
use std::path::Path;
use std::time::Instant;

/// Np and Gm of the paper.
const PAPER: usize = 100;
/// Rows of the paper's experiment.
const ROWS: usize = 200;

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

/// Median time of several calls, us.
fn time_us(repeats: usize, mut call: impl FnMut()) -> f64 {
    let time = |_| {
        let started = Instant::now();
        call();
        started.elapsed().as_secs_f64() * 1e6
    };
    median((0..repeats).map(time).collect())
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
        let middle = time_us(5, || {
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
    // Cargo passes `--bench`.
    let folder = std::env::args().skip(1).find(|a| !a.starts_with("--"));
    let folder = folder.ok_or("name a folder")?;
    let shipped = Path::new("the log that ships with the program");
    let stage = Stage::from_toml(host_fit::input::shipped::STAGE_TOML, shipped)?;
    let log = host_fit::input::shipped::LOG_GZ;
    let dataset = read_bytes(log, shipped, &stage, &ReadOptions::default())?.dataset;
    let rows = draw_rows(&dataset, ROWS, Draw::Plain, 1);
    let problem = Problem::new(&dataset, &rows, &stage, Model::of(ModelKind::M31));
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    let done = one.install(|| export(Path::new(&folder), &problem).map_err(|e| e.to_string()));
    done.map_err(Into::into)
}
