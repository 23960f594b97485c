//! Which settings of a fit go together: only least squares has weights, and the field model has one way to
//! be fitted.

use super::arguments::{blob_text, choice, train};
use crate::calibrate::{ErrorLimits, FitOrder};
use clap::{Args, Command, FromArgMatches};
use hallstage_calibration::fit::{FitSettings, ModelChoice};
use hallstage_input::watch::Watch;
use hallstage_solver::estimator::draw::Draw;
use hallstage_solver::estimator::robust::Loss;
use hallstage_solver::solve::{Projection, Solver, SolverOptions};
use runtime::ModelKind;
use runtime::parameters::Text;

/// A setting that does not go with the others.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{argument}: {problem}")]
pub struct Mismatch {
    /// Which: `loss`, `solver` or `project`.
    pub argument: &'static str,
    /// Why, and what to do.
    pub problem: String,
}

/// How a fit is made: the options of `host-fit fit`, and the arguments of `hallstage.fit`.
#[derive(Clone, Debug, Args)]
pub struct FitOptions {
    /// Measurement model.
    #[arg(long, value_name = "MODEL", value_parser = choice::<ModelChoice>(), default_value = "auto")]
    pub model: ModelChoice,
    /// Solver: `lm` is least squares, the others are the searches of the paper.
    #[arg(long, value_name = "NAME", value_parser = choice::<Solver>(), default_value = Solver::LeastSquares.name())]
    pub solver: Solver,
    /// How much of the problem is solved in closed form.
    #[arg(long, value_parser = choice::<Projection>(), default_value = "linear")]
    pub project: Projection,
    /// How much rows count that the model does not explain.
    #[arg(long, value_name = "NAME", value_parser = choice::<Loss>())]
    pub loss: Option<Loss>,
    /// Rows to fit: `all` or a number.
    #[arg(long, value_name = "N|all", default_value = "all", value_parser = train)]
    pub train: std::option::Option<usize>,
    /// How rows are drawn.
    #[arg(long, value_parser = choice::<Draw>(), default_value = "stratified")]
    pub draw: Draw,
    /// Individuals of a search: 100 as in the paper, or 16 with --project linear.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(4..=100_000))]
    pub population: Option<u32>,
    /// Generations of a search: 100 as in the paper; with --project linear at most 1000,
    /// fewer once the fitness hardly falls any more.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=10_000_000))]
    pub generations: Option<u32>,
    /// Seed of everything random.
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u64,
    /// Serial number of the stage, for the blob; at most 32 bytes.
    #[arg(long, value_name = "TEXT", value_parser = blob_text)]
    pub serial: Option<Text>,
    /// Largest rms errors, of the field model in service, of others over all rows; beyond, no blob is
    /// written.
    #[arg(long, value_name = "x=1.5um,...")]
    pub limit: Option<ErrorLimits>,
    /// Write the blob of a log that is refused, or of a fit beyond --limit; the blob says so. Replace any file.
    #[arg(long)]
    pub force: bool,
}

impl FitOptions {
    /// Reads words of a command line.
    ///
    /// # Errors
    /// What is wrong with which option.
    pub fn from_words(words: Vec<String>) -> Result<Self, String> {
        let command = Self::augment_args(Command::new("fit").no_binary_name(true));
        let matches = command.try_get_matches_from(words);
        let read = matches.and_then(|matches| Self::from_arg_matches(&matches));
        read.map_err(|error| {
            let text = error.to_string();
            let said = text.strip_prefix("error: ").unwrap_or(&text);
            said.split("\n\n").next().unwrap_or(said).to_owned()
        })
    }

    /// The fit that they ask for.
    ///
    /// # Errors
    /// `Mismatch` where options do not go together.
    pub fn order(&self, created: Text, watch: Watch<'static>) -> Result<FitOrder, Mismatch> {
        let usual = SolverOptions::new(self.project, self.seed);
        let options = SolverOptions {
            population: self.population.map_or(usual.population, |n| n as usize),
            generations: self.generations.map_or(usual.generations, |n| n as usize),
            watch,
            ..usual
        };
        Ok(FitOrder {
            settings: FitSettings {
                model: self.model,
                train: self.train,
                draw: self.draw,
                solver: self.solver,
                loss: self.loss()?,
                options,
                serial: self.serial.clone().unwrap_or_default(),
                created,
                force: self.force,
            },
            limits: self.limit.unwrap_or_default(),
            is_kept: true,
        })
    }

    /// The loss that is asked for, else the usual one of the solver.
    fn loss(&self) -> Result<Loss, Mismatch> {
        let Self {
            model,
            solver,
            loss,
            project,
            ..
        } = *self;
        let is_field = matches!(model, ModelChoice::Named(model) if model.kind == ModelKind::Field);
        let (argument, problem) = match (solver, loss) {
            (Solver::Search(_), Some(Loss::Huber | Loss::Cauchy)) => (
                "loss",
                format!(
                    "a search counts all rows alike: leave --solver {} out, or take --loss none",
                    solver.name()
                ),
            ),
            (Solver::Search(_), _) if is_field => (
                "solver",
                "--model field has a solver of its own; leave --solver out".to_owned(),
            ),
            _ if is_field && project != Projection::Linear => (
                "project",
                "--model field has a projection of its own; leave --project out".to_owned(),
            ),
            (_, Some(loss)) => return Ok(loss),
            (Solver::Search(_), None) => return Ok(Loss::None),
            (Solver::LeastSquares, None) => return Ok(Loss::Cauchy),
        };
        Err(Mismatch { argument, problem })
    }
}
