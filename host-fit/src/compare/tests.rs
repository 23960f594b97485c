use super::table::{Spread, table};
use super::*;
use hallstage_input::log::{ReadOptions, read_bytes};
use hallstage_input::shipped::{self, LOG_GZ};

#[test]
fn an_interrupt_ends_a_comparison_with_what_there_is() {
    let stage = shipped::stage();
    let log = read_bytes(LOG_GZ, "log".as_ref(), &stage, &ReadOptions::default());
    let comparison = Comparison {
        forms: vec![Projection::Linear],
        searches: vec![SearchKind::Shtlbo, SearchKind::Random],
        seeds: 2,
        train: Some(200),
        draw: Draw::Stratified,
        evaluations: 400,
        population: 30,
    };
    let stop = AtomicBool::new(false);
    let set = |run: &Run| stop.store(run.solver == "shtlbo", Ordering::Relaxed);
    let dataset = log.expect("sound").dataset;
    let runs = compare(&dataset, &stage, &comparison, &stop, set).expect("a floor");
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
