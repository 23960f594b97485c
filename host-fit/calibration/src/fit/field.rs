//! The field model: Model (31) by least squares first, then the field model from there. It is refused where
//! Model (31) has the smaller errors in service.

use super::job::{Job, check_near};
use super::{Estimate, Fit, FitError, FittedRows, ModelReason};
use hallstage_input::channels::{columns, probe_noise_m};
use hallstage_solver::estimator::error::FieldFitError;
use hallstage_solver::estimator::field::WhiteFit;
use hallstage_solver::estimator::model::Model;
use hallstage_solver::estimator::problem::Problem;
use hallstage_solver::estimator::robust::{self, Loss};
use hallstage_solver::solve::{Solver, Stopped};
use runtime::ModelKind;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// The field model under white noise. Every robust fit takes its weights from here: the residuals of the field
/// model are noise and faults of the log, the residuals of Model (31) are mostly terms that it lacks.
pub(super) struct FirstPhase {
    pub(super) field: WhiteFit,
    evaluations: u64,
    elapsed: Duration,
}

impl Job<'_> {
    /// Model (31) by least squares, then the field model from there.
    pub(super) fn first_phase(&self) -> Result<&FirstPhase, FitError> {
        let fitted = || {
            let started = Instant::now();
            let (rows, settings) = (&self.selected, self.settings);
            let model = Model::from_kind(ModelKind::M31);
            let problem = Problem::new(self.dataset, rows, self.stage, model);
            let least_squares = Solver::LeastSquares.solve(&problem, &settings.options);
            let found = least_squares.map_err(FitError::from).and_then(|start| {
                let (rows, from) = (Arc::clone(&problem.rows), &start.parameters);
                let field = WhiteFit::new(self.dataset, rows, self.stage, from)?;
                Ok((start, field))
            });
            let (start, field) = match (found, settings.loss) {
                (found, Loss::None) => found?,
                (Ok((start, field)), loss) if !field.has_outliers(loss) => (start, field),
                (_, loss) => {
                    let start = robust::start(&problem)?;
                    let (from, stage) = (&start.parameters, self.stage);
                    let field = WhiteFit::robust(self.dataset, rows, stage, from, loss)?;
                    (start, field)
                }
            };
            Ok(FirstPhase {
                field,
                evaluations: start.evaluations,
                elapsed: started.elapsed(),
            })
        };
        self.first
            .get_or_init(fitted)
            .as_ref()
            .map_err(Clone::clone)
    }

    /// The field model, refused where it would serve worse than Model (31).
    pub(super) fn fit_field(&self, model: &'static Model) -> Result<Fit, FitError> {
        let started = Instant::now();
        let first = self.first_phase()?;
        // Without six consecutive rows the residuals show the noise.
        let noise_m = probe_noise_m(&columns(self.dataset, self.stage));
        let floor_m = noise_m.unwrap_or([f64::INFINITY; 3]);
        let found = first.field.clone().finish(self.stage, floor_m)?;
        let comparison = found.figures.comparison;
        if comparison.loses() {
            return Err(FieldFitError::NotCarried(Box::new(comparison)).into());
        }
        check_near(
            self.stage,
            Model::from_kind(ModelKind::M31),
            &found.parameters.model_31(),
        )?;
        let estimate = Estimate {
            lag: found.lag,
            motion: found.motion,
            parameters: found.parameters,
            temperature: found.figures.temperature.temperature,
            posterior: found.posterior,
            // The fit follows the reference's walk.
            delta_m: None,
            evaluations: first.evaluations + u64::from(found.iterations),
            elapsed: first.elapsed + started.elapsed(),
            stopped: Stopped::FieldModel {
                steps: found.iterations,
            },
        };
        let fitted = FittedRows {
            numbers: self.selected.clone(),
            weights: found.weights,
            loss: self.settings.loss,
        };
        let fit = self.judged(model, estimate, fitted)?;
        self.check_described(&fit)?;
        Ok(Fit {
            model_reason: ModelReason::Compared(comparison),
            field: Some(found.figures),
            ..fit
        })
    }
}
