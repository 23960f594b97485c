//! The main job: a dataset to a judged calibration.
//!
//! dataset -> rows drawn -> problem -> solver -> standard errors -> parameter set -> judgement.
//! Nothing is written here.

mod calibration;
mod compensate;
mod cross_validation;
mod error;
mod field;
mod settings;
mod warning;
mod whole;

pub(crate) use calibration::RANGE_MARGIN;
pub use calibration::calibration;
pub use compensate::fit_compensated;
pub use cross_validation::{CrossValidation, Split, cross_validate};
pub use error::FitError;
use field::FirstPhase;
pub use field::field_calibration;
pub use settings::{FitSettings, ModelChoice};
pub use warning::FitWarning;

use crate::input::dataset::{Dataset, Row};
use crate::input::stage::Stage;
use crate::judge::identify::{check_described, check_determined, check_motion};
use crate::judge::lag::{ReferenceLag, reference_lag};
use crate::judge::left_out::{Block, LeftOut};
use crate::judge::statistics::PoseError;
use crate::judge::stretches::Stretch;
use crate::judge::uncertainty::uncertainty;
use crate::judge::whole::WholeJudgement;
use crate::judge::{Decoded, Judgement, Zeros};
use crate::problem::Problem;
use crate::problem::draw::draw_rows;
use crate::problem::model::{COUNT, Model};
use crate::solve::field::blocks::Rows;
use crate::solve::field::error::FieldFitError;
use crate::solve::field::fit::FieldFit;
use crate::solve::robust::{HALF, Loss};
use crate::solve::{Projection, Solution, Solver};
use runtime::calibration::Origin;
use runtime::parameters::FitRecord;
use runtime::{Calibration, ModelKind, ParameterSet};
use std::cell::OnceCell;
use std::ops::Range;
use std::sync::Arc;

/// A calibration with everything that is known about it.
#[derive(Clone, Debug)]
pub struct Fit {
    /// The model.
    pub model: &'static Model,
    /// Why this model, in a line.
    pub model_reason: String,
    /// What the solver found; of the field model the parameters that Model (31) has too.
    pub solution: Solution,
    /// Standard errors of these; `None` as in
    /// [`Uncertainty`](crate::judge::uncertainty::Uncertainty).
    pub standard_error: [Option<f64>; COUNT],
    /// Pairs of parameters whose estimates are correlated by more than
    /// [`CORRELATION_TOLD`](crate::judge::uncertainty::CORRELATION_TOLD).
    pub correlations: Vec<(String, String, f64)>,
    /// All of a fit of the field model.
    pub field: Option<FieldFit>,
    /// By how much the reference lags behind the probes, fitted with the parameters; `None` where
    /// nothing in the log shows it.
    pub lag: Option<ReferenceLag>,
    /// The calibration in `f64`.
    pub calibration: Calibration,
    /// What goes into the blob.
    pub set: ParameterSet,
    /// Fitness over the rows that the fit used, by their weights, with the solver's own zero deviations.
    pub train_fitness: f64,
    /// Rows that the fit used.
    pub train_rows: usize,
    /// The loss that their weights are by.
    pub loss: Loss,
    /// Those of them that count less than half, as the loss says: row numbers, ascending.
    pub outliers: Vec<usize>,
    /// How many these are and where; of an excerpt, those of all rows whose errors are beyond any that
    /// the fit kept.
    pub left_out: LeftOut,
    /// All rows, decoded by the target's decoder.
    pub decoded: Decoded,
    /// Over all rows, by the target's decoder; zero deviations refitted where the model has them.
    pub judgement: Judgement,
    /// Errors over the rows that are no outliers.
    pub sound: PoseError,
    /// Over all rows, with the solver's own zero deviations.
    pub judgement_solver_zeros: Judgement,
    /// Of a dataset that is an excerpt: errors over all rows of the logs, which the blob records.
    pub whole: Option<WholeJudgement>,
    /// Of such a dataset: the seconds of the logs whose errors are far above the rest, the worst first.
    pub stretches: Vec<Stretch>,
    /// What the user should know.
    pub warnings: Vec<FitWarning>,
}

/// Fits, checks and judges.
///
/// # Errors
/// See [`FitError`].
pub fn fit(dataset: &Dataset, stage: &Stage, settings: &FitSettings) -> Result<Fit, FitError> {
    let job = Job::new(dataset, stage, settings);
    let mut fit = match settings.model {
        ModelChoice::Auto => job.best()?,
        ModelChoice::Named(model) => job.of_model(model)?,
    };
    if let Some(lag) = &fit.lag {
        fit.warnings
            .extend(FitWarning::of_lag(lag, stage.servo_period_s));
    }
    fit.judge_whole(dataset, stage, settings)?;
    Ok(fit)
}

impl Fit {
    /// The errors over all rows of the logs, if the dataset is an excerpt: those that count.
    pub fn errors(&self) -> &PoseError {
        match &self.whole {
            Some(whole) => &whole.errors,
            None => &self.judgement.errors,
        }
    }
}

/// What every model of a log is fitted with.
struct Job<'a> {
    dataset: &'a Dataset,
    stage: &'a Stage,
    settings: &'a FitSettings,
    /// The rows to use.
    selected: Vec<usize>,
    /// See [`Job::first_phase`].
    first: OnceCell<Result<FirstPhase, FitError>>,
}

impl<'a> Job<'a> {
    fn new(dataset: &'a Dataset, stage: &'a Stage, settings: &'a FitSettings) -> Self {
        let count = settings.train.unwrap_or(dataset.rows.len());
        Self {
            selected: draw_rows(dataset, count, settings.draw, settings.options.seed),
            dataset,
            stage,
            settings,
            first: OnceCell::new(),
        }
    }

    /// The field model where the log can carry it, else Model (31).
    fn best(&self) -> Result<Fit, FitError> {
        let usual = matches!(
            self.settings.solver,
            Solver::Finished | Solver::LeastSquares
        ) && self.settings.options.projection == Projection::Linear;
        let mut unsettled = None;
        let reason = if usual {
            match self.of_model(Model::of(ModelKind::Field)) {
                Ok(fit) if fit.field.as_ref().is_some_and(|field| field.verdict.field) => {
                    return Ok(fit);
                }
                Ok(fit) => fit.model_reason,
                Err(error) => {
                    let is_stuck = matches!(error, FitError::Field(FieldFitError::Stuck { .. }));
                    unsettled = is_stuck.then_some(FitWarning::FieldUnsettled);
                    error.to_string()
                }
            }
        } else {
            "--solver and --project choose how models of the paper are fitted; the field model has a way of its own".to_owned()
        };
        let mut fit = self.of_model(Model::of(ModelKind::M31))?;
        fit.model_reason = format!("model (31): {reason}");
        fit.warnings.extend(unsettled);
        Ok(fit)
    }

    fn of_model(&self, model: &'static Model) -> Result<Fit, FitError> {
        // The lever arms, the first term, take theirs from the coordinates.
        let ranged = &model.terms[1..model.fitted];
        if let Some(term) = ranged
            .iter()
            .find(|t| self.stage.search.of(t.range_key).is_none())
        {
            return Err(FitError::NoRange {
                key: term.range_key,
                model: model.name,
            });
        }
        check_motion(self.dataset, self.stage, self.selected.len(), model)?;
        match model.kind {
            ModelKind::Field => self.of_field_model(model),
            _ => self.of_slopes(model),
        }
    }

    /// How much each row counts, and the loss that says so: none for a search alone, which has no
    /// weights, and where the field model cannot be fitted at all.
    fn weights(&self) -> (Loss, Vec<f64>) {
        let alike = || (Loss::None, vec![1.0; self.selected.len()]);
        match (self.settings.loss, self.settings.solver) {
            (Loss::None, _) | (_, Solver::Search(_)) => alike(),
            (loss, _) => match self.first_phase() {
                Ok(first) => (loss, first.field.weights.clone()),
                Err(_) => alike(),
            },
        }
    }

    /// The rows used as the field model sees them, with these weights: those of its first phase
    /// where it has the same.
    fn field_rows(&self, weights: &[f64]) -> Arc<Rows> {
        match self.first.get() {
            Some(Ok(first)) if first.field.weights == weights => Arc::clone(first.field.rows()),
            _ => Arc::new(Rows::weighted(self.dataset, &self.selected, weights)),
        }
    }

    /// The rows of the log that are no outliers.
    fn sound_rows(&self, weights: &[f64]) -> impl Iterator<Item = &Row> {
        let mut outliers = outliers(&self.selected, weights).peekable();
        let rows = self.dataset.rows.iter().enumerate();
        rows.filter(move |(row, _)| outliers.next_if_eq(row).is_none())
            .map(|(_, row)| row)
    }

    /// A model of the paper: slopes of the sensitivity at most.
    fn of_slopes(&self, model: &'static Model) -> Result<Fit, FitError> {
        let Self {
            dataset,
            stage,
            settings,
            selected,
            ..
        } = self;
        let solver = settings.solver;
        let (loss, weights) = self.weights();
        let used = selected.iter().zip(&weights).filter(|(_, w)| **w > 0.0);
        let (used, used_weights): (Vec<usize>, Vec<f64>) = used.unzip();
        let mut problem = Problem::new(dataset, &used, stage, model);
        for (row, weight) in problem.rows.iter_mut().zip(used_weights) {
            row.weight = weight;
        }
        let solution = solver.solve(&problem, &settings.options)?;
        let parameters = &solution.parameters;
        let at_pole = FitError::AtPole {
            solver: solver.name(),
        };
        let uncertainty = uncertainty(&problem, parameters, &solution.at_limit).ok_or(at_pole)?;
        let calibration = calibration(self.sound_rows(&weights), stage, model, parameters)?;
        let vertical = calibration.calibrated_vertical;
        let determined = check_determined(&problem, parameters, &uncertainty, vertical);
        let judged = self.judged(model, &calibration, &weights);
        if let Err(FitError::Unusable(_)) = judged {
            determined.clone()?;
        }
        // First this: a log that the model does not describe determines nothing, but for that reason.
        let Judged {
            set,
            decoded,
            judgement,
            sound,
        } = judged?;
        if !settings.force {
            determined?;
        }
        let own_zeros = Zeros::Given(&solution.delta_m);
        let warnings = warning::warnings(dataset, selected, &problem, &solution, &judgement);
        let train_fitness = problem.fitness(solution.cost);
        // Room for what the lag takes.
        drop(problem);
        Ok(Fit {
            model,
            model_reason: format!("model ({}): --model asks for it", model.name),
            warnings,
            train_fitness,
            train_rows: selected.len(),
            standard_error: uncertainty.standard_error,
            field: None,
            lag: reference_lag(&self.field_rows(&weights), stage, model, parameters),
            loss,
            outliers: outliers(selected, &weights).collect(),
            left_out: left_out(selected, &weights),
            correlations: uncertainty.correlations,
            judgement_solver_zeros: decoded.judge(dataset, stage, own_zeros),
            solution,
            calibration,
            set,
            decoded,
            judgement,
            sound,
            whole: None,
            stretches: Vec::new(),
        })
    }

    /// Judges a calibration, which must describe the rows that are no outliers.
    fn judged(
        &self,
        model: &'static Model,
        calibration: &Calibration,
        weights: &[f64],
    ) -> Result<Judged, FitError> {
        let (dataset, settings) = (self.dataset, self.settings);
        let origin = Origin {
            serial: settings.serial.clone(),
            created: settings.created.clone(),
            logs_sha256: dataset.sha256,
            fit: FitRecord::default(),
        };
        let mut set = calibration.prepare(&origin).map_err(FitError::Unusable)?;
        let decoded = Decoded::new(&set, dataset);
        let judgement = decoded.judge(dataset, self.stage, Zeros::of_model(model));
        let mut sound = judgement.errors;
        if outliers(&self.selected, weights).next().is_some() {
            let mut without = decoded.clone();
            for row in outliers(&self.selected, weights) {
                without.errors[row] = None;
            }
            let zeros = Zeros::of_model(model);
            sound = without.judge(dataset, self.stage, zeros).errors;
        }
        if !settings.force {
            check_described(dataset, &sound, model)?;
        }
        let axes = judgement.errors.axes;
        set.fit = FitRecord {
            rows: u32::try_from(dataset.rows.len()).unwrap_or(u32::MAX),
            train_rows: u32::try_from(self.selected.len()).unwrap_or(u32::MAX),
            rms: axes.map(|a| a.rms as f32),
            peak: axes.map(|a| a.peak as f32),
            forced: false,
        };
        Ok(Judged {
            set,
            decoded,
            judgement,
            sound,
        })
    }
}

/// The rows that count less than half.
fn outliers(selected: &[usize], weights: &[f64]) -> impl Iterator<Item = usize> {
    let light = selected.iter().zip(weights).filter(|(_, w)| **w < HALF);
    light.map(|(&row, _)| row)
}

/// How many count less than half, and where.
fn left_out(selected: &[usize], weights: &[f64]) -> LeftOut {
    let block = |(block, weights): (usize, &[f64])| {
        let mut of = Block::default();
        for (number, weight) in (block * Block::ROWS..).zip(weights) {
            of.take(number, *weight < HALF);
        }
        of
    };
    let of_drawn = LeftOut::of_blocks(weights.chunks(Block::ROWS).enumerate().map(block));
    let Range { start, end } = of_drawn.stretch;
    let stretch = match start < end {
        true => selected[start]..selected[end - 1] + 1,
        false => 0..0,
    };
    LeftOut {
        stretch,
        ..of_drawn
    }
}

/// A calibration on all rows, by the target's decoder.
struct Judged {
    set: ParameterSet,
    decoded: Decoded,
    judgement: Judgement,
    sound: PoseError,
}
