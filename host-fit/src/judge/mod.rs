//! How good a parameter set is on a log, by the decoder that runs on the target.

pub mod identify;
pub mod precision;
pub mod statistics;
pub mod uncertainty;

use crate::input::dataset::Dataset;
use crate::input::stage::Stage;
use crate::judge::statistics::{ErrorSums, PoseError};
use crate::problem::parameters::Parameters;
use crate::problem::zero_deviation::ZeroDeviation;
use rayon::prelude::*;
use runtime::geometry::ProbeGeometry;
use runtime::model::Probes;
use runtime::{Decode, ModelKind, ParameterSet, PlanarPose};

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
    pub const fn of_model(model: ModelKind) -> Self {
        if model.has_zero_deviation() {
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

/// The parameters that a set carries, in `f64`.
pub fn parameters_of(set: &ParameterSet) -> Parameters {
    Parameters {
        geometry: ProbeGeometry {
            lever_arm_m: set.geometry.lever_arm_m.map(f64::from),
            misalignment_rad: set.geometry.misalignment_rad.map(f64::from),
        },
        sensitivity: match set.probes.rounded() {
            Probes::Linear(probes) => probes,
        },
    }
}

/// Pose errors of every row, m, m, rad, with no zero deviation taken off; `None` where the
/// decoder found bad codes.
pub fn pose_errors(decoder: &dyn Decode, dataset: &Dataset) -> Vec<Option<[f64; 3]>> {
    let one = |row: &crate::input::dataset::Row| {
        let pose = row
            .frame
            .decode(decoder, &PlanarPose::ZERO)
            .planar()?
            .to_array();
        Some(std::array::from_fn(|axis| {
            f64::from(pose[axis]) - row.reference[axis]
        }))
    };
    dataset.rows.par_iter().map(one).collect()
}

/// Judges a parameter set on a dataset with reference.
pub fn judge(set: &ParameterSet, dataset: &Dataset, stage: &Stage, zeros: Zeros) -> Judgement {
    let parameters = parameters_of(set);
    let errors = pose_errors(&*set.decoder(), dataset);
    let mut sums = ErrorSums::default();
    let mut undecoded = 0;
    let mut taken_off = Vec::with_capacity(dataset.movements.len());
    for (index, movement) in dataset.movements.iter().enumerate() {
        let errors = &errors[movement.rows.clone()];
        let zero = match zeros {
            Zeros::None => ZeroDeviation::NONE,
            Zeros::Refit => mean(errors).map_or(ZeroDeviation::NONE, |mean| {
                ZeroDeviation::of_mean_error(&parameters, mean, &stage.search.delta_m)
            }),
            Zeros::Given(deltas) => deltas.get(index).map_or(ZeroDeviation::NONE, |&delta| {
                ZeroDeviation::given(&parameters, delta)
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
