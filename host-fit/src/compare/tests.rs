use super::curves::{Course, history_csv, plot, runs_csv};
use super::table::{Spread, table};
use super::*;
use crate::input::shipped::STAGE_TOML;
use crate::judge::identify::FitFailure;
use crate::problem::parameters::Parameters;
use crate::simulate::protocol::TABLE_6;
use runtime::model::Sensitivity;
use synthetic::Protocol;

#[path = "../../solver/src/problem/synthetic_for_tests.rs"]
mod synthetic;

/// Twelve movements of the paper's protocol, 12 rows each, with noise and zero deviations.
fn log() -> (Stage, Dataset) {
    let stage = Stage::from_toml(STAGE_TOML, "stage.toml".as_ref()).expect("sound");
    let probe = |eta, per_z_m, per_rx_rad, per_ry_rad| Sensitivity {
        eta,
        per_z_m,
        per_rx_rad,
        per_ry_rad,
    };
    let truth = Parameters::of_model_31(
        &Parameters::designed(&stage).geometry(),
        &[
            probe(0.87, -190.0, -70.0, 15.0),
            probe(0.70, -160.0, -57.0, -55.0),
            probe(0.86, -180.0, -63.0, 13.0),
        ],
    );
    let protocol = Protocol {
        settings: [1, 8, 13, 2].map(|k| TABLE_6[k]).to_vec(),
        hall_noise_m: 0.5e-6,
        zero_deviation_m: 4e-6,
        ..Protocol::exact(truth, 12)
    };
    let dataset = protocol.dataset(&stage);
    (stage, dataset)
}

fn comparison() -> Comparison {
    Comparison {
        forms: vec![Projection::None, Projection::Linear],
        searches: vec![SearchKind::Shtlbo, SearchKind::Random],
        seeds: 2,
        train: Some(60),
        draw: Draw::Stratified,
        evaluations: 12_000,
        population: 30,
    }
}

#[test]
fn every_solver_runs_on_every_form_with_every_seed_at_equal_evaluations() {
    let (stage, dataset) = log();
    let go_on = AtomicBool::new(false);
    let mut told = 0;
    let runs = compare(&dataset, &stage, &comparison(), &go_on, |_| told += 1).expect("a floor");
    assert_eq!((runs.len(), told), (2 * 3 * 2, 12));
    for run in &runs {
        assert!(run.fitness >= run.floor * (1.0 - 1e-6), "{run:?}");
        if run.solver != LEAST_SQUARES {
            assert!((12_000..12_060).contains(&run.evaluations));
        }
    }
    let of = |solver| {
        let mut both = runs
            .iter()
            .filter(move |run| run.form == Projection::Linear);
        move || both.find(|run| run.solver == solver).expect("two runs")
    };
    let (mut floors, mut shtlbo, mut random) = (of(LEAST_SQUARES), of("shtlbo"), of("random"));
    for _ in 0..2 {
        let (floor, shtlbo, random) = (floors(), shtlbo(), random());
        assert!(
            shtlbo.evaluations_to(EXACT).expect("exact")
                > shtlbo.evaluations_to(ARRIVED).expect("arrived")
        );
        assert!(random.evaluations_to(ARRIVED).is_none() && random.fitness > shtlbo.fitness);
        let x = |run: &Run| run.rms.expect("decodes")[0];
        assert!(x(shtlbo) < 1.05 * x(floor));
    }

    let table = table(&runs);
    assert_eq!(table.lines().count(), 2 + 6);
    assert!(table.contains("| linear | shtlbo | eqs 23, 24, 27-29 |"));
    assert!(table.contains("| 2 of 2, ") && table.contains("| 2 of 2 | 0 of 2 | 0 of 2 |"));
    assert_eq!(runs_csv(&runs).lines().count(), 1 + 12);
    let generations: usize = runs.iter().map(|run| run.history.len()).sum();
    assert_eq!(history_csv(&runs).lines().count(), 1 + generations);
    let convergence = plot(&runs, Projection::Linear, Course::Convergence);
    assert!(convergence.contains("shtlbo") && convergence.contains("random"));
    let p = plot(&runs, Projection::None, Course::P);
    assert!(p.contains("shtlbo") && !p.contains("random"));
}

#[test]
fn an_interrupt_ends_a_comparison_with_what_there_is() {
    let (stage, dataset) = log();
    let stop = AtomicBool::new(false);
    let set = |run: &Run| stop.store(run.solver == "shtlbo", Ordering::Relaxed);
    let runs = compare(&dataset, &stage, &comparison(), &stop, set).expect("a floor");
    assert_eq!(runs.len(), 3);
}

#[test]
fn the_table_counts_the_seeds_whose_errors_it_shows() {
    let run = |seed, rms| Run {
        form: Projection::None,
        solver: "pso",
        seed,
        fitness: 9.0,
        floor: 1.0,
        evaluations: 400,
        nan_costs: 0,
        elapsed_s: 2.0,
        rms,
        history: Vec::new(),
    };
    let runs = [run(1, None), run(2, Some([2.0, 3.0, 4.0])), run(3, None)];
    assert!(table(&runs).contains("| 4.000 (4.000 to 4.000) | 1 of 3 |"));
}

#[test]
fn fewer_rows_than_unknowns_are_refused() {
    // The floor of such a comparison would be that of noise, or of nothing.
    let (stage, dataset) = log();
    let few = Comparison {
        train: Some(17),
        ..comparison()
    };
    let go_on = AtomicBool::new(false);
    let refused = compare(&dataset, &stage, &few, &go_on, |_| ());
    assert!(matches!(
        refused,
        Err(FitError::Failed(FitFailure::TooFewRows { rows: 17, .. }))
    ));
}

#[test]
fn arrival_is_the_first_generation_within_one_percent_of_the_floor() {
    let point = |evaluations, best_cost| Checkpoint {
        evaluations,
        best_cost,
        p: None,
    };
    let mut run = Run {
        form: Projection::None,
        solver: "shtlbo",
        seed: 1,
        fitness: 1.0,
        floor: 1.0,
        evaluations: 400,
        nan_costs: 0,
        elapsed_s: 2.0,
        rms: None,
        history: vec![
            point(100, 3.0),
            point(200, 1.02),
            point(300, 1.009),
            point(400, 1.0),
        ],
    };
    assert_eq!(run.evaluations_to(ARRIVED), Some(300));
    assert_eq!(run.seconds_per_evaluation(), 0.005);
    assert_eq!(run.evaluations_to(EXACT), Some(400));
    run.floor = 0.9;
    assert_eq!(run.evaluations_to(ARRIVED), None);
}

#[test]
fn medians_are_those_of_sorted_numbers() {
    let spread = Spread::of([3.0, 1.0, 2.0, 10.0]).expect("numbers");
    assert_eq!((spread.median, spread.low, spread.high), (2.5, 1.0, 10.0));
    assert_eq!(Spread::of([5.0]).expect("a number").median, 5.0);
    assert_eq!(Spread::of([]), None);
    for nan in [f64::NAN, -f64::NAN] {
        let spread = Spread::of([nan, 2.0, 1.0]).expect("numbers");
        assert_eq!((spread.median, spread.low), (2.0, 1.0));
        assert!(spread.high.is_nan());
    }
}
