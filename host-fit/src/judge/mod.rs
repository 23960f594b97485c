//! How good a parameter set is on a log, by the decoder that runs on the target.

pub mod identify;
pub mod lag;
pub mod left_out;
pub mod of_rows;
pub mod precision;
pub mod statistics;
pub mod stretches;
pub mod uncertainty;
pub mod whole;

use crate::input::dataset::{Dataset, LogSource, LoggedFrame, Row};
use crate::input::stage::Stage;
use crate::judge::statistics::{ErrorSums, PoseError};
use crate::problem::model::Model;
use crate::problem::parameters::Parameters;
use crate::problem::zero_deviation::ZeroDeviation;
use rayon::prelude::*;
use runtime::{AnyDecoder, ParameterSet, PlanarPose};

/// Which zero deviations are taken off before errors are counted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Zeros<'z> {
    /// None: the pose as the target gives it without a re-zero.
    None,
    /// The closed-form one of each movement, over all its rows.
    Refit,
    /// Given ones, by movement, m at the probes.
    Given(&'z [[f64; 3]]),
}

impl Zeros<'_> {
    /// The way to judge a model as it was fitted: refitted where it has zero deviations.
    pub const fn of_model(model: &Model) -> Self {
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

    /// How a title names it.
    pub const fn words(&self) -> &'static str {
        match self {
            Self::None => "no zero deviation taken off",
            Self::Refit => "zero deviations refitted",
            Self::Given(_) => "given zero deviations taken off",
        }
    }
}

/// The figures of one parameter set on one dataset.
#[derive(Clone, Debug, PartialEq)]
pub struct Judgement {
    /// Errors over all decoded rows.
    pub errors: PoseError,
    /// The zero deviation that was taken off each movement.
    pub zeros: Vec<ZeroDeviation>,
    /// Rows that the decoder could not decode (bad codes); they count in no error.
    pub undecoded: usize,
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
        let one = |row: &Row| error(&decoder, &row.frame, row.reference);
        Self {
            parameters: Parameters::of_set(set),
            errors: dataset.rows.par_iter().map(one).collect(),
        }
    }

    /// The figures with these zero deviations taken off.
    pub fn judge(&self, dataset: &Dataset, stage: &Stage, zeros: Zeros) -> Judgement {
        let mut sums = ErrorSums::default();
        let mut undecoded = 0;
        let mut taken_off = Vec::with_capacity(dataset.movements.len());
        for (index, movement) in dataset.movements.iter().enumerate() {
            let errors = &self.errors[movement.rows.clone()];
            let zero = match zeros {
                Zeros::None => ZeroDeviation::NONE,
                Zeros::Refit => mean(errors).map_or(ZeroDeviation::NONE, |mean| {
                    ZeroDeviation::of_mean_error(&self.parameters, mean, &stage.search.delta_m)
                }),
                Zeros::Given(deltas) => deltas.get(index).map_or(ZeroDeviation::NONE, |&delta| {
                    ZeroDeviation::given(&self.parameters, delta)
                }),
            };
            for (row, error) in movement.rows.clone().zip(errors) {
                match error {
                    Some(error) => sums.add(row, std::array::from_fn(|k| error[k] - zero.pose[k])),
                    None => undecoded += 1,
                }
            }
            taken_off.push(zero);
        }
        Judgement {
            errors: sums.finish(),
            zeros: taken_off,
            undecoded,
        }
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
pub fn error(decoder: &AnyDecoder, frame: &LoggedFrame, reference: [f64; 3]) -> Option<[f64; 3]> {
    let pose = frame
        .decode(decoder, &PlanarPose::ZERO)
        .planar()?
        .to_array();
    let error = |axis: usize| f64::from(pose[axis]) - reference[axis];
    Some(std::array::from_fn(error))
}

/// The errors of each log, of errors by row.
pub fn errors_by_log(errors: &[Option<[f64; 3]>], dataset: &Dataset) -> Vec<PoseError> {
    let of_log = |log: &LogSource| {
        let mut sums = ErrorSums::default();
        for row in log.rows.clone() {
            if let Some(error) = errors[row] {
                sums.add(row, error);
            }
        }
        sums.finish()
    };
    dataset.logs.iter().map(of_log).collect()
}

/// Mean of the errors that there are.
fn mean(errors: &[Option<[f64; 3]>]) -> Option<[f64; 3]> {
    let mut sum = [0.0; 3];
    let mut rows = 0.0;
    for error in errors.iter().flatten() {
        for axis in 0..3 {
            sum[axis] += error[axis];
        }
        rows += 1.0;
    }
    (rows > 0.0).then(|| sum.map(|s| s / rows))
}
