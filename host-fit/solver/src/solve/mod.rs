//! How a problem is solved: least squares, SHTLBO and its relatives, by one function.
//!
//! | module | what it holds |
//! |---|---|
//! | [`objective`] | the fitness as a cost function of a search |
//! | [`search`] | SHTLBO and its ablations, for any cost function |
//! | [`by_search`] | a search on the fitness |
//!
//! ```
//! # use hallstage_input::shipped::STAGE_TOML;
//! # use hallstage_input::stage::Stage;
//! # let stage = Stage::from_toml(STAGE_TOML, "stage.toml".as_ref())?;
//! # use hallstage_input::log::{self, ReadOptions};
//! # use hallstage_input::shipped::LOG_GZ;
//! # let reading = log::read_bytes(LOG_GZ, "paper.csv.gz".as_ref(), &stage, &ReadOptions::FIT)?;
//! # let dataset = reading.dataset;
//! # use hallstage_solver::estimator::problem::Problem;
//! # use hallstage_solver::estimator::draw::{Draw, draw_rows};
//! # use hallstage_solver::estimator::model::Model;
//! # let rows = draw_rows(&dataset, 200, Draw::Stratified, 1);
//! # let problem = Problem::new(&dataset, &rows, &stage, Model::from_kind(runtime::ModelKind::M31));
//! use hallstage_solver::solve::{Projection, Solver, SolverOptions};
//!
//! let options = SolverOptions::new(Projection::Linear, 1);
//! let solution = Solver::LeastSquares.solve(&problem, &options)?;
//! assert!(problem.fitness(solution.cost) < 1.4); // um, um, urad
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod by_search;
pub mod objective;
pub mod search;

use crate::estimator::least_squares;
use crate::estimator::paper::Parameters;
use crate::estimator::problem::Problem;
use hallstage_input::watch::Watch;
use search::kind::SearchKind;
use search::run::{Checkpoint, StopReason};
use std::time::{Duration, Instant};

/// How much of the problem is solved in closed form.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Projection {
    /// No part: every zero deviation is an unknown of its own, within its range (the paper).
    None,
    /// The zero deviations.
    Delta,
    /// Everything linear: the gain G and one offset for each movement. The ratios of the slopes to
    /// eta are left, nine for Model (31).
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

/// A way to find the parameters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Solver {
    /// Least squares: the best result.
    LeastSquares,
    /// A search.
    Search(SearchKind),
}

impl Solver {
    /// All of them, the default first.
    pub fn all() -> impl Iterator<Item = Self> {
        let searches = SearchKind::ALL.map(Self::Search);
        [Self::LeastSquares].into_iter().chain(searches)
    }

    /// The name on the command line and in reports.
    pub const fn name(self) -> &'static str {
        match self {
            Self::LeastSquares => "lm",
            Self::Search(kind) => kind.name(),
        }
    }

    /// Finds parameters of low cost.
    ///
    /// # Errors
    /// See [`SolveError`].
    pub fn solve(
        self,
        problem: &Problem<'_>,
        options: &SolverOptions,
    ) -> Result<Solution, SolveError> {
        let started = Instant::now();
        let mut solution = match self {
            Self::LeastSquares => least_squares::solve(problem, None)?,
            Self::Search(kind) => by_search::solve(kind, problem, options)?,
        };
        solution.elapsed = started.elapsed();
        Ok(solution)
    }
}

/// Settings of a solver besides the problem.
#[derive(Clone, Debug)]
pub struct SolverOptions {
    /// How much is projected out.
    pub projection: Projection,
    /// Seed of everything random.
    pub seed: u64,
    /// Individuals and generations of a population: see [`by_search::default_size`].
    pub population: usize,
    /// Generations of a population.
    pub generations: usize,
    /// Shows how far a search is, and can end it: it keeps the best so far.
    pub watch: Watch<'static>,
}

impl SolverOptions {
    /// The usual size of a population for a form, watched by nobody.
    pub const fn new(projection: Projection, seed: u64) -> Self {
        let (population, generations) = by_search::default_size(projection);
        Self {
            projection,
            seed,
            population,
            generations,
            watch: Watch::NONE,
        }
    }
}

/// What a solver found.
#[derive(Clone, Debug, PartialEq)]
pub struct Solution {
    /// The parameters.
    pub parameters: Parameters,
    /// The solver's own zero deviation of each movement of the log, m; zero where the model has
    /// none or the movement had no row.
    pub delta_m: Vec<[f64; 3]>,
    /// Sum of squared errors over the problem's rows by their weights, um^2.
    pub cost: f64,
    /// Evaluations of the cost.
    pub evaluations: u64,
    /// The course of the search, the first population and every generation; empty without one.
    pub history: Vec<Checkpoint>,
    /// Time that the solver took.
    pub elapsed: Duration,
    /// Why it stopped.
    pub stopped: Stopped,
}

/// Why a solver stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stopped {
    /// At the minimum.
    Converged,
    /// No further step lowers the cost.
    NoLowerCost,
    /// At the maximum of the posterior of the field model, after a fit of Model (31).
    FieldModel {
        /// Gauss-Newton steps.
        steps: u32,
    },
    /// A search stopped.
    Search {
        /// Why.
        reason: StopReason,
        /// Evaluations that gave NaN.
        nan_costs: usize,
        /// All evaluations.
        evaluations: usize,
    },
}

/// Why a solver gave nothing.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SolveError {
    /// The signals of the three probes do not span three dimensions.
    #[error("the signals do not span three dimensions")]
    NoPlanarMotion,
    /// No start led anywhere.
    #[error("no start has a finite cost")]
    NoUsableStart,
    /// The solver does not know this form of the problem.
    #[error("{solver} cannot solve model ({model}) in the form {projection}")]
    Unsupported {
        /// Name of the solver.
        solver: &'static str,
        /// Name of the model.
        model: &'static str,
        /// The form asked for.
        projection: &'static str,
    },
}
