//! The main job for the field model: Model (31) by least squares first, then the field model from
//! there, refused where the log leaves it worse than Model (31).

use super::warning::warnings;
use super::{Fit, FitError, Job, Judged, calibration};
use crate::judge::Zeros;
use crate::judge::lag::ReferenceLag;
use crate::judge::uncertainty::CORRELATION_SHOWN;
use hallstage_input::dataset::Row;
use hallstage_input::stage::Stage;
use hallstage_solver::problem::Problem;
use hallstage_solver::problem::model::Model;
use hallstage_solver::problem::parameters::{Parameters, SLOPES, search_box};
use hallstage_solver::solve::field::error::FieldFitError;
use hallstage_solver::solve::field::fit::WhiteFit;
use hallstage_solver::solve::field::parameters::FieldParameters;
use hallstage_solver::solve::least_squares::solve::at_limit;
use hallstage_solver::solve::robust::{self, Loss};
use hallstage_solver::solve::{Solution, Solver};
use nalgebra::DMatrix;
use runtime::model::Probes;
use runtime::parameters::ParameterError;
use runtime::{Calibration, ModelKind};
use std::time::{Duration, Instant};

/// The calibration that parameters of the field model make: see [`calibration`].
///
/// # Errors
/// [`FitError::Unusable`] where PM is singular.
pub fn field_calibration<'r>(
    rows: impl IntoIterator<Item = &'r Row>,
    stage: &Stage,
    parameters: &FieldParameters,
) -> Result<Calibration, FitError> {
    let constants = parameters.constants(stage.hall.m_per_count);
    let constants = constants.ok_or(FitError::Unusable(ParameterError::SingularPlane))?;
    let model_31 = Model::of(ModelKind::M31);
    Ok(Calibration {
        model: ModelKind::Field,
        probes: Probes::Field(constants.probes),
        ..calibration(rows, stage, model_31, &parameters.model_31())
    })
}

/// A lever arm (m), an angle (rad) or an eta that leaves its search range by more than this, and by
/// more than the range is wide, is that of sensors in another order or with other signs.
const FAR: [f64; 3] = [0.1, 0.3, 0.5];

/// # Errors
/// [`FieldFitError::FarOff`]: see [`FAR`].
pub(super) fn check_near(problem: &Problem, parameters: &Parameters) -> Result<(), FieldFitError> {
    let theta = parameters.geometry().misalignment_rad;
    let ranges = search_box(problem.stage, problem.model, theta);
    for id in problem.model.free().take(SLOPES) {
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

/// The field model under white noise, on which every robust fit rests: its residuals are noise
/// and what is wrong with the log, where those of Model (31) are mostly what it lacks.
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
            let problem =
                || Problem::new(self.dataset, rows, self.stage, Model::of(ModelKind::M31));
            let least_squares = Solver::LeastSquares.solve(&problem(), &settings.options);
            let found = least_squares.map_err(FitError::from).and_then(|start| {
                let field = WhiteFit::new(self.dataset, rows, self.stage, &start.parameters)?;
                Ok((start, field))
            });
            let (start, field) = match (found, settings.loss) {
                (found, Loss::None) => found?,
                (Ok((start, field)), loss) if !field.has_outliers(loss) => (start, field),
                (_, loss) => {
                    let start = robust::start(&problem())?;
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
    pub(super) fn of_field_model(&self, model: &'static Model) -> Result<Fit, FitError> {
        let Self {
            dataset,
            stage,
            selected,
            ..
        } = self;
        let started = Instant::now();
        let first = self.first_phase()?;
        let field = first.field.clone().finish(stage)?;
        if field.verdict.loses() {
            let verdict = Box::new(field.verdict);
            return Err(FieldFitError::NotCarried(verdict).into());
        }
        let problem = Problem::new(dataset, selected, stage, Model::of(ModelKind::M31));
        let elapsed = first.elapsed + started.elapsed();
        let parameters = field.parameters.model_31();
        check_near(&problem, &parameters)?;
        let mut calibration =
            field_calibration(self.sound_rows(&field.weights), stage, &field.parameters)?;
        calibration.temperature = field.warmth.temperature;
        let Judged {
            set,
            decoded,
            judgement,
            sound,
        } = self.judged(model, &calibration, &field.weights)?;
        // The fit follows the reference's walk; one zero deviation for a movement is that of the
        // judgement.
        let errors = decoded.errors_less(&judgement.zeros, dataset);
        let mut cost = 0.0;
        for (&row, row_weight) in selected.iter().zip(&field.weights) {
            for (error, weight) in errors[row].into_iter().flatten().zip(problem.weights) {
                cost += row_weight * (weight * (error * 1e6) * (error * 1e6));
            }
        }
        let solution = Solution {
            parameters,
            delta_m: judgement.zeros.iter().map(|zero| zero.delta_m).collect(),
            cost,
            evaluations: first.evaluations + u64::from(field.iterations),
            history: Vec::new(),
            elapsed,
            stopped: format!(
                "maximum a posteriori reached {} steps after model (31)",
                field.iterations
            ),
            at_limit: at_limit(&problem, &parameters),
        };
        let lag = |standard_error_s| ReferenceLag {
            value_s: field.lag_s,
            standard_error_s,
        };
        Ok(Fit {
            model,
            model_reason: field.verdict.to_string(),
            warnings: warnings(dataset, selected, &problem, &solution, &judgement),
            train_fitness: problem.fitness(cost),
            train_rows: selected.len(),
            loss: self.settings.loss,
            outliers: super::outliers(selected, &field.weights).collect(),
            left_out: super::left_out(dataset, selected, &field.weights),
            correlations: (field
                .posterior
                .strongest_correlations(usize::MAX)
                .into_iter())
            .take_while(|(_, _, correlation)| correlation.abs() > CORRELATION_SHOWN)
            .collect(),
            standard_error: field.posterior.standard_errors_31(),
            covariance_31: DMatrix::zeros(0, 0),
            weights: super::by_row(dataset, selected, &field.weights),
            later: None,
            lag: field.posterior.lag_error_s.map(lag),
            errors_solver_zeros: {
                let zeros = Zeros::Given(&solution.delta_m);
                decoded.judge(dataset, stage, zeros).errors
            },
            solution,
            calibration,
            set,
            decoded,
            judgement,
            sound,
            field: Some(field),
        })
    }
}
