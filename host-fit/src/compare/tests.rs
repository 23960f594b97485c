use super::curves::{Course, history_csv, plot, runs_csv};
use super::summary::{Spread, summaries, table};
use super::*;
use crate::judge::identify::FitFailure;
use crate::solve::objective::sample;

fn comparison() -> Comparison {
    Comparison {
        forms: vec![
            Case::Model31(Projection::None),
            Case::Model31(Projection::Linear),
        ],
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
    let (stage, dataset) = (sample::stage(), sample::dataset(12, 12));
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
    let summaries = summaries(&runs);
    assert_eq!(summaries.len(), 6);
    let of = |form, solver| {
        let same = |s: &&summary::Summary| s.form == form && s.solver == solver;
        summaries.iter().find(same).expect("a summary")
    };
    let shtlbo = of(Case::Model31(Projection::Linear), "shtlbo");
    assert_eq!(
        (shtlbo.arrived.seeds, shtlbo.exact.seeds, shtlbo.seeds),
        (2, 2, 2)
    );
    assert!(shtlbo.exact.evaluations > shtlbo.arrived.evaluations);
    let random = of(Case::Model31(Projection::Linear), "random");
    assert!(random.arrived.seeds == 0 && random.fitness.median > shtlbo.fitness.median);
    let floor = of(Case::Model31(Projection::Linear), LEAST_SQUARES);
    assert!(shtlbo.rms[0].expect("decodes").median < 1.05 * floor.rms[0].expect("decodes").median);

    let table = table(&summaries);
    assert_eq!(table.lines().count(), 2 + 6);
    assert!(table.contains("| linear | shtlbo | eqs 23, 24, 27-29 |"));
    assert_eq!(runs_csv(&runs).lines().count(), 1 + 12);
    let generations: usize = runs.iter().map(|run| run.history.len()).sum();
    assert_eq!(history_csv(&runs).lines().count(), 1 + generations);
    let convergence = plot(
        &runs,
        Case::Model31(Projection::Linear),
        Course::Convergence,
    )
    .expect("a plot");
    assert!(convergence.contains("shtlbo") && convergence.contains("random"));
    let p = plot(&runs, Case::Model31(Projection::None), Course::P).expect("a plot");
    assert!(p.contains("shtlbo") && !p.contains("random"));
}

#[test]
fn an_interrupt_ends_a_comparison_with_what_there_is() {
    let (stage, dataset) = (sample::stage(), sample::dataset(12, 12));
    let stop = AtomicBool::new(false);
    let set = |run: &Run| stop.store(run.solver == "shtlbo", Ordering::Relaxed);
    let runs = compare(&dataset, &stage, &comparison(), &stop, set).expect("a floor");
    assert_eq!(runs.len(), 3);
}

#[test]
fn the_table_counts_the_seeds_whose_errors_it_shows() {
    let run = |seed, rms| Run {
        form: Case::Model31(Projection::None),
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
    let summaries = summaries(&runs);
    assert_eq!((summaries[0].decoded, summaries[0].seeds), (1, 3));
    assert!(table(&summaries).contains("| 4.000 (4.000 to 4.000) | 1 of 3 |"));
}

#[test]
fn fewer_rows_than_unknowns_are_refused() {
    // The floor of such a comparison would be that of noise, or of nothing.
    let (stage, dataset) = (sample::stage(), sample::dataset(12, 12));
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
        form: Case::Model31(Projection::None),
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
    assert_eq!(run.seconds_to(ARRIVED), Some(1.5));
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
