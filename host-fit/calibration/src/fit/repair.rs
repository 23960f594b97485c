//! A fit with the faults of its log taken off.

use super::{Fit, FitError};
use crate::judge::predicted::Predicted;
use crate::judge::{Decoded, Zeros};
use hallstage_input::dataset::Dataset;
use hallstage_input::stage::Stage;
use hallstage_solver::solve::field::parameters::FieldParameters;
use hallstage_solver::solve::field::posterior::Posterior;
use nalgebra::DMatrix;
use runtime::calibration::Origin;
use runtime::model::Probes;
use runtime::parameters::{FitRecord, ParameterError};

/// Parameters that were estimated together with the faults of a log: those of the stage at its end.
#[derive(Clone, Debug)]
pub struct Repair {
    /// The parameters.
    pub parameters: FieldParameters,
    /// Their covariance, in their order and units.
    pub covariance: DMatrix<f64>,
}

impl Fit {
    /// This fit of the field model with the repaired parameters, judged on the rows of its logs; the blob has the
    /// errors that are `predicted` for service.
    ///
    /// # Errors
    /// [`FitError::Unusable`].
    pub fn repaired(
        mut self,
        dataset: &Dataset,
        stage: &Stage,
        repair: &Repair,
        predicted: &Predicted,
    ) -> Result<Self, FitError> {
        let parameters = &repair.parameters;
        let constants = parameters.constants(stage.hall.m_per_count);
        let constants = constants.ok_or(FitError::Unusable(ParameterError::SingularPlane))?;
        self.calibration.geometry = parameters.model_31().geometry();
        self.calibration.probes = Probes::Field(constants.probes);
        let origin = Origin {
            serial: self.set.serial.clone(),
            created: self.set.created.clone(),
            logs_sha256: self.set.logs_sha256,
            fit: self.set.fit,
        };
        self.set = (self.calibration.prepare(&origin)).map_err(FitError::Unusable)?;
        self.decoded = Decoded::new(&self.set, dataset);
        self.judgement = self.decoded.judge(dataset, stage, Zeros::Refit);
        let mut sound = self.decoded.clone();
        for &row in &self.outliers {
            sound.errors[row] = None;
        }
        self.sound = sound.judge(dataset, stage, Zeros::Refit).errors;
        self.train_fitness = self.judgement.errors.fitness();
        let axes = self.judgement.errors.axes;
        self.set.fit = FitRecord {
            rms: axes.map(|a| a.rms as f32),
            peak: axes.map(|a| a.peak as f32),
            ..self.set.fit
        };
        self.solution.parameters = parameters.model_31();
        let zeros = self.judgement.zeros.iter();
        self.solution.delta_m = zeros.map(|zero| zero.delta_m).collect();
        self.errors_solver_zeros = self.judgement.errors;
        if let Some(field) = &mut self.field {
            let mut covariance = repair.covariance.clone();
            // The faults are separated from the parameters, not from k and h.
            let with_warmth = &field.posterior.covariance;
            let (of_parameters, all) = (covariance.nrows(), with_warmth.nrows());
            covariance.resize_mut(all, all, 0.0);
            for i in of_parameters..all {
                for j in of_parameters..all {
                    covariance[(i, j)] = with_warmth[(i, j)];
                }
            }
            field.posterior = Posterior::of_parameters(covariance, parameters, &field.noise);
            field.parameters = *parameters;
            self.standard_error = field.posterior.standard_errors_31();
        }
        // Those on the log have the faults that are taken off: no measure for another one.
        self.set.fit.rms = predicted.rms.map(|rms| rms as f32);
        Ok(self)
    }
}
