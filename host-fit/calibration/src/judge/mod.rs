//! How good a parameter set is on a log, by the decoder that runs on the target.
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
//! use hallstage_calibration::judge::{Decoded, Zeros};
//!
//! let judgement = Decoded::new(&fit.set, &dataset).judge(&dataset, &stage, Zeros::Refit);
//! assert!(judgement.errors.axes[0].rms < 1e-6); // X, m
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod identify;
pub mod in_motion;
mod judgement;
pub mod precision;
pub mod predicted;
pub mod statistics;
pub mod verdict;

pub use judgement::{Judge, Judgement, LogJudgement};

use hallstage_input::dataset::{Dataset, Row};
use hallstage_input::stage::Stage;
use hallstage_input::statistics::median;
use hallstage_solver::estimator::model::Model;
use hallstage_solver::estimator::paper::Parameters;
use hallstage_solver::estimator::robust::{HALF, Loss};
use hallstage_solver::estimator::rows::measured_motion;
use hallstage_solver::estimator::zero_deviation::ZeroDeviation;
use rayon::prelude::*;
use runtime::{AnyDecoder, MotionCorrection, ParameterSet, PlanarPose};
use statistics::ErrorSums;

/// Which zero deviations are taken off before errors are counted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Zeros<'z> {
    /// No zero deviation is taken off: the pose of the target without a re-zero.
    None,
    /// The closed-form one of each movement, over all its rows.
    Refit,
    /// Given ones, by movement, m at the probes.
    Given(&'z [[f64; 3]]),
}

impl Zeros<'_> {
    /// Refitted for a model with zero deviations, else none.
    pub const fn for_model(model: &Model) -> Self {
        if model.has_zero_deviation {
            Self::Refit
        } else {
            Self::None
        }
    }

    /// How JSON names it: "zero" where none are taken off, else "fit".
    pub const fn name(&self) -> &'static str {
        match self {
            Self::None => "zero",
            Self::Refit | Self::Given(_) => "fit",
        }
    }
}

/// A dataset decoded with one parameter set: to be judged in several ways.
#[derive(Clone, Debug, PartialEq)]
pub struct Decoded {
    /// The parameters that the set carries.
    pub parameters: Parameters,
    /// Pose errors of every row, m, m, rad, with no zero deviation taken off; `None` where the
    /// decoder found bad codes.
    pub errors: Vec<Option<[f64; 3]>>,
}

impl Decoded {
    /// Decodes every row of a dataset with reference.
    pub fn new(set: &ParameterSet, dataset: &Dataset) -> Self {
        let decoder = set.decoder();
        let one = |row: &Row| error(&decoder, row);
        Self {
            parameters: Parameters::from_set(set),
            errors: dataset.rows.par_iter().map(one).collect(),
        }
    }

    /// With poses corrected by speed and acceleration of the reference and the gaps.
    #[must_use]
    pub fn corrected(&self, correction: &MotionCorrection, dataset: &Dataset) -> Self {
        let mut corrected = self.clone();
        let motion = measured_motion(dataset, &self.trusted(dataset));
        for (error, motion) in corrected.errors.iter_mut().zip(&motion) {
            let found = error.map(|error| PlanarPose::from_array(error.map(|x| x as f32)));
            let less = found.and_then(|found| correction.correct(found, motion));
            *error = less.map(|pose| pose.to_array().map(f64::from));
        }
        corrected
    }

    /// The rows with errors near the errors around them. A row where the reference jumps for a moment is not among them.
    pub fn trusted(&self, dataset: &Dataset) -> Vec<bool> {
        const AROUND: usize = 2;
        let jump = |row: usize| {
            let rows = &dataset.movements[dataset.rows[row].movement].rows;
            let around =
                row.saturating_sub(AROUND).max(rows.start)..(row + AROUND + 1).min(rows.end);
            let around = self.errors[around].iter().flatten();
            let own = self.errors[row].unwrap_or_default();
            let middle = |axis: usize| {
                let mut errors: Vec<f64> = around.clone().map(|error| error[axis]).collect();
                median(&mut errors).unwrap_or_default()
            };
            std::array::from_fn(|axis| own[axis] - middle(axis))
        };
        let jumps = (0..self.errors.len()).into_par_iter().map(jump).collect();
        let movements = dataset
            .movements
            .iter()
            .map(|movement| movement.rows.clone());
        let weights = Loss::Cauchy.weights(jumps, movements);
        weights.into_iter().map(|weight| weight >= HALF).collect()
    }

    /// The figures with these zero deviations taken off.
    pub fn judge(&self, dataset: &Dataset, stage: &Stage, zeros: Zeros) -> Judgement {
        let mut judge = Judge::new(&self.parameters, stage, dataset.logs.len());
        for movement in &dataset.movements {
            for row in movement.rows.clone() {
                let begins = row == movement.rows.start;
                let (error, row) = (self.errors[row], &dataset.rows[row]);
                judge.take((movement.log, movement.index, begins), row, error);
            }
        }
        judge.judgement(zeros)
    }

    /// The errors of movements that begin at rest, less their mean over the first `rest_s`, as a stage is zeroed.
    /// The rows at rest have no error.
    pub fn rezeroed(&self, dataset: &Dataset, rest_s: f64) -> Vec<Option<[f64; 3]>> {
        let mut errors = self.errors.clone();
        for movement in &dataset.movements {
            let (rows, errors) = (
                &dataset.rows[movement.rows.clone()],
                &mut errors[movement.rows.clone()],
            );
            let begin_us = rows.first().map_or(0, |row| row.t_us);
            let rest = rows.partition_point(|row| (row.t_us - begin_us) as f64 * 1e-6 < rest_s);
            let mut sums = ErrorSums::NONE;
            errors[..rest]
                .iter_mut()
                .for_each(|error| sums.take(error.take()));
            let zero = sums.mean().unwrap_or([f64::NAN; 3]);
            for error in errors.iter_mut().flatten() {
                (0..3).for_each(|axis| error[axis] -= zero[axis]);
            }
        }
        errors
    }

    /// The errors with the zero deviations of a judgement taken off.
    pub fn errors_less(&self, zeros: &[ZeroDeviation], dataset: &Dataset) -> Vec<Option<[f64; 3]>> {
        let mut errors = self.errors.clone();
        for (movement, zero) in dataset.movements.iter().zip(zeros) {
            for error in errors[movement.rows.clone()].iter_mut().flatten() {
                for (error, zero) in error.iter_mut().zip(zero.pose) {
                    *error -= zero;
                }
            }
        }
        errors
    }
}

/// The decoded pose less the reference, m, m, rad, no zero deviation taken off; `None` where the
/// decoder finds bad codes.
pub fn error(decoder: &AnyDecoder, row: &Row) -> Option<[f64; 3]> {
    let reading = row.frame.decode(decoder, &PlanarPose::ZERO);
    let pose = reading.planar()?.to_array();
    let error = |axis: usize| f64::from(pose[axis]) - row.reference[axis];
    Some(std::array::from_fn(error))
}
