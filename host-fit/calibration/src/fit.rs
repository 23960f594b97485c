//! The main job: a dataset to a judged calibration.
//!
//! dataset -> rows drawn -> problem -> solver -> standard errors -> parameter set -> judgement.
//! Nothing is written here.
//!
//! ```
//! # use hallstage_input::shipped::STAGE_TOML;
//! # use hallstage_input::stage::Stage;
//! # let stage = Stage::from_toml(STAGE_TOML, "stage.toml".as_ref())?;
//! # use hallstage_input::log::{self, ReadOptions};
//! # use hallstage_input::shipped::RUN_GZ;
//! # let reading = log::read_bytes(RUN_GZ, "run30.csv.gz".as_ref(), &stage, &ReadOptions::FIT)?;
//! # let dataset = reading.dataset;
//! use hallstage_calibration::fit::{FitSettings, ModelChoice, fit};
//!
//! let fit = fit(&dataset, &stage, &FitSettings::new(ModelChoice::Auto))?;
//! assert_eq!(fit.model.name, "field");
//! assert!(fit.judgement.errors.axes[0].rms < 1e-6); // X, m
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod calibration;
mod error;
mod field;
mod lag;
#[cfg(test)]
mod mounting_tests;
mod repair;
mod settings;
mod warning;
mod weights;

pub(crate) use calibration::RANGE_MARGIN;
pub use calibration::calibration;
pub use error::FitError;
pub use field::field_calibration;
use field::{FirstPhase, check_near};
pub(crate) use lag::with_beams_later;
pub use repair::Repair;
pub use settings::{FitSettings, ModelChoice};
pub use warning::{codes_refused, counted};
use weights::{by_row, left_out, outliers};

use crate::judge::identify::{check_described, check_determined, check_motion};
use crate::judge::lag::{ReferenceLag, reference_lag};
use crate::judge::left_out::LeftOut;
use crate::judge::statistics::PoseError;
use crate::judge::uncertainty::uncertainty;
use crate::judge::{Decoded, Judgement, Zeros};
use hallstage_input::dataset::{Dataset, Row};
use hallstage_input::finding::Finding;
use hallstage_input::stage::Stage;
use hallstage_solver::problem::Problem;
use hallstage_solver::problem::draw::draw_rows;
use hallstage_solver::problem::model::{COUNT, Model, ParameterId};
use hallstage_solver::solve::field::blocks::Rows;
use hallstage_solver::solve::field::fit::FieldFit;
use hallstage_solver::solve::field::terms;
use hallstage_solver::solve::robust::Loss;
use hallstage_solver::solve::{Projection, Solution, Solver};
use nalgebra::DMatrix;
use runtime::calibration::Origin;
use runtime::parameters::FitRecord;
use runtime::{Calibration, ModelKind, ParameterSet};
use std::cell::OnceCell;
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
    /// Standard errors of them; `None` as in
    /// [`Uncertainty`](crate::judge::uncertainty::Uncertainty).
    pub standard_error: [Option<f64>; COUNT],
    /// Pairs of parameters whose estimates are correlated by more than
    /// [`CORRELATION_SHOWN`](crate::judge::uncertainty::CORRELATION_SHOWN).
    pub correlations: Vec<(String, String, f64)>,
    /// Covariance of the parameters that have a standard error; of the field model its posterior has it.
    covariance_31: DMatrix<f64>,
    /// All of a fit of the field model.
    pub field: Option<FieldFit>,
    /// By how much the reference lags behind the probes, fitted with the parameters; `None` where
    /// nothing in the log shows it.
    pub lag: Option<ReferenceLag>,
    /// The rows of the fit, where the reference lags clearly: the reference is read later by the lag, and
    /// the first or last rows of each movement are missing.
    pub later: Option<Dataset>,
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
    /// How much each row of the dataset counted, 0 to 1; 0 for those that the fit did not use.
    pub weights: Vec<f64>,
    /// Those of them that count less than half, as the loss says: row numbers, ascending.
    pub outliers: Vec<usize>,
    /// How many these are and where.
    pub left_out: LeftOut,
    /// The rows of the dataset, decoded by the target's decoder.
    pub decoded: Decoded,
    /// Over these, by the target's decoder; zero deviations refitted where the model has them.
    pub judgement: Judgement,
    /// Errors over the rows that are no outliers.
    pub sound: PoseError,
    /// With the solver's own zero deviations.
    pub errors_solver_zeros: PoseError,
    /// What the user should know.
    pub warnings: Vec<Finding>,
}

/// Fits, checks and judges. A clear lag of the reference is taken off: see [`Fit::later`].
///
/// # Errors
/// See [`FitError`].
pub fn fit(dataset: &Dataset, stage: &Stage, settings: &FitSettings) -> Result<Fit, FitError> {
    let mut found = lag::without_lag(dataset, stage, settings)?;
    if let Some(lag) = &found.lag {
        let clear = warning::late_reference(lag, stage.servo_period_s);
        found.warnings.extend(clear);
    }
    Ok(found)
}

/// The fit to rows as they are.
fn fit_once(dataset: &Dataset, stage: &Stage, settings: &FitSettings) -> Result<Fit, FitError> {
    let job = Job::new(dataset, stage, settings);
    match settings.model {
        ModelChoice::Auto => job.best(),
        ModelChoice::Named(model) => job.of_model(model),
    }
}

impl Fit {
    /// The rows of the fit, of a log with these rows.
    pub fn rows<'r>(&'r self, read: &'r Dataset) -> &'r Dataset {
        self.later.as_ref().unwrap_or(read)
    }

    /// The parameters that have a standard error, by name, and their covariance in this order, SI.
    pub fn covariance(&self) -> (Vec<String>, DMatrix<f64>) {
        if let Some(field) = &self.field {
            let covariance = field.posterior.covariance.clone();
            return (terms::names(covariance.nrows()), covariance);
        }
        let known = |id: &ParameterId| self.standard_error[id.index].is_some();
        let names = self.model.free().filter(known).map(|id| id.name());
        (names.collect(), self.covariance_31.clone())
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
        let reason = if usual {
            match self.of_model(Model::of(ModelKind::Field)) {
                Ok(fit) if fit.field.as_ref().is_some_and(|field| field.verdict.field) => {
                    return Ok(fit);
                }
                Ok(fit) => fit.model_reason,
                Err(error) => error.to_string(),
            }
        } else {
            "--solver and --project choose how models of the paper are fitted; the field model has a way of its own".to_owned()
        };
        let mut fit = self.of_model(Model::of(ModelKind::M31))?;
        fit.model_reason = format!("model (31): {reason}");
        Ok(fit)
    }

    fn of_model(&self, model: &'static Model) -> Result<Fit, FitError> {
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
        let uncertainty = uncertainty(&problem, parameters).ok_or(at_pole)?;
        let calibration = Calibration {
            temperature: dataset.temperature,
            ..calibration(self.sound_rows(&weights), stage, model, parameters)
        };
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
            check_near(&problem, parameters)?;
            determined?;
        }
        let own_zeros = Zeros::Given(&solution.delta_m);
        let warnings = warning::warnings(dataset, selected, &problem, &solution, &judgement);
        let train_fitness = problem.fitness(solution.cost);
        // A lag shows at the best description of the log, which a search may be far from.
        let best = match solver {
            Solver::Search(_) => Solver::LeastSquares.solve(&problem, &settings.options).ok(),
            Solver::Finished | Solver::LeastSquares => None,
        };
        // Room for what the lag takes.
        drop(problem);
        let best = best.map_or(*parameters, |best| best.parameters);
        Ok(Fit {
            model,
            model_reason: format!("model ({}): --model asks for it", model.name),
            warnings,
            train_fitness,
            train_rows: selected.len(),
            standard_error: uncertainty.standard_error,
            field: None,
            later: None,
            lag: reference_lag(&self.field_rows(&weights), stage, model, &best),
            loss,
            outliers: outliers(selected, &weights).collect(),
            left_out: left_out(dataset, selected, &weights),
            correlations: uncertainty.correlations,
            covariance_31: uncertainty.covariance,
            weights: by_row(dataset, selected, &weights),
            errors_solver_zeros: decoded.judge(dataset, stage, own_zeros).errors,
            solution,
            calibration,
            set,
            decoded,
            judgement,
            sound,
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

/// A calibration on all rows, by the target's decoder.
struct Judged {
    set: ParameterSet,
    decoded: Decoded,
    judgement: Judgement,
    sound: PoseError,
}
