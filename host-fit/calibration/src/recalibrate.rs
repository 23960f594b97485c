//! A few parameters from a few seconds of log: an old calibration brought up to date.
//!
//! old blob and its posterior -> changes -> checks -> new blob and its posterior. It writes no file.
//!
//! ```
//! # use hallstage_input::shipped::STAGE_TOML;
//! # use hallstage_input::stage::Stage;
//! # let stage = Stage::from_toml(STAGE_TOML, "stage.toml".as_ref())?;
//! # use hallstage_input::log::{self, ReadOptions};
//! # use hallstage_input::shipped::RUN_GZ;
//! # let reading = log::read_bytes(RUN_GZ, "run30.csv.gz".as_ref(), &stage, &ReadOptions::FIT)?;
//! # let dataset = reading.dataset;
//! # use hallstage_calibration::fit::{FitSettings, ModelChoice, fit};
//! # let fit = fit(&dataset, &stage, &FitSettings::new(ModelChoice::Auto))?;
//! use hallstage_calibration::recalibrate::{StoredPosterior, recalibrate};
//! use hallstage_solver::estimator::update::Change;
//!
//! let known = StoredPosterior::from_fit(&fit);
//! let created = "2026-11-23".try_into()?;
//! let new = recalibrate(&fit.set, known.as_ref(), &dataset, &stage, Change::Gains, created)?;
//! let (change, standard_error) = new.gains[0];
//! assert!(change.abs() < standard_error); // the same log
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod described;
mod known;

use described::check_described;
pub use known::{Certificates, StoredPosterior, own_logs};

use crate::budget::Budget;
use crate::diagnose::signals::signal_findings;
use crate::diagnose::{BlobUse, Diagnosis, diagnose_blob};
use crate::fit::{RANGE_MARGIN, calibration};
use crate::judge::predicted::{Predicted, Validity, declared_service};
use crate::judge::{Decoded, Judgement, Zeros};
use hallstage_input::channels::columns;
use hallstage_input::dataset::Dataset;
use hallstage_input::stage::Stage;
use hallstage_solver::estimator::error::FieldFitError;
use hallstage_solver::estimator::model::Model;
use hallstage_solver::estimator::noise::USUAL_DRIFT;
use hallstage_solver::estimator::parameters::FieldParameters;
use hallstage_solver::estimator::service::{Service, service_poses};
use hallstage_solver::estimator::terms::COUNT;
use hallstage_solver::estimator::update::{Change, update};
use runtime::calibration::Origin;
use runtime::parameters::{FitRecord, ParameterError, Text};
use runtime::{Calibration, ParameterSet};

/// Largest increase of the systematic errors in service, over the noise (variances), with gains. After two seconds
/// that determine the gains it is 0.01, after one axis for three gains 0.1 and far more. Errors in service are
/// then 1.025 times the noise floor.
const OPEN_MAX_GAINS: f64 = 0.05;
/// The same with all parameters: 0.1 after 4 s of all six axes, 1.2 after 2 s. Errors in service are then 1.1 times
/// the noise floor.
const OPEN_MAX_ALL: f64 = 0.21;
/// A calibration brought up to date.
#[derive(Clone, Debug)]
pub struct Recalibration {
    /// What goes into the blob.
    pub set: ParameterSet,
    /// What goes beside it; `None` without an old one.
    pub known: Option<StoredPosterior>,
    /// Change of the gain of A, B, C, in parts of the old one, with its standard error.
    pub gains: [(f64, f64); 3],
    /// The errors in service to expect of the old blob.
    pub predicted_before: Predicted,
    /// Chi-square over residuals.
    pub chi_squared: f64,
    /// Errors over the log by the target's decoder, with the new and with the old blob; zero
    /// deviations refitted.
    pub judgement: Judgement,
    /// With the old blob.
    pub judgement_before: Judgement,
    /// What is wrong with the log, and whether the new blob can be used.
    pub diagnosis: Diagnosis,
}

/// Why an old calibration is not brought up to date.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RecalibrateError {
    /// The blob is not of the field model.
    OtherModel {
        /// What it is of.
        model: String,
    },
    /// `all` and `temperature` need the old posterior.
    NothingKnown,
    /// The blob was fitted to these logs, so they show no change.
    OwnLog(Vec<String>),
    /// A log without temperatures that the blob needs, or `temperature` of a blob without them.
    NoTemperature(&'static str),
    /// The log does not determine the change well enough.
    NotCarried {
        /// What was to be found.
        change: Change,
        /// Errors predicted for service over the noise floor: X, Y, Rz.
        ratios: [f64; 3],
    },
    /// The log shows another change.
    NotDescribed {
        /// What was to be found.
        change: Change,
        /// Chi-square over residuals.
        ratio: f64,
        /// Its limit.
        limit: f64,
    },
    /// The parameters would have to change further than any probe drifts.
    TooFar {
        /// What was to be found.
        change: Change,
        /// Sum of squares of the changes in terms of what is allowed for.
        prior: f64,
        /// Its limit.
        limit: f64,
    },
    /// The equations can't be solved.
    Unsolved(#[from] FieldFitError),
    /// The new parameters cannot serve a decoder.
    Unusable(ParameterError),
}

/// Brings `old` up to date by a log. `created` is for the new blob, which keeps the serial number
/// and the calibrated range of the old one.
///
/// # Errors
/// See [`RecalibrateError`].
pub fn recalibrate(
    old: &ParameterSet,
    known: Option<&StoredPosterior>,
    dataset: &Dataset,
    stage: &Stage,
    change: Change,
    created: Text,
) -> Result<Recalibration, RecalibrateError> {
    let old_parameters =
        FieldParameters::from_set(old, stage).ok_or_else(|| RecalibrateError::OtherModel {
            model: Model::from_kind(old.model).title(),
        })?;
    let temperature = old.constants.temperature.rounded::<f64>();
    if known.is_none() && matches!(change, Change::All | Change::Temperature) {
        return Err(RecalibrateError::NothingKnown);
    }
    if change == Change::Temperature {
        let with_temperature = known.is_some_and(|known| known.covariance.nrows() > COUNT);
        if !temperature.is_used() || !with_temperature {
            return Err(RecalibrateError::NoTemperature("the blob"));
        }
    }
    for (sensor, name) in ["the mount in the log", "the body in the log"]
        .into_iter()
        .enumerate()
    {
        let is_needed = temperature.per_mk.iter().any(|probe| probe[sensor] != 0.0);
        let all = 0..dataset.rows.len();
        if is_needed && dataset.temperature_mean_mc(sensor, all).is_none() {
            return Err(RecalibrateError::NoTemperature(name));
        }
    }
    let dataset = &*dataset.compensated(temperature);
    let judged =
        |set: &ParameterSet| Decoded::new(set, dataset).judge(dataset, stage, Zeros::Refit);
    let judgement_before = judged(old);
    let columns = columns(dataset, stage);
    let (_, bad) = signal_findings(dataset, stage, &columns);
    let covariance = known.map(|known| &known.covariance);
    let drift = known.map_or(USUAL_DRIFT, |known| known.noise.drift);
    let update = update(
        &dataset.without(&bad),
        stage,
        &old_parameters,
        covariance,
        change,
        drift,
    )?;
    let at_work = declared_service(stage, &update.parameters, update.noise.white_m);
    let at_work = at_work.ok_or(FieldFitError::Singular)?;
    // Whether the log determines the change: over the whole calibrated range.
    let range = |words: [f32; 3]| words.map(|x| f64::from(x) / RANGE_MARGIN);
    let ranges = (
        range(old.constants.calibrated_planar),
        range(old.constants.calibrated_vertical),
    );
    let calibrated = Service::new(
        &update.parameters,
        update.noise.white_m,
        service_poses(ranges),
    );
    let calibrated = calibrated.ok_or(FieldFitError::Singular)?;
    let service = calibrated.variance(&update.posterior.covariance);
    let open_before = covariance.map_or([0.0; 3], |of| calibrated.variance(of).systematic);
    let open_max = match change {
        Change::Gain | Change::Gains => OPEN_MAX_GAINS,
        Change::All | Change::Temperature => OPEN_MAX_ALL,
    };
    let open = |k: usize| service.systematic[k] > open_before[k] + open_max * service.noise[k];
    if (0..3).any(open) {
        return Err(RecalibrateError::NotCarried {
            change,
            ratios: service.ratios(),
        });
    }
    check_described(&update, known, change)?;

    let origin = Origin {
        serial: old.serial.clone(),
        created,
        logs_sha256: dataset.sha256,
        fit: FitRecord::default(),
    };
    let set = with_parameters(old, &update.parameters, stage, &origin)
        .map_err(RecalibrateError::Unusable)?;
    let judgement = judged(&set);
    let expect = |off: &[f64]| Predicted::new(&at_work, &update.posterior.covariance, off);
    let predicted = expect(&[0.0; COUNT]);
    let (white_m, covariance) = (update.noise.white_m, &update.posterior.covariance);
    let validity =
        known.and_then(|_| Validity::new(stage, &update.parameters, white_m, covariance));
    let temperature = set.constants.temperature.rounded();
    let of_posterior = (&update.parameters, &update.posterior);
    let diagnosis = diagnose_blob(dataset, stage, &set, BlobUse::Recalibrated(Some(predicted)));
    // With what the sensors add in service.
    let budget = (diagnosis.predicted.as_ref())
        .filter(|_| known.is_some())
        .and_then(|of| Budget::new(stage, of_posterior, &temperature, of, update.residuals));
    let diagnosis = Diagnosis {
        validity,
        up_to: known.and_then(|known| known.up_to),
        budget,
        ..diagnosis
    };
    let rows = u32::try_from(dataset.rows.len()).unwrap_or(u32::MAX);
    let fit = FitRecord {
        forced: old.fit.forced,
        ..judgement.record(rows)
    };
    let gains = update.gains(&old_parameters);
    let (old, new) = (&old_parameters.probes, &update.parameters.probes);
    let off = old.as_flattened().iter().zip(new.as_flattened());
    let off: Vec<f64> = off.map(|(old, new)| old - new).collect();
    // What the sensors add in service, they add to both.
    let after = diagnosis.predicted.unwrap_or(predicted);
    let added = [0, 1, 2].map(|k| after.rms[k].powi(2) - predicted.rms[k].powi(2));
    Ok(Recalibration {
        set: ParameterSet { fit, ..set },
        known: known.map(|known| StoredPosterior {
            covariance: update.posterior.covariance.clone(),
            noise: update.noise,
            budget: diagnosis.budget.clone(),
            certificates: known.certificates.clone().next(),
            ..known.clone().with_logs(dataset)
        }),
        gains,
        predicted_before: expect(&off).with_added(added),
        chi_squared: update.chi_squared / update.residuals.max(1) as f64,
        judgement,
        judgement_before,
        diagnosis,
    })
}

/// A blob with other parameters of its model: range and correction of motion stay as they are.
///
/// # Errors
/// [`ParameterError`] where no decoder can use them.
pub fn with_parameters(
    old: &ParameterSet,
    parameters: &FieldParameters,
    stage: &Stage,
    origin: &Origin,
) -> Result<ParameterSet, ParameterError> {
    let mut temperature = old.constants.temperature.rounded::<f64>();
    for (per_mk, beyond) in temperature.per_mk.iter_mut().zip(parameters.gain_per_k) {
        (0..2).for_each(|sensor| per_mk[sensor] += 1e-3 * beyond[sensor]);
    }
    let made = Calibration {
        hall_window: old.constants.hall_window,
        capacitive_window: old.constants.capacitive_window,
        calibrated_planar: old.constants.calibrated_planar.map(f64::from),
        calibrated_vertical: old.constants.calibrated_vertical.map(f64::from),
        sensitivity_min: old.constants.sensitivity_min.into(),
        temperature,
        // Lags and bent arms are no matter of a gain, and a gain of a probe is a gain of the coil's field, too.
        motion_correction: old.motion_correction,
        ..calibration([], stage, old.model, parameters)?
    };
    made.prepare(origin)
}

#[cfg(test)]
mod tests;
