//! Errors in service by a posterior, and whether the field model or Model (31) has the smaller ones.

use super::parameters::FieldParameters;
use super::posterior::{FORM_M, PoseErrors, Posterior};
use super::probe::probes;
use super::terms::COUNT;
use crate::estimator::paper::Parameters;
use hallstage_input::stage::Stage;
use nalgebra::{DMatrix, DVector};
use runtime::VerticalPose;

/// Poses over which service is averaged.
const POSES: usize = 256;
/// Systematic errors above this part of the noise (variances) are too large, whatever Model (31)
/// seems to have: a log that determines so little can't show that either.
const SYSTEMATIC_MAX: f64 = 1.0;
/// Systematic errors below this part of the noise (variances) are rounding: one per cent of the
/// noise floor.
const ROUNDING: f64 = 0.02;

/// What service over the whole range of a log has to expect: variances of X, Y, Rz (m2, m2,
/// rad2), means over poses spread evenly in the box of the log's ranges.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ServiceVariance {
    /// By the parameters of the field model.
    pub systematic: [f64; 3],
    /// By the noise of the probes: the floor.
    pub noise: [f64; 3],
    /// Mean squared difference between the poses of the other model and of the field model.
    pub difference: [f64; 3],
}

/// The poses of a service: how errors of the parameters and of the signals show there, as means.
#[derive(Clone, Debug)]
pub struct Service {
    /// How errors show at each pose.
    pub poses: Vec<PoseErrors>,
    /// For X, Y, Rz, the products of the derivatives by two parameters.
    by_parameters: [Vec<[f64; COUNT]>; 3],
    /// For X, Y, Rz, the variance by the noise of the probes.
    by_noise: [f64; 3],
    /// The same by the errors of the form.
    by_form: [f64; 3],
}

impl Service {
    /// The service of probes with this noise at poses X, Y, Rz and Z, Rx, Ry (m, rad); `None` where the probes
    /// do not determine a pose.
    pub fn new(
        parameters: &FieldParameters,
        white_m: [f64; 3],
        poses: impl ExactSizeIterator<Item = ([f64; 3], [f64; 3])>,
    ) -> Option<Self> {
        let probes = probes(parameters);
        let share = 1.0 / poses.len() as f64;
        let mut service = Self {
            poses: Vec::with_capacity(poses.len()),
            by_parameters: [0; 3].map(|_| vec![[0.0; COUNT]; COUNT]),
            by_noise: [0.0; 3],
            by_form: [0.0; 3],
        };
        for (planar, vertical) in poses {
            let errors = PoseErrors::new(&probes, planar, vertical)?;
            for axis in 0..3 {
                let by = &errors.by_parameter[axis];
                for (row, x) in service.by_parameters[axis].iter_mut().zip(by) {
                    for (sum, y) in row.iter_mut().zip(by) {
                        *sum += share * (x * y);
                    }
                }
            }
            service.poses.push(errors);
        }
        service.by_noise = service.by_signals(white_m.map(|m| m * m));
        service.by_form = service.by_signals([FORM_M * FORM_M; 3]);
        Some(service)
    }

    /// Variances of X, Y, Rz (m2, m2, rad2) by errors of the signals of A, B, C with these variances, m2.
    pub fn by_signals(&self, variances_m2: [f64; 3]) -> [f64; 3] {
        let share = 1.0 / self.poses.len() as f64;
        [0, 1, 2].map(|axis| {
            let of_pose = |pose: &PoseErrors| {
                let terms = pose.by_signal[axis].iter().zip(variances_m2);
                terms.map(|(by, m2)| by * by * m2).sum::<f64>()
            };
            share * self.poses.iter().map(of_pose).sum::<f64>()
        })
    }

    /// What to expect of parameters with this covariance.
    pub fn variance(&self, covariance: &DMatrix<f64>) -> ServiceVariance {
        let systematic = [0, 1, 2].map(|axis| {
            let mut sum = self.by_form[axis];
            let columns = covariance.column_iter().zip(&self.by_parameters[axis]);
            for (column, products) in columns {
                for (covariance, product) in column.iter().zip(products) {
                    sum += covariance * product;
                }
            }
            sum
        });
        ServiceVariance {
            systematic,
            noise: self.by_noise,
            difference: [0.0; 3],
        }
    }

    /// Mean squares of the errors of X, Y, Rz (m2, m2, rad2) by an error of the parameters.
    pub fn squares(&self, off: &[f64]) -> [f64; 3] {
        self.by_parameters.each_ref().map(|products| {
            let rows = products.iter().zip(off);
            rows.map(|(row, x)| x * row.iter().zip(off).map(|(p, y)| p * y).sum::<f64>())
                .sum()
        })
    }

    /// Of X, Y, Rz the variance, over the errors that are possible with this covariance about `off`, of their
    /// mean square: m4, m4, rad4.
    pub fn spread(&self, covariance: &DMatrix<f64>, off: &[f64]) -> [f64; 3] {
        let covariance = covariance.view((0, 0), (COUNT, COUNT));
        let off = DVector::from_column_slice(off);
        self.by_parameters.each_ref().map(|products| {
            let products = DMatrix::from_fn(COUNT, COUNT, |i, j| products[i][j]);
            let both = &products * covariance;
            let pull = products * &off;
            2.0 * both.component_mul(&both.transpose()).sum()
                + 4.0 * pull.dot(&(covariance * &pull))
        })
    }
}

/// Mean squared difference between poses and what another model decodes there.
fn difference(
    parameters: &FieldParameters,
    other: &FieldParameters,
    ranges: ([f64; 3], [f64; 3]),
) -> Option<[f64; 3]> {
    let constants = other.constants(1.0)?;
    let probes = probes(parameters);
    let mut sum = [0.0; 3];
    for (planar, vertical) in service_poses(ranges) {
        let signal_m = probes.map(|probe| probe.signal_m(planar, vertical));
        let decoded = constants.decode(signal_m, &VerticalPose::from_array(vertical));
        for ((sum, decoded), planar) in sum.iter_mut().zip(decoded.to_array()).zip(planar) {
            *sum += (decoded - planar) * (decoded - planar) / POSES as f64;
        }
    }
    Some(sum)
}

/// The field model against Model (31): the better choice, and the reason.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Comparison {
    /// Whether the field model is the better choice.
    pub field: bool,
    /// Whether only the declared errors of the resets let the log carry it.
    pub by_resets: bool,
    /// What it has to expect in service.
    pub service: ServiceVariance,
}

impl ServiceVariance {
    /// The variances of the field model with this posterior, and the difference to another model, over
    /// X, Y, Rz and Z, Rx, Ry of the largest magnitudes `ranges` (m, rad). Infinite where the
    /// probes do not determine the pose.
    fn new(
        parameters: &FieldParameters,
        posterior: &Posterior,
        other: &FieldParameters,
        ranges: ([f64; 3], [f64; 3]),
    ) -> Self {
        let found = Service::new(parameters, posterior.white_m, service_poses(ranges)).and_then(
            |service| {
                Some(Self {
                    difference: difference(parameters, other, ranges)?,
                    ..service.variance(&posterior.covariance)
                })
            },
        );
        found.unwrap_or(Self {
            systematic: [f64::INFINITY; 3],
            noise: [1.0; 3],
            difference: [0.0; 3],
        })
    }

    /// Errors of the field model in service over the noise floor: of X, Y, Rz.
    pub fn ratios(&self) -> [f64; 3] {
        [0, 1, 2].map(|k| (1.0 + self.systematic[k] / self.noise[k]).sqrt())
    }

    /// The largest ratio of systematic variance to variance of the noise over the axes.
    pub fn worst(&self) -> f64 {
        (0..3).fold(0.0, |worst, k| {
            f64::max(worst, self.systematic[k] / self.noise[k])
        })
    }

    /// Errors of Model (31) in service over the noise floor, by the field model.
    pub fn ratios_31(&self) -> [f64; 3] {
        [0, 1, 2].map(|k| (1.0 + self.difference[k] / self.noise[k]).sqrt())
    }

    // The difference between the models holds the errors of both: where it is all the field
    // model's, its mean square is the systematic variance. So the field model gains where the
    // difference is more than twice that.

    fn gains_in(&self, k: usize) -> bool {
        self.difference[k] > 2.0 * self.systematic[k]
    }

    /// Whether the field model makes an axis worse than Model (31) has it.
    fn loses(&self) -> bool {
        let accepted = |k: usize| {
            if self.gains_in(k) {
                SYSTEMATIC_MAX
            } else {
                ROUNDING
            }
        };
        (0..3).any(|k| self.systematic[k] > accepted(k) * self.noise[k])
    }

    /// Whether it makes an axis better.
    fn gains(&self) -> bool {
        (0..3).any(|k| self.gains_in(k) && self.difference[k] > ROUNDING * self.noise[k])
    }

    /// Whether the worst axis is better than the worst axis of Model (31). The difference between the models is taken
    /// less its systematic part.
    fn is_better(&self) -> bool {
        let model_31_error = |k: usize| (self.difference[k] - self.systematic[k]) / self.noise[k];
        (0..3).any(|k| model_31_error(k) > self.worst())
    }
}

impl Comparison {
    /// Compares a fit of the field model with one of Model (31) to the same rows, over X, Y, Rz and Z, Rx, Ry of the
    /// largest magnitudes `ranges` (m, rad).
    pub fn new(
        parameters: &FieldParameters,
        posterior: &Posterior,
        model_31: &Parameters,
        stage: &Stage,
        ranges: ([f64; 3], [f64; 3]),
    ) -> Self {
        let model_31 = FieldParameters::from_model_31(model_31, stage);
        let service = ServiceVariance::new(parameters, posterior, &model_31, ranges);
        let by_resets = stage.reset_sd.is_some() && service.loses() && service.is_better();
        Self {
            field: by_resets || !service.loses() && service.gains(),
            by_resets,
            service,
        }
    }

    /// Whether an axis of the field model is worse than of Model (31).
    pub fn loses(&self) -> bool {
        self.service.loses() && !self.by_resets
    }
}

/// Poses (X, Y, Rz and Z, Rx, Ry) spread evenly in the box of the largest magnitudes given.
pub fn service_poses(
    (planar_range, vertical_range): ([f64; 3], [f64; 3]),
) -> impl ExactSizeIterator<Item = ([f64; 3], [f64; 3])> {
    (0..POSES).map(move |index| {
        let place: [f64; 6] = std::array::from_fn(|axis| 2.0 * halton(index + 1, axis) - 1.0);
        let planar = [0, 1, 2].map(|k| place[k] * planar_range[k]);
        let vertical = [0, 1, 2].map(|k| place[3 + k] * vertical_range[k]);
        (planar, vertical)
    })
}

/// The `index`-th place of the axis in an even spread over (0, 1): the radical inverse in the
/// axis' prime.
fn halton(index: usize, axis: usize) -> f64 {
    const PRIMES: [usize; 6] = [2, 3, 5, 7, 11, 13];
    let base = PRIMES[axis];
    let (mut rest, mut digit, mut sum) = (index, 1.0, 0.0);
    while rest > 0 {
        digit /= base as f64;
        sum += digit * (rest % base) as f64;
        rest /= base;
    }
    sum
}
