//! Runs on the field model: the fit by maximum a posteriori, whose fitness is the floor, and the
//! searches.

use super::{Case, Job, LEAST_SQUARES, Run, rms_of};
use crate::fit::{FitError, field_calibration};
use crate::input::dataset::Dataset;
use crate::problem::Problem;
use crate::solve::field::blocks::Rows;
use crate::solve::field::fit::fit_field;
use crate::solve::field::search::FieldCost;
use crate::solve::{Projection, SolveError, Solver, SolverOptions};
use std::time::Instant;

/// White noise of a probe that is assumed where the prior is weighed, mm: that of the stages which
/// it was made for. The searches know no better.
const WHITE_MM: [f64; 3] = [5e-4; 3];

fn cost<'a>(
    dataset: &Dataset,
    rows: &[usize],
    problem: &'a Problem<'a>,
) -> Result<FieldCost<'a>, FitError> {
    let rows = Rows::new(dataset, rows).rows;
    Ok(FieldCost::new(problem, rows, WHITE_MM).ok_or(SolveError::NoUsableStart)?)
}

/// The fit of `host-fit fit --model field`, from Model (31) by least squares.
pub(super) fn least_squares(
    dataset: &Dataset,
    rows: &[usize],
    problem: &Problem<'_>,
    seed: u64,
) -> Result<Run, FitError> {
    let started = Instant::now();
    let options = SolverOptions::new(Projection::Linear, seed);
    let start = Solver::LeastSquares.solve(problem, &options)?;
    let fit = fit_field(dataset, rows, problem.stage, &start.parameters)?;
    let elapsed_s = started.elapsed().as_secs_f64();
    let cost = cost(dataset, rows, problem)?;
    let fitness = cost.fitness(&fit.parameters.model_31());
    let calibration = field_calibration(&dataset.rows, problem.stage, &fit.parameters)?;
    Ok(Run {
        form: Case::Field,
        solver: LEAST_SQUARES,
        seed,
        fitness,
        floor: fitness,
        evaluations: fit.iterations as usize,
        nan_costs: 0,
        elapsed_s,
        rms: rms_of(dataset, problem.stage, &calibration),
        history: Vec::new(),
    })
}

impl Job<'_> {
    /// On the field model.
    pub(super) fn of_field(
        &self,
        dataset: &Dataset,
        rows: &[usize],
        problem: &Problem<'_>,
    ) -> Result<Option<Run>, FitError> {
        let cost = cost(dataset, rows, problem)?;
        let first = cost.first_population(self.comparison.population, self.seed);
        let (found, run) = self.run(Case::Field, &cost, &first);
        let calibration = cost
            .parameters(&found.best)
            .map(|parameters| field_calibration(&dataset.rows, problem.stage, &parameters));
        Ok(Some(Run {
            rms: calibration
                .and_then(|calibration| rms_of(dataset, problem.stage, &calibration.ok()?)),
            ..run
        }))
    }
}
