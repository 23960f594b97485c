use super::*;
use crate::solve::Solver;
use crate::solve::objective::sample_for_tests::{dataset, problem, stage};
use runtime::ModelKind;

fn options(projection: Projection, generations: usize) -> SolverOptions {
    SolverOptions {
        population: 30,
        generations,
        ..SolverOptions::new(projection, 1)
    }
}

const SHTLBO: Solver = Solver::Search(SearchKind::Shtlbo);

#[test]
fn shtlbo_on_the_linear_form_finds_the_least_squares_optimum() {
    let (stage, dataset) = (stage(), dataset(40, 5));
    let problem = problem(&dataset, &stage, ModelKind::M31);
    let options = options(Projection::Linear, 300);
    let exact = Solver::LeastSquares
        .solve(&problem, &options)
        .expect("a fit");
    for seed in 1..=3 {
        let options = SolverOptions {
            seed,
            ..options.clone()
        };
        let found = SHTLBO.solve(&problem, &options).expect("a fit");
        assert!((found.cost / exact.cost - 1.0).abs() < 1e-6, "seed {seed}");
        for (have, want) in found.delta_m.iter().zip(&exact.delta_m) {
            for (have, want) in have.iter().zip(want) {
                assert!((have - want).abs() < 2e-9);
            }
        }
    }
}

/// Model (12) too, which its ranges hold.
#[test]
fn the_finish_makes_every_seed_end_at_the_least_squares_optimum() {
    let (stage, dataset) = (stage(), dataset(40, 30));
    for model in [
        ModelKind::M12,
        ModelKind::M15,
        ModelKind::M30,
        ModelKind::M31,
    ] {
        let problem = problem(&dataset, &stage, model);
        let options = options(Projection::Linear, 100);
        let exact = Solver::LeastSquares
            .solve(&problem, &options)
            .expect("a fit");
        for seed in 1..=3 {
            let options = SolverOptions {
                seed,
                ..options.clone()
            };
            let found = Solver::Finished.solve(&problem, &options).expect("a fit");
            assert!(
                found.cost < exact.cost * (1.0 + 1e-9) && found.cost > exact.cost * (1.0 - 1e-9),
                "{model:?}, seed {seed}: {} and {}",
                found.cost,
                exact.cost
            );
        }
    }
}

#[test]
fn the_cost_of_a_solution_is_that_of_its_own_parameters_and_zero_deviations() {
    let (stage, dataset) = (stage(), dataset(20, 5));
    let problem = problem(&dataset, &stage, ModelKind::M31);
    for projection in [Projection::None, Projection::Delta, Projection::Linear] {
        let found = Solver::Search(SearchKind::Tlbo)
            .solve(&problem, &options(projection, 60))
            .expect("a fit");
        let again = crate::solve::objective::sample_for_tests::fitness_by_the_runtime(
            &problem,
            &found.parameters,
            &found.delta_m,
        );
        let fitness = problem.fitness(found.cost);
        assert!(
            (again / fitness - 1.0).abs() < 1e-9,
            "{}: {again} and {fitness}",
            projection.name()
        );
    }
}

#[test]
fn a_gain_outside_its_box_is_kept_and_named() {
    let (mut stage, dataset) = (stage(), dataset(20, 5));
    // The truth is 0.87.
    let mut eta = stage.search.of("eta").expect("known");
    eta[0].low = 0.9;
    stage.search.set("eta", eta);
    let problem = problem(&dataset, &stage, ModelKind::M31);
    let found = SHTLBO
        .solve(&problem, &options(Projection::Linear, 300))
        .expect("a fit");
    assert!((found.parameters.eta()[0] - 0.87).abs() < 0.01);
    let names = found.at_limit.iter().map(|id| id.name());
    assert_eq!(names.collect::<Vec<_>>(), ["eta_a"]);
}

#[test]
fn a_form_without_unknowns_is_refused_with_what_to_do() {
    let (stage, dataset) = (stage(), dataset(20, 5));
    let problem = problem(&dataset, &stage, ModelKind::M30);
    let refused = SHTLBO.solve(&problem, &options(Projection::Linear, 1));
    assert!(matches!(
        refused,
        Err(SolveError::Unsupported { model: "30", .. })
    ));
}
