//! `cargo bench -p host-fit --bench search -- DIR` writes the 200 rows of the paper's experiment, its
//! bounds and one individual with its fitness into DIR, for other programs to be measured on the same
//! problem, and prints what this one does with it. (`host-fit compare` has the other figures.)

mod common;

use common::{Fallible, median, median_s, read};
use host_fit::input::shipped::{self, LOG_GZ};
use host_fit::solver::problem::Problem;
use host_fit::solver::problem::draw::{Draw, draw_rows};
use host_fit::solver::problem::model::Model;
use host_fit::solver::solve::Projection;
use host_fit::solver::solve::objective::Objective;
use host_fit::solver::solve::search::cost::CostFunction;
use host_fit::solver::solve::search::kind::SearchKind;
use host_fit::solver::solve::search::run::{Start, StopCriteria};
use runtime::ModelKind;
use std::fmt::Write;
use std::path::Path;

/// Np and Gm of the paper.
const PAPER: usize = 100;
/// Rows of the paper's experiment.
const ROWS: usize = 200;

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
fn export(folder: &Path, problem: &Problem<'_>) -> Fallible<()> {
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
        let middle_s = median_s(5, || {
            let seed = fitness.len() as u64 + 1;
            let found = kind.minimize(&cost, &start(seed, PAPER), &generations(PAPER));
            fitness.push(found.cost);
        });
        println!(
            "RESULT {name}_us_per_evaluation={:.4}",
            1e6 * middle_s / 20_100.0
        );
        println!("RESULT {name}_fitness={:.4}", median(fitness));
    }
    println!(
        "RESULT fitness_of_individual={:.12}",
        cost.cost(&individual)
    );
    Ok(())
}

fn main() -> Fallible<()> {
    // Cargo passes `--bench`.
    let folder = std::env::args().skip(1).find(|a| !a.starts_with("--"));
    let folder = folder.ok_or("name a folder")?;
    let stage = shipped::stage();
    let dataset = read(LOG_GZ, &stage)?;
    let rows = draw_rows(&dataset, ROWS, Draw::Plain, 1);
    let problem = Problem::new(&dataset, &rows, &stage, Model::of(ModelKind::M31));
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    let done = one.install(|| export(Path::new(&folder), &problem).map_err(|e| e.to_string()));
    done.map_err(Into::into)
}
