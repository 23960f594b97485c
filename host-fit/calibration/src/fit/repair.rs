//! A fit with the faults of its log taken off.

use super::{Estimate, Fit, FitError};
use crate::judge::predicted::Predicted;
use hallstage_input::dataset::Dataset;
use hallstage_input::stage::Stage;
use hallstage_solver::estimator::dynamics::MotionFit;
use hallstage_solver::estimator::parameters::FieldParameters;
use nalgebra::DMatrix;

/// Parameters that were estimated together with the faults of a log. They describe the stage at the end of the log.
#[derive(Clone, Debug)]
pub struct Repair {
    /// The parameters.
    pub parameters: FieldParameters,
    /// Their covariance, in their order and units.
    pub covariance: DMatrix<f64>,
    /// Lags of the probes, and what acceleration adds to their readings.
    pub motion: MotionFit,
    /// The lag of the reference behind the middle probe in the rows that were diagnosed, s.
    pub lag_s: f64,
}

impl Fit {
    /// This fit of the field model to the rows of a dataset, with the repaired parameters. The blob has the
    /// errors that are `predicted` for service: the errors on the log still have the faults.
    ///
    /// # Errors
    /// [`FitError::Unusable`].
    pub fn repaired(
        self,
        dataset: &Dataset,
        stage: &Stage,
        repair: &Repair,
        predicted: &Predicted,
    ) -> Result<Self, FitError> {
        let posterior = &self.estimate.posterior;
        let estimate = Estimate {
            parameters: repair.parameters,
            posterior: posterior.with_parameters(&repair.parameters, &repair.covariance),
            ..self.estimate.clone()
        };
        let texts = (self.set.serial.clone(), self.set.created.clone());
        let (fitted, log) = (self.fitted.clone(), (self.rows(dataset), stage));
        let mut fit = Self::new(self.model, estimate, fitted, log, texts)?;
        fit.set.fit.rms = predicted.rms.map(|rms| rms as f32);
        fit.set.fit.forced = self.set.fit.forced;
        Ok(Self {
            model_reason: self.model_reason,
            field: self.field,
            later: self.later,
            ..fit
        })
    }
}
