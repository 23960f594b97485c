//! What is kept beside a blob: its posterior, the logs that it was fitted to, and its certificate.

use crate::budget::Budget;
use crate::fit::Fit;
use hallstage_input::dataset::{Dataset, LogSource};
use hallstage_input::stage::Stage;
use hallstage_solver::estimator::whiten::Noise;
use nalgebra::DMatrix;
use runtime::ParameterSet;

/// What is kept of a fit of the field model beside its blob: the prior of a recalibration.
#[derive(Clone, Debug, PartialEq)]
pub struct StoredPosterior {
    /// Covariance of the parameters, and of k and h: see [`Posterior::covariance`](hallstage_solver::estimator::posterior::Posterior::covariance).
    pub covariance: DMatrix<f64>,
    /// The noise of the log.
    pub noise: Noise,
    /// Chi-square over residuals of the fit; above 1 where the model is incomplete.
    pub misfit: f64,
    /// The faults of the log that the calibration is without, in words: see
    /// [`Repair`](crate::fit::Repair).
    pub repaired: Vec<String>,
    /// The uncertainty in service, source by source.
    pub budget: Option<Budget>,
    /// SHA-256 of the text of each log that the blob was fitted to.
    pub logs: Vec<[u8; 32]>,
    /// The latest number of a certificate of it or of the calibrations before it; empty without one.
    pub certificate: String,
}

impl StoredPosterior {
    /// Of a fit; `None` of other models than the field model.
    pub fn from_fit(fit: &Fit) -> Option<Self> {
        let figures = fit.field.as_ref()?;
        let score = figures.score;
        Some(Self {
            covariance: fit.estimate.posterior.covariance.clone(),
            noise: Noise {
                white_m: fit.estimate.posterior.white_m,
                ..figures.noise
            },
            misfit: score.chi_squared / score.residuals.max(1) as f64,
            repaired: Vec::new(),
            budget: None,
            logs: Vec::new(),
            certificate: String::new(),
        })
    }

    /// The same of a blob that was fitted to these logs, too. A number in `[certificate]` becomes the latest number of a
    /// certificate, which no later document can have.
    #[must_use]
    pub fn with_log(&self, dataset: &Dataset, stage: &Stage) -> Self {
        let mut logs = self.logs.clone();
        logs.extend(dataset.logs.iter().map(|log| log.sha256));
        let [number, ..] = &stage.certificate.texts;
        let certificate = match number.as_str() {
            "" => self.certificate.clone(),
            number => number.to_owned(),
        };
        Self {
            logs,
            certificate,
            ..self.clone()
        }
    }
}

/// The names of the logs that a blob was fitted to: they are no evidence of it.
pub fn own_logs(
    set: &ParameterSet,
    known: Option<&StoredPosterior>,
    dataset: &Dataset,
) -> Vec<String> {
    let are_all = set.logs_sha256 == dataset.sha256;
    let of_fit = known.map_or(&[][..], |known| &known.logs);
    let is_own =
        |log: &&LogSource| are_all || log.sha256 == set.logs_sha256 || of_fit.contains(&log.sha256);
    let own = dataset.logs.iter().filter(is_own);
    own.map(LogSource::name).collect()
}
