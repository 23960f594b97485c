//! The posterior of the parameters, and the uncertainty of a pose that follows from it.

use super::parameters::FieldParameters;
use super::probe::{Probe, probes};
use super::temperature::Coefficient;
use super::terms::{self, CARRY, COUNT, PER_PROBE};
use super::whiten::Noise;
use crate::estimator::model;
use nalgebra::{DMatrix, Matrix3};
use runtime::matrix::{from_rows, inverse, to_rows};

/// Error of a probe's reading in service by the form of the model, rms, m: mean over simulated stages,
/// each fitted to 30 s without noise and drift; 16 to 46 nm.
pub const FORM_M: f64 = 25e-9;

/// Correlations above this are shown: the parameters stand in for each other.
pub const CORRELATION_SHOWN: f64 = 0.95;

/// The posterior of a fit: normal, with the parameters as its mean.
#[derive(Clone, Debug, PartialEq)]
pub struct Posterior {
    /// Covariance of the 81 parameters, in their order and units, and then, where the stage has sensors
    /// of temperature, of (k, h) of A, B, C, 1/K. For Models (12) to (31) the covariance of `determined`.
    pub covariance: DMatrix<f64>,
    /// Which parameters these are, by their places among the 81 and k and h.
    pub determined: Vec<usize>,
    probes: [Probe; 3],
    /// Noise of the probes that makes the noise floor, m.
    pub white_m: [f64; 3],
}

/// What is to be expected of a pose, as covariances of X, Y, Rz in m, m, rad.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseUncertainty {
    /// By the parameters and by what the model's form leaves: the same at every visit of the pose.
    pub systematic: Matrix3<f64>,
    /// By the noise of the probes: new at every tick.
    pub noise: Matrix3<f64>,
}

/// How errors become errors of a pose in X, Y, Rz: m, m, rad.
#[derive(Clone, Debug)]
pub struct PoseErrors {
    /// Per error of each parameter.
    pub by_parameter: [[f64; COUNT]; 3],
    /// Per m of error of each probe's signal.
    pub by_signal: [[f64; 3]; 3],
}

impl PoseErrors {
    /// At the pose `planar` (m, m, rad), `vertical` (m, rad, rad); `None` where the probes don't
    /// determine it.
    pub(super) fn new(probes: &[Probe; 3], planar: [f64; 3], vertical: [f64; 3]) -> Option<Self> {
        let read = probes.map(|probe| probe.read(planar, vertical));
        let by_signal = to_rows(&inverse(&from_rows(&read.map(|r| r.by_pose)))?);
        let by_parameter = by_signal.map(|row| {
            std::array::from_fn(|k| {
                let probe = k / PER_PROBE;
                -row[probe] * read[probe].by_parameter[k % PER_PROBE]
            })
        });
        Some(Self {
            by_parameter,
            by_signal,
        })
    }
}

/// The covariance of parameters as they act where mount and body are this far from T0, K, from a
/// [`Posterior::covariance`]: k and h change the sensitivity of a probe by a part.
pub fn covariance_at(
    covariance: &DMatrix<f64>,
    parameters: &FieldParameters,
    change_k: [f64; 2],
) -> DMatrix<f64> {
    let mut acts = DMatrix::identity(COUNT, covariance.nrows());
    for of in Coefficient::ALL {
        if of.row() < covariance.nrows() {
            let mut parts = [0.0; 3];
            parts[of.probe] = change_k[of.sensor];
            let mut column = acts.column_mut(of.row());
            column.copy_from_slice(&parameters.gain_change(parts));
        }
    }
    &acts * covariance * acts.transpose()
}

/// Standard errors of (k, h) of A, B, C, 1/K, from a [`Posterior::covariance`]; `None` without sensors of
/// temperature.
pub fn temperature_errors(covariance: &DMatrix<f64>) -> Option<[[f64; 2]; 3]> {
    let error = |probe: usize, sensor: usize| {
        let row = Coefficient::new(probe, sensor).row();
        covariance[(row, row)].sqrt()
    };
    (covariance.nrows() > COUNT)
        .then(|| [0, 1, 2].map(|probe| [0, 1].map(|sensor| error(probe, sensor))))
}

impl Posterior {
    /// `all` is the covariance of all unknowns.
    pub(super) fn new(all: &DMatrix<f64>, parameters: &FieldParameters, noise: &Noise) -> Self {
        let covariance = all.view((0, 0), (COUNT, COUNT)).into_owned();
        Self::from_covariance(covariance, parameters, noise)
    }

    /// The posterior with this covariance, for probes with this noise.
    pub fn from_covariance(
        covariance: DMatrix<f64>,
        parameters: &FieldParameters,
        noise: &Noise,
    ) -> Self {
        Self {
            determined: (0..covariance.nrows()).collect(),
            covariance,
            probes: probes(parameters),
            white_m: noise.white_m,
        }
    }

    /// The posterior of the parameters at the places `determined`.
    pub fn from_sandwich(
        determined: Vec<usize>,
        covariance: DMatrix<f64>,
        parameters: &FieldParameters,
    ) -> Self {
        Self {
            covariance,
            determined,
            probes: probes(parameters),
            white_m: [0.0; 3],
        }
    }

    /// The posterior of other parameters with a covariance of their own; the covariance of k and h is kept.
    #[must_use]
    pub fn with_parameters(&self, parameters: &FieldParameters, covariance: &DMatrix<f64>) -> Self {
        let (of_parameters, all) = (covariance.nrows(), self.covariance.nrows());
        let mut whole = covariance.clone().resize(all, all, 0.0);
        for i in of_parameters..all {
            for j in of_parameters..all {
                whole[(i, j)] = self.covariance[(i, j)];
            }
        }
        Self {
            covariance: whole,
            probes: probes(parameters),
            ..self.clone()
        }
    }

    /// The names of the rows of the covariance.
    pub fn names(&self) -> Vec<String> {
        let all = terms::names(usize::MAX);
        let named = self.determined.iter().map(|place| all[*place].clone());
        named.collect()
    }

    /// Pairs of parameters with a correlation above [`CORRELATION_SHOWN`] or below its negative, the strongest first.
    pub fn correlations_shown(&self) -> Vec<(String, String, f64)> {
        let names = self.names();
        let pairs = (0..names.len().min(COUNT)).flat_map(|i| (0..i).map(move |j| (j, i)));
        let pairs =
            pairs.map(|(i, j)| (names[i].clone(), names[j].clone(), self.correlation(i, j)));
        let mut pairs: Vec<_> = pairs
            .filter(|pair| pair.2.abs() > CORRELATION_SHOWN)
            .collect();
        pairs.sort_by(|a, b| b.2.abs().total_cmp(&a.2.abs()));
        pairs
    }

    /// The posterior with k and h; `all` is the covariance of all unknowns.
    #[must_use]
    pub(super) fn with_temperature(mut self, all: &DMatrix<f64>) -> Self {
        let rows = Coefficient::ROWS;
        self.covariance = all.view((0, 0), (rows, rows)).into_owned();
        self.determined = (0..self.covariance.nrows()).collect();
        self
    }

    /// The standard errors of the parameters, in their units.
    pub fn standard_errors(&self) -> [f64; COUNT] {
        std::array::from_fn(|k| self.covariance[(k, k)].sqrt())
    }

    /// Standard errors of the parameters of Model (31), in the order and the units of
    /// [`Parameters`](crate::estimator::paper::Parameters).
    pub fn standard_errors_31(&self) -> [Option<f64>; model::COUNT] {
        std::array::from_fn(|k| {
            let place = k % 3 * PER_PROBE + k / 3;
            let row = self.determined.iter().position(|known| *known == place)?;
            (k < 3 * CARRY).then(|| self.covariance[(row, row)].sqrt())
        })
    }

    /// The correlation of two parameters; none where an exact fit left no error.
    pub fn correlation(&self, i: usize, j: usize) -> f64 {
        let product = self.covariance[(i, i)] * self.covariance[(j, j)];
        match product > 0.0 {
            true => self.covariance[(i, j)] / product.sqrt(),
            false => 0.0,
        }
    }

    /// What is to be expected of the pose `planar` (m, m, rad) at `vertical` (m, rad, rad);
    /// `None` where the probes don't determine it.
    pub fn at_pose(&self, planar: [f64; 3], vertical: [f64; 3]) -> Option<PoseUncertainty> {
        let read = self
            .probes
            .each_ref()
            .map(|probe| probe.read(planar, vertical));
        let by_signal = inverse(&from_rows(&read.map(|r| r.by_pose)))?;
        let of_signals = self.of_signals(&read.map(|r| r.by_parameter));
        let by_probes = |errors_m: [f64; 3]| {
            let by = by_signal * Matrix3::from_diagonal(&errors_m.into());
            by * by.transpose()
        };
        Some(PoseUncertainty {
            systematic: by_signal * of_signals * by_signal.transpose() + by_probes([FORM_M; 3]),
            noise: by_probes(self.white_m),
        })
    }

    /// Covariance of the signals of the probes (m2) by the errors of the parameters, from the derivatives of each signal.
    fn of_signals(&self, by_parameter: &[[f64; PER_PROBE]; 3]) -> Matrix3<f64> {
        let rows = self.covariance.nrows();
        let mut columns = self.covariance.as_slice().chunks_exact(3 * rows);
        let mut out = Matrix3::zeros();
        for (one, derivatives) in by_parameter.iter().enumerate() {
            // A sum for each row, over three columns at once: the processor adds several rows at once.
            let mut sums = [0.0; COUNT];
            let sums = &mut sums[..(one + 1) * PER_PROBE];
            for ([a, b, c], columns) in derivatives.as_chunks().0.iter().zip(&mut columns) {
                let column = |k: usize| columns[k * rows..].iter();
                let columns = column(0).zip(column(1)).zip(column(2));
                for (sum, ((of_a, of_b), of_c)) in sums.iter_mut().zip(columns) {
                    *sum += a * of_a + b * of_b + c * of_c;
                }
            }
            for (other, sums) in sums.chunks_exact(PER_PROBE).enumerate() {
                let pairs = by_parameter[other].iter().zip(sums);
                out[(one, other)] = pairs.map(|(derivative, sum)| derivative * sum).sum();
                out[(other, one)] = out[(one, other)];
            }
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimator::sample_for_tests::parameters;
    use crate::estimator::terms::name;
    use crate::estimator::whiten::UNKNOWNS;
    use runtime::VerticalPose;

    /// A small error of one parameter at a time, decoded, against what is predicted for it; the
    /// decoder's one step is wrong by up to some thousandths of the effect.
    #[test]
    fn the_predicted_error_of_a_pose_is_what_the_decoder_makes_of_the_parameters_error() {
        let truth = parameters();
        let (planar, vertical) = ([210e-6, -330e-6, 150e-6], [120e-6, 300e-6, -260e-6]);
        let signal_m = probes(&truth).map(|probe| probe.signal_m(planar, vertical));
        let decode = |parameters: &FieldParameters| {
            let constants = parameters.constants(1.0).expect("sound");
            let vertical = VerticalPose::from_array(vertical);
            constants.decode(signal_m, &vertical).to_array()
        };
        let noise = Noise {
            white_m: [5e-7; 3],
            drift: [0.0; 3],
        };
        for k in 0..COUNT {
            let values = truth.probes.as_flattened();
            let error = 1e-4 * values[k].abs().max(0.01);
            let moved = |step: f64| {
                let mut parameters = truth;
                parameters.probes[k / PER_PROBE][k % PER_PROBE] += step;
                decode(&parameters)
            };
            let (up, down) = (moved(error), moved(-error));
            let mut covariance = DMatrix::zeros(UNKNOWNS, UNKNOWNS);
            covariance[(k, k)] = error * error;
            let at_pose = |covariance: DMatrix<f64>| {
                let posterior = Posterior::new(&covariance, &truth, &noise);
                posterior.at_pose(planar, vertical).expect("a pose")
            };
            // Errors of the form act as the noise of the probes does.
            let form_only = at_pose(DMatrix::zeros(UNKNOWNS, UNKNOWNS));
            let form_noise = form_only.noise * (FORM_M / noise.white_m[0]).powi(2);
            assert!((form_only.systematic - form_noise).norm() < 1e-9 * form_noise.norm());
            let parameters_only = at_pose(covariance).systematic - form_only.systematic;
            for axis in 0..3 {
                let found = 0.5 * (up[axis] - down[axis]).abs();
                let predicted = parameters_only[(axis, axis)].max(0.0).sqrt();
                let close = (found - predicted).abs() <= 1e-2 * found + 1e-12;
                assert!(close, "{} {axis}: {found:e} {predicted:e}", name(k));
            }
        }
    }
}
