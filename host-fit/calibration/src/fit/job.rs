//! How each model is fitted to a log: the ways to an estimate.

use super::calibration::reach;
use super::field::FirstPhase;
use super::{Estimate, Fit, FitError, FitSettings, FittedRows, ModelChoice, ModelReason};
use crate::judge::identify::{check_described, check_determined, check_motion};
use hallstage_input::dataset::Dataset;
use hallstage_input::stage::Stage;
use hallstage_solver::estimator::draw::draw_rows;
use hallstage_solver::estimator::dynamics::MotionFit;
use hallstage_solver::estimator::error::FieldFitError;
use hallstage_solver::estimator::model::Model;
use hallstage_solver::estimator::paper::{Parameters, SLOPES, search_box};
use hallstage_solver::estimator::parameters::FieldParameters;
use hallstage_solver::estimator::problem::Problem;
use hallstage_solver::estimator::robust::Loss;
use hallstage_solver::estimator::rows::Rows;
use hallstage_solver::estimator::sandwich::Sandwich;
use hallstage_solver::solve::{Projection, Solver};
use runtime::ModelKind;
use std::cell::OnceCell;
use std::sync::Arc;

/// The fit to rows with their lag of the reference.
///
/// # Errors
/// See [`FitError`].
pub(super) fn fit_once(
    dataset: &Dataset,
    stage: &Stage,
    settings: &FitSettings,
) -> Result<Fit, FitError> {
    let job = Job::new(dataset, stage, settings);
    match settings.model {
        ModelChoice::Auto => job.best(),
        ModelChoice::Named(model) => job.fit_model(model),
    }
}

/// What every model of a log is fitted with.
pub(super) struct Job<'a> {
    pub(super) dataset: &'a Dataset,
    pub(super) stage: &'a Stage,
    pub(super) settings: &'a FitSettings,
    /// The rows to use.
    pub(super) selected: Vec<usize>,
    /// See [`Job::first_phase`].
    pub(super) first: OnceCell<Result<FirstPhase, FitError>>,
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
        let usual = self.settings.solver == Solver::LeastSquares
            && self.settings.options.projection == Projection::Linear;
        let reason = if usual {
            match self.fit_model(Model::from_kind(ModelKind::Field)) {
                Ok(fit)
                    if fit
                        .field
                        .as_ref()
                        .is_some_and(|field| field.comparison.field) =>
                {
                    return Ok(fit);
                }
                Ok(fit) => fit.model_reason,
                Err(error) => ModelReason::NoField(error),
            }
        } else {
            ModelReason::OtherSolver
        };
        Ok(Fit {
            model_reason: reason,
            ..self.fit_model(Model::from_kind(ModelKind::M31))?
        })
    }

    fn fit_model(&self, model: &'static Model) -> Result<Fit, FitError> {
        check_motion(self.dataset, self.stage, self.selected.len(), model)?;
        match model.kind {
            ModelKind::Field => self.fit_field(model),
            _ => self.fit_paper(model),
        }
    }

    /// An estimate of a model, judged.
    pub(super) fn judged(
        &self,
        model: &'static Model,
        estimate: Estimate,
        fitted: FittedRows,
    ) -> Result<Fit, FitError> {
        let texts = (self.settings.serial.clone(), self.settings.created.clone());
        Fit::new(model, estimate, fitted, (self.dataset, self.stage), texts)
    }

    /// Refuses a fit that does not explain most of the motion.
    pub(super) fn check_described(&self, fit: &Fit) -> Result<(), FitError> {
        if !self.settings.force {
            let errors = fit.sound_errors(self.dataset, self.stage);
            check_described(self.dataset, &errors, fit.model)?;
        }
        Ok(())
    }

    /// The rows to use with their weights: all alike for a search, which has no weights, and where the
    /// field model cannot be fitted at all.
    fn fitted_rows(&self) -> FittedRows {
        let alike = || FittedRows::alike(self.selected.clone());
        match (self.settings.loss, self.settings.solver) {
            (Loss::None, _) | (_, Solver::Search(_)) => alike(),
            (loss, _) => match self.first_phase() {
                Ok(first) => FittedRows {
                    numbers: self.selected.clone(),
                    weights: first.field.weights.clone(),
                    loss,
                },
                Err(_) => alike(),
            },
        }
    }

    /// The rows that count. Rows with the weights of the first phase are not built again.
    fn rows(&self, fitted: &FittedRows) -> Arc<Rows> {
        match self.first.get() {
            Some(Ok(first)) if first.field.weights == fitted.weights => {
                Arc::clone(first.field.rows())
            }
            _ => Arc::new(Rows::weighted(
                self.dataset,
                &fitted.numbers,
                &fitted.weights,
            )),
        }
    }

    /// A model of the paper: slopes of the sensitivity at most.
    fn fit_paper(&self, model: &'static Model) -> Result<Fit, FitError> {
        let (dataset, stage, settings) = (self.dataset, self.stage, self.settings);
        let solver = settings.solver;
        let fitted = self.fitted_rows();
        let problem = Problem {
            stage,
            model,
            rows: self.rows(&fitted),
        };
        let solution = solver.solve(&problem, &settings.options)?;
        let parameters = solution.parameters;
        let at_pole = FitError::AtPole {
            solver: solver.name(),
        };
        let sandwich = Sandwich::new(&problem, &parameters).ok_or(at_pole)?;
        let (_, vertical) = reach(fitted.sound(dataset));
        let determined = check_determined(stage, model, &parameters, &sandwich, vertical);
        // Lags show at the best description of the log, which a search may be far from.
        let (lag, motion) = match solver {
            Solver::Search(_) => {
                let best = Solver::LeastSquares.solve(&problem, &settings.options).ok();
                let at_best = best.and_then(|best| Sandwich::new(&problem, &best.parameters));
                at_best.map_or((None, MotionFit::unknown()), |best| (best.lag, best.motion))
            }
            Solver::LeastSquares => (sandwich.lag, sandwich.motion),
        };
        let estimate = Estimate {
            lag,
            motion,
            parameters: FieldParameters::from_model_31(&parameters, stage),
            temperature: dataset.temperature,
            posterior: sandwich.posterior,
            delta_m: Some(solution.delta_m),
            evaluations: solution.evaluations,
            elapsed: solution.elapsed,
            stopped: solution.stopped,
        };
        let fit = self.judged(model, estimate, fitted);
        if let Err(FitError::Unusable(_)) = fit {
            determined.clone()?;
        }
        let fit = fit?;
        // First this: a log that the model does not describe determines nothing, but for that reason.
        self.check_described(&fit)?;
        if !settings.force {
            check_near(stage, model, &parameters)?;
            determined?;
        }
        Ok(fit)
    }
}

/// A lever arm (m), an angle (rad) or an eta this far beyond its search range, and farther than the range is wide,
/// shows sensors in another order or with other signs.
const FAR: [f64; 3] = [0.1, 0.3, 0.5];

/// # Errors
/// [`FieldFitError::FarOff`]: see [`FAR`].
pub(super) fn check_near(
    stage: &Stage,
    model: &'static Model,
    parameters: &Parameters,
) -> Result<(), FieldFitError> {
    let theta = parameters.geometry().misalignment_rad;
    let ranges = search_box(stage, model, theta);
    for id in model.free().take(SLOPES) {
        let (value, range) = (parameters.values[id.index], ranges[id.index]);
        let distance = (value - range.clip(value)).abs();
        if distance > range.width().max(FAR[id.index / 3]) {
            return Err(FieldFitError::FarOff {
                parameter: id.name(),
                value,
                unit: id.term.unit,
                low: range.low,
                high: range.high,
            });
        }
    }
    Ok(())
}
