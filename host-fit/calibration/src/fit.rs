//! The main job: a dataset to a judged calibration.
//!
//! dataset -> rows drawn -> parameters and posterior -> parameter set -> judgement. It writes no file.
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
mod estimate;
mod field;
mod job;
mod lag;
#[cfg(test)]
mod mounting_tests;
mod repair;
mod rows;
mod settings;
mod warning;

pub(crate) use calibration::RANGE_MARGIN;
pub use calibration::calibration;
pub use error::FitError;
pub use estimate::Estimate;
pub use repair::Repair;
pub use rows::FittedRows;
pub use settings::{FitSettings, ModelChoice};
pub use warning::{codes_refused, counted};
pub(crate) use warning::{is_clear, is_significant};

use crate::judge::statistics::PoseError;
use crate::judge::{Decoded, Judgement, Zeros};
use hallstage_input::dataset::Dataset;
use hallstage_input::stage::Stage;
use hallstage_solver::estimator::dynamics::MotionFit;
use hallstage_solver::estimator::field::FieldFigures;
use hallstage_solver::estimator::model::Model;
use hallstage_solver::estimator::service::Comparison;
use runtime::calibration::Origin;
use runtime::parameters::{FitRecord, Text};
use runtime::{Calibration, ParameterSet};

/// A calibration with everything that is known about it.
#[derive(Clone, Debug)]
pub struct Fit {
    /// The model.
    pub model: &'static Model,
    /// Why this model.
    pub model_reason: ModelReason,
    /// The parameters, and how well the log determines them.
    pub estimate: Estimate,
    /// What else a fit of the field model found.
    pub field: Option<FieldFigures>,
    /// The rows that were fitted.
    pub fitted: FittedRows,
    /// The rows of the log, where the reference lags clearly: the reference is read later by the lag, and
    /// the first or last rows of each movement are missing.
    pub later: Option<Dataset>,
    /// The calibration in `f64`.
    pub calibration: Calibration,
    /// What goes into the blob.
    pub set: ParameterSet,
    /// The rows of the log, decoded by the target's decoder.
    pub decoded: Decoded,
    /// Over these rows; zero deviations refitted where the model has them.
    pub judgement: Judgement,
}

/// Why a fit is of its model.
#[derive(Clone, Debug, PartialEq)]
pub enum ModelReason {
    /// The settings name it.
    Asked,
    /// The solver is for models of the paper only.
    OtherSolver,
    /// The errors of the field model in service against those of Model (31).
    Compared(Comparison),
    /// The field model cannot be fitted.
    NoField(FitError),
}

/// Fits, checks and judges. A clear lag of the reference is taken off: see [`Fit::later`].
///
/// # Errors
/// See [`FitError`].
pub fn fit(dataset: &Dataset, stage: &Stage, settings: &FitSettings) -> Result<Fit, FitError> {
    lag::without_lag(dataset, stage, settings)
}

impl Fit {
    /// The calibration that an estimate makes, judged on the rows of a dataset. `texts` are the serial number
    /// and the creation time for the blob.
    ///
    /// # Errors
    /// [`FitError::Unusable`].
    fn new(
        model: &'static Model,
        estimate: Estimate,
        fitted: FittedRows,
        (dataset, stage): (&Dataset, &Stage),
        (serial, created): (Text, Text),
    ) -> Result<Self, FitError> {
        let sound = fitted.sound(dataset);
        let made = calibration(sound, stage, model.kind, &estimate.parameters);
        let calibration = Calibration {
            temperature: estimate.temperature,
            motion_correction: estimate.motion.correction(&estimate.parameters),
            ..made.map_err(FitError::Unusable)?
        };
        let origin = Origin {
            serial,
            created,
            logs_sha256: dataset.sha256,
            fit: FitRecord::default(),
        };
        let mut set = calibration.prepare(&origin).map_err(FitError::Unusable)?;
        let decoded = Decoded::new(&set, dataset);
        let judgement = decoded.judge(dataset, stage, Zeros::for_model(model));
        let train_rows = u32::try_from(fitted.numbers.len()).unwrap_or(u32::MAX);
        set.fit = judgement.record(train_rows);
        Ok(Self {
            model,
            model_reason: ModelReason::Asked,
            estimate,
            field: None,
            fitted,
            later: None,
            calibration,
            set,
            decoded,
            judgement,
        })
    }

    /// With what a diagnosis takes for the motion of the probes.
    #[must_use]
    pub fn with_motion(mut self, motion: &MotionFit) -> Self {
        self.estimate.motion = *motion;
        self.calibration.motion_correction = motion.correction(&self.estimate.parameters);
        self.set.motion_correction = self.calibration.motion_correction;
        self
    }

    /// The rows of the fit, of a log with the rows `read`.
    pub fn rows<'r>(&'r self, read: &'r Dataset) -> &'r Dataset {
        self.later.as_ref().unwrap_or(read)
    }

    /// Pose errors of every row, m, m, rad, zero deviations taken off; `None` where the decoder found bad
    /// codes.
    pub fn errors_by_row(&self, dataset: &Dataset) -> Vec<Option<[f64; 3]>> {
        self.decoded.errors_less(&self.judgement.zeros, dataset)
    }

    /// Errors over the rows that are no outliers.
    pub fn sound_errors(&self, dataset: &Dataset, stage: &Stage) -> PoseError {
        let mut decoded = self.decoded.clone();
        for row in self.fitted.outliers() {
            decoded.errors[row] = None;
        }
        let zeros = Zeros::for_model(self.model);
        decoded.judge(dataset, stage, zeros).errors
    }

    /// Errors with the solver's own zero deviations taken off.
    pub fn errors_with_own_delta(&self, dataset: &Dataset, stage: &Stage) -> PoseError {
        match &self.estimate.delta_m {
            Some(delta_m) => {
                let zeros = Zeros::Given(delta_m);
                self.decoded.judge(dataset, stage, zeros).errors
            }
            None => self.judgement.errors,
        }
    }

    /// Fitness over the rows that were fitted, by their weights, with the solver's own zero deviations: the
    /// root of the mean over rows and axes of the squared error, um, um, urad.
    pub fn train_fitness(&self, dataset: &Dataset, stage: &Stage) -> f64 {
        let errors = match &self.estimate.delta_m {
            Some(delta_m) => {
                let own = self.decoded.judge(dataset, stage, Zeros::Given(delta_m));
                self.decoded.errors_less(&own.zeros, dataset)
            }
            None => self.errors_by_row(dataset),
        };
        let (mut squares, mut rows) = (0.0, 0);
        for (row, weight) in self.fitted.counted() {
            rows += 1;
            for error in errors[row].into_iter().flatten() {
                squares += weight * (error * 1e6) * (error * 1e6);
            }
        }
        (squares / (3.0 * f64::from(rows.max(1)))).sqrt()
    }
}
