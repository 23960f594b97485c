use super::*;
use crate::estimator::least_squares::at_limit;
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

/// SHTLBO on the linear form of Model (31).
#[test]
fn every_seed_ends_at_the_least_squares_optimum() {
    let (stage, dataset) = (stage(), dataset(40, 5));
    let problem = problem(&dataset, &stage, ModelKind::M31);
    let options = options(Projection::Linear, 300);
    let solve = |solver: Solver, seed| {
        let options = options.clone();
        solver
            .solve(&problem, &SolverOptions { seed, ..options })
            .expect("a fit")
    };
    let exact = solve(Solver::LeastSquares, 1);
    for seed in 1..=3 {
        let found = solve(SHTLBO, seed);
        let off = found.cost / exact.cost - 1.0;
        assert!(off.abs() < 1e-6, "seed {seed}: {off:e}");
        let deltas = found.delta_m.iter().zip(&exact.delta_m);
        let deltas = deltas.flat_map(|(have, want)| have.iter().zip(want));
        assert!({ deltas }.all(|(have, want)| (have - want).abs() < 2e-9));
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
    let mut eta = stage.search.get("eta").expect("known");
    eta[0].low = 0.9;
    stage.search.set("eta", eta);
    let problem = problem(&dataset, &stage, ModelKind::M31);
    let found = SHTLBO
        .solve(&problem, &options(Projection::Linear, 300))
        .expect("a fit");
    assert!((found.parameters.eta()[0] - 0.87).abs() < 0.01);
    let names = at_limit(problem.stage, problem.model, &found.parameters)
        .into_iter()
        .map(|id| id.name());
    assert_eq!(names.collect::<Vec<_>>(), ["eta_a"]);
}
