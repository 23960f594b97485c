//! What every solver takes and gives.

pub mod least_squares;
pub mod objective;
pub mod search;
pub mod search_solver;

use crate::problem::Problem;
use crate::problem::parameters::{ParameterId, Parameters};
use std::time::Duration;

/// How much of the problem is solved in closed form.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Projection {
    /// Nothing: every zero deviation is an unknown of its own, within its range (the paper).
    None,
    /// The zero deviations.
    Delta,
    /// Everything linear: the gain G and one offset for each movement. Nine unknowns are left.
    Linear,
}

impl Projection {
    /// Its name on the command line and in JSON.
    pub const fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Delta => "delta",
            Self::Linear => "linear",
        }
    }
}

/// What a solver is told besides the problem.
#[derive(Clone, Debug, PartialEq)]
pub struct SolverOptions {
    /// How much is projected out.
    pub projection: Projection,
    /// Seed of everything random.
    pub seed: u64,
    /// Individuals of a population; ignored by solvers without one.
    pub population: usize,
    /// Generations of a population; ignored by solvers without one.
    pub generations: usize,
}

/// What a solver found.
#[derive(Clone, Debug, PartialEq)]
pub struct Solution {
    /// The parameters.
    pub parameters: Parameters,
    /// The solver's own zero deviation of each movement of the log, m; zero where the model has
    /// none or the movement had no row.
    pub delta_m: Vec<[f64; 3]>,
    /// Weighted sum of squared errors over the problem's rows, um^2.
    pub cost: f64,
    /// Evaluations of the cost.
    pub evaluations: u64,
    /// Time that the solver took.
    pub elapsed: Duration,
    /// Why it stopped, for the report.
    pub stopped: String,
    /// Parameters that stand at an end of their search range.
    pub at_limit: Vec<ParameterId>,
}

/// Why a solver gave nothing.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SolveError {
    /// The signals of the three probes do not span three dimensions.
    #[error(
        "the log does not move the stage in X, Y and Rz independently, so the three probes cannot \
         be told apart: record movements along each of the three axes"
    )]
    NoPlanarMotion,
    /// No start led anywhere.
    #[error(
        "no start of the search could be evaluated: every one put a row next to a pole of 1/phi or \
         made PM singular. Check the search ranges in stage.toml against the vertical motion in the log"
    )]
    NoUsableStart,
    /// The solver does not know this form of the problem.
    #[error("solver {solver} cannot solve model ({model}) with --project {projection}: {reason}")]
    Unsupported {
        /// Name of the solver.
        solver: &'static str,
        /// Equation of the model.
        model: u8,
        /// The form asked for.
        projection: &'static str,
        /// What to do instead.
        reason: &'static str,
    },
}

/// A way to find the parameters.
pub trait Solver {
    /// Name on the command line and in reports.
    fn name(&self) -> &'static str;
    /// Finds parameters of low cost.
    ///
    /// # Errors
    /// See [`SolveError`].
    fn solve(&self, problem: &Problem, options: &SolverOptions) -> Result<Solution, SolveError>;
}
