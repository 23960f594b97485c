//! The solvers of the paper beside each other and beside least squares, and the paper's problem as
//! files for other programs:
//!
//! ```sh
//! cargo bench -p host-fit --bench search -- DIR
//! ```
//!
//! Writes into DIR the 200 rows of the paper's experiment (`rows.csv`), its bounds and one individual
//! (`unknowns.csv`), and every generation of every search (`history.csv`). Prints the time of an
//! evaluation as `RESULT key=value` lines, and the table of `README.md`.

mod common;

use common::{Axes, Fallible, median, median_s, read};
use host_fit::calibration::fit::calibration;
use host_fit::calibration::judge::{Decoded, Zeros};
use host_fit::input::dataset::Dataset;
use host_fit::input::shipped::{self, LOG_GZ};
use host_fit::solver::estimator::draw::{Draw, draw_rows};
use host_fit::solver::estimator::model::Model;
use host_fit::solver::estimator::parameters::FieldParameters;
use host_fit::solver::estimator::problem::Problem;
use host_fit::solver::solve::objective::Objective;
use host_fit::solver::solve::search::cost::CostFunction;
use host_fit::solver::solve::search::kind::SearchKind;
use host_fit::solver::solve::search::run::SearchOptions;
use host_fit::solver::solve::{Projection, Solution, Solver, SolverOptions};
use runtime::ModelKind;
use runtime::calibration::Origin;
use std::fmt::Write;
use std::path::Path;

/// Np and Gm of the paper.
const PAPER: usize = 100;
/// Evaluations of the paper: the first population and two phases of each generation.
const EVALUATIONS: f64 = 20_100.0;
/// Rows of the paper's experiment.
const ROWS: usize = 200;
/// Each solver runs with the seeds 1 to 10; a seed draws the rows and the first population.
const SEEDS: u64 = 10;
/// A search is at the floor once its fitness is this close to the least-squares fitness: 1e-6 of the sum of
/// squares.
const AT_FLOOR: f64 = 5e-7;

fn main() -> Fallible<()> {
    // Cargo passes `--bench`.
    let folder = std::env::args().skip(1).find(|a| !a.starts_with("--"));
    let folder = folder.ok_or("name a folder")?;
    let folder = Path::new(&folder);
    std::fs::create_dir_all(folder)?;
    let stage = shipped::stage();
    let dataset = read(LOG_GZ, &stage)?;
    let problem = |draw, seed| {
        let rows = draw_rows(&dataset, ROWS, draw, seed);
        Problem::new(&dataset, &rows, &stage, Model::from_kind(ModelKind::M31))
    };
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    one.install(|| export(folder, &problem(Draw::Plain, 1)).map_err(|e| e.to_string()))?;
    let problems: Vec<Problem<'_>> = (1..=SEEDS)
        .map(|seed| problem(Draw::Stratified, seed))
        .collect();
    let mut history = String::from("form,solver,seed,evaluations,fitness,p\n");
    println!(
        "| form | solver | train fitness: median (range) | X, Y, Rz rms, median (um, um, urad) \
         | at the floor (1e-6) |\n|---|---|---|---|---|"
    );
    for form in [Projection::None, Projection::Delta, Projection::Linear] {
        compare(form, &problems, &dataset, &mut history)?;
    }
    Ok(std::fs::write(folder.join("history.csv"), history)?)
}

/// Writes the paper's problem for other programs, and measures an evaluation.
fn export(folder: &Path, problem: &Problem<'_>) -> Fallible<()> {
    let mut rows =
        String::from("movement,s_a_um,s_b_um,s_c_um,z_m,rx_rad,ry_rad,x_um,y_um,rz_urad\n");
    for (number, movement) in problem.rows.numbered_movements() {
        for row in &problem.rows.rows[movement] {
            let [z, rx, ry] = row.vertical;
            let um = |si: [f64; 3]| si.map(|si| si * 1e6);
            let numbers = [um(row.signal_m), [z, rx, ry], um(row.reference)].concat();
            let text: Vec<String> = numbers.iter().map(f64::to_string).collect();
            writeln!(rows, "{},{}", number, text.join(","))?;
        }
    }
    std::fs::write(folder.join("rows.csv"), rows)?;
    let cost = objective(problem, Projection::None);
    // Inside the middle half of the box.
    let place = |(j, range): (usize, &host_fit::input::stage::Range)| {
        range.low + (0.25 + 0.5 * ((31 + j * 17) % 97) as f64 / 96.0) * range.width()
    };
    let individual: Vec<f64> = cost.bounds().iter().enumerate().map(place).collect();
    let mut unknowns = String::from("low,high,individual\n");
    for (range, x) in cost.bounds().iter().zip(&individual) {
        writeln!(unknowns, "{},{},{x}", range.low, range.high)?;
    }
    std::fs::write(folder.join("unknowns.csv"), unknowns)?;
    for kind in [SearchKind::Tlbo, SearchKind::Shtlbo] {
        let mut fitness = Vec::new();
        let seconds = median_s(5, || {
            let seed = fitness.len() as u64 + 1;
            let options = SearchOptions::new(seed, PAPER, PAPER);
            fitness.push(kind.minimize(&cost, &options).cost);
        });
        let (name, each_us) = (kind.name(), 1e6 * seconds / EVALUATIONS);
        println!("RESULT {name}_us_per_evaluation={each_us:.4}");
        println!("RESULT {name}_fitness={:.4}", median(fitness));
    }
    let cost = cost.cost(&individual);
    println!("RESULT fitness_of_individual={cost:.12}");
    Ok(())
}

fn objective<'a>(problem: &'a Problem<'a>, form: Projection) -> Objective<'a> {
    Objective::new(problem, form).expect("Model (31) has slopes")
}

/// Least squares and every search on one form of each problem: prints a line for each solver.
fn compare(
    form: Projection,
    problems: &[Problem<'_>],
    dataset: &Dataset,
    history: &mut String,
) -> Fallible<()> {
    let floors = (1..).zip(problems).map(|(seed, problem)| {
        Solver::LeastSquares.solve(problem, &SolverOptions::new(form, seed))
    });
    let floors: Vec<Solution> = floors.collect::<Result<_, _>>()?;
    let runs = problems.iter().zip(&floors);
    let runs: Vec<Run> = runs
        .map(|(problem, floor)| Run::new(problem, floor, floor, dataset))
        .collect();
    print(form, "lm", &runs);
    for kind in SearchKind::ALL {
        let mut runs = Vec::new();
        for (seed, (problem, floor)) in (1..).zip(problems.iter().zip(&floors)) {
            let options = SolverOptions {
                population: PAPER,
                generations: PAPER,
                ..SolverOptions::new(form, seed)
            };
            let found = Solver::Search(kind).solve(problem, &options)?;
            for point in &found.history {
                let p = point.p.map_or(String::new(), |p| p.to_string());
                let (form, name) = (form.name(), kind.name());
                let (evaluations, fitness) = (point.evaluations, point.best_cost);
                writeln!(history, "{form},{name},{seed},{evaluations},{fitness},{p}")?;
            }
            runs.push(Run::new(problem, &found, floor, dataset));
        }
        print(form, kind.name(), &runs);
    }
    Ok(())
}

/// One solver on one problem.
struct Run {
    /// Fitness over the rows of the problem, um, um, urad.
    fitness: f64,
    /// Evaluations until the search was at the floor.
    arrival: Option<f64>,
    /// rms over all rows of the log, zero deviations refitted, um, um, urad; `None` where the
    /// parameters cannot serve a decoder.
    rms: Option<Axes>,
}

impl Run {
    fn new(problem: &Problem<'_>, found: &Solution, floor: &Solution, dataset: &Dataset) -> Self {
        let (fitness, floor) = (problem.fitness(found.cost), problem.fitness(floor.cost));
        let is_there = |fitness: f64| fitness <= floor * (1.0 + AT_FLOOR);
        let mut points = found.history.iter();
        let arrival = match points.len() {
            0 => is_there(fitness).then_some(found.evaluations as f64),
            _ => (points.find(|point| is_there(point.best_cost)))
                .map(|point| point.evaluations as f64),
        };
        let (stage, parameters) = (problem.stage, &found.parameters);
        let parameters = FieldParameters::from_model_31(parameters, stage);
        let made = calibration(&dataset.rows, stage, problem.model.kind, &parameters);
        let set = made.and_then(|made| made.prepare(&Origin::default())).ok();
        let rms = set.map(|set| {
            let judged = Decoded::new(&set, dataset).judge(dataset, stage, Zeros::Refit);
            judged.errors.axes.map(|axis| axis.rms * 1e6)
        });
        Self {
            fitness,
            arrival,
            rms,
        }
    }
}

/// Prints a line of the table.
fn print(form: Projection, solver: &str, runs: &[Run]) {
    let fitness: Vec<f64> = runs.iter().map(|run| run.fitness).collect();
    let low = fitness.iter().copied().fold(f64::INFINITY, f64::min);
    let high = fitness.iter().copied().fold(0.0, f64::max);
    let (form, fitness, count) = (form.name(), median(fitness), runs.len());
    let sound: Vec<Axes> = runs.iter().filter_map(|run| run.rms).collect();
    let rms = match sound.len() {
        0 => "-".to_owned(),
        sound_count => {
            let axis = |axis: usize| median(sound.iter().map(|rms| rms[axis]).collect());
            let rms = [0, 1, 2].map(|k| format!("{:.3}", axis(k))).join(", ");
            match sound_count == count {
                true => rms,
                false => format!("{rms} ({sound_count} of {count})"),
            }
        }
    };
    let arrived: Vec<f64> = runs.iter().filter_map(|run| run.arrival).collect();
    let arrivals = match arrived.len() {
        0 => format!("0 of {count}"),
        seeds => format!("{seeds} of {count}, {:.0} evaluations", median(arrived)),
    };
    println!("| {form} | {solver} | {fitness:.3} ({low:.3} to {high:.3}) | {rms} | {arrivals} |");
}
