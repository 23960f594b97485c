//! Standard errors of Models (12) to (31), and the lag of the reference.
//!
//! The residuals of neighbouring rows are not independent: the interferometers drift. So the
//! covariance is the sandwich A^-1 M A^-1 with M summed over clusters of rows that may depend on
//! each other: whole movements where there are at least 20, else blocks of half a second within
//! them. The standard error as if rows were independent is a lower
//! bound, so that a chance cancellation within few clusters does no harm.

use super::dynamics::MotionFit;
use super::parameters::FieldParameters;
use super::pose::{COLUMNS, Columns, Decoder, ERROR, LAG, PROBE_LAGS};
use super::posterior::Posterior;
use super::terms::PER_PROBE;
use crate::estimator::gauss_newton::{Equations, Normal, Point};
use crate::estimator::model::ParameterId;
use crate::estimator::paper::Parameters;
use crate::estimator::problem::Problem;
use nalgebra::{DMatrix, DVector, Matrix2, Matrix3, SMatrix, SVector, SymmetricEigen};
use rayon::prelude::*;

/// Unknowns: the parameters and the lags.
const UNKNOWNS: usize = COLUMNS - 1;
type Square = SMatrix<f64, UNKNOWNS, UNKNOWNS>;
type Column = SVector<f64, UNKNOWNS>;

/// Fewer movements than this are cut into blocks.
const CLUSTERS_MIN: usize = 20;
/// Length of a block, s: the drift of an interferometer in a laboratory changes over seconds.
const BLOCK_S: f64 = 0.5;
/// Smallest eigenvalue of the scaled curvature that still counts as information.
const EIGENVALUE_MIN: f64 = 1e-10;

/// The lag of the reference behind the probes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReferenceLag {
    /// s; positive where the reference shows an earlier pose.
    pub value_s: f64,
    /// s.
    pub standard_error_s: f64,
}

/// How well a log determines the parameters of a model of the paper.
#[derive(Clone, Debug, PartialEq)]
pub struct Sandwich {
    /// The posterior of the parameters that have a standard error. The others are not fitted, or the log does not
    /// determine them. With fewer clusters than parameters no parameter has a standard error.
    pub posterior: Posterior,
    /// Standard errors as if rows were independent: the limit by the motion of the log alone. Zero for a parameter that
    /// is not fitted.
    pub motion_error: [f64; LAG],
    /// Parameters that the log does not determine: no motion shows them, or only in combination
    /// with others.
    pub undetermined: Vec<ParameterId>,
    /// The lag, one Gauss-Newton step from none with all parameters; `None` where no motion shows it.
    pub lag: Option<ReferenceLag>,
    /// The lags of the probes, by the same step.
    pub motion: MotionFit,
}

/// The standard errors of some unknowns.
struct Errors {
    inverse: Square,
    undetermined: Vec<usize>,
    clustered: [f64; UNKNOWNS],
    independent: [f64; UNKNOWNS],
}

impl Sandwich {
    /// At a solution; `None` when the solution itself cannot be evaluated.
    pub fn new(problem: &Problem, parameters: &Parameters) -> Option<Self> {
        let sums = Sums::new(problem, parameters)?;
        let free = problem.free();
        let errors = sums.errors(&free);
        // Fewer clusters than parameters do not separate them.
        let is_enough = sums.clusters > free.len();
        let standard_error = |k: usize| errors.standard_error(k).filter(|_| is_enough);
        let determined: Vec<usize> = (free.iter().copied())
            .filter(|&k| standard_error(k).is_some())
            .collect();
        let covariance = errors.inverse * sums.clustered * errors.inverse;
        // Of an exact fit there is none.
        let correlation = |a: usize, b: usize| {
            let product = covariance[(a, a)] * covariance[(b, b)];
            match product > 0.0 {
                true => covariance[(a, b)] / product.sqrt(),
                false => 0.0,
            }
        };
        // With the standard errors on its diagonal, whichever way they were found.
        let error = |k: usize| standard_error(determined[k]).unwrap_or_default();
        let n = determined.len();
        let covariance = DMatrix::from_fn(n, n, |i, j| match i == j {
            true => error(i).powi(2),
            false => error(i) * error(j) * correlation(determined[i], determined[j]),
        });
        let place = |&index: &usize| index % 3 * PER_PROBE + index / 3;
        let places = determined.iter().map(place).collect();
        let model_31 = FieldParameters::from_model_31(parameters, problem.stage);
        Some(Self {
            posterior: Posterior::from_sandwich(places, covariance, &model_31),
            motion_error: std::array::from_fn(|k| errors.independent[k]),
            undetermined: (problem.model.free())
                .filter(|id| errors.undetermined.contains(&id.index))
                .collect(),
            lag: sums.lag(&free),
            motion: sums.motion(&free),
        })
    }
}

impl Errors {
    /// The larger of both; `None` for an unknown that the log does not determine.
    fn standard_error(&self, k: usize) -> Option<f64> {
        let largest = self.independent[k].max(self.clustered[k]);
        (!self.undetermined.contains(&k) && largest.is_finite()).then_some(largest)
    }
}

/// Sums over the rows.
struct Sums {
    /// J' W J and J' W e.
    normal: Normal<COLUMNS>,
    /// Outer products of the scores J' W e, summed over each cluster first, with the usual correction for
    /// few clusters.
    clustered: Square,
    clusters: usize,
    /// J' W S W J with the covariance S of the residuals: as if rows were independent, axes not.
    independent: Square,
    /// Residuals, and unknowns that the zero deviations took.
    residuals: usize,
    zeros: usize,
}

impl Sums {
    fn new(problem: &Problem, parameters: &Parameters) -> Option<Self> {
        let decoder = &Decoder::new(parameters, problem.stage)?;
        let at = Point {
            values: DVector::from_column_slice(&parameters.values),
            offsets: Vec::new(),
        };
        let movements = problem.movement_rows();
        let block = if movements.len() >= CLUSTERS_MIN {
            usize::MAX
        } else {
            (BLOCK_S / problem.stage.servo_period_s).ceil().max(1.0) as usize
        };
        let rows_of = |movement: usize| &problem.rows.rows[movements[movement].clone()];
        let movement_sums = |movement: usize| {
            let rows = rows_of(movement);
            let mean = decoder.mean(problem, rows)?;
            let mut covariance = Matrix3::zeros();
            let mut scores = Vec::new();
            for cluster in rows.chunks(block.min(rows.len())) {
                let mut score = Column::zeros();
                for row in cluster {
                    let columns = less(&decoder.columns(row)?, &mean);
                    for i in 0..3 {
                        let error = row.weight * columns[i][ERROR];
                        for (sum, by) in score.iter_mut().zip(&columns[i]) {
                            *sum += error * by;
                        }
                        for j in 0..3 {
                            covariance[(i, j)] += error * columns[j][ERROR];
                        }
                    }
                }
                scores.push(score);
            }
            Some((covariance, scores))
        };
        let found: Option<Vec<_>> = (0..movements.len())
            .into_par_iter()
            .map(movement_sums)
            .collect();
        let mut sums = Self {
            normal: problem.normal(&at)?,
            clustered: Square::zeros(),
            clusters: 0,
            independent: Square::zeros(),
            residuals: 3 * problem.rows.rows.len(),
            zeros: 3 * movements.len() * usize::from(problem.model.has_zero_deviation),
        };
        let mut covariance = Matrix3::zeros();
        for (movement_sums, scores) in found? {
            covariance += movement_sums / problem.rows.rows.len() as f64;
            sums.clusters += scores.len();
            for score in scores {
                sums.clustered.ger(1.0, &score, &score, 1.0);
            }
        }
        let n = sums.clusters.max(2) as f64;
        sums.clustered *= n / (n - 1.0);
        // J' S J with S = R' R.
        let root = covariance
            .cholesky()
            .map_or_else(Matrix3::zeros, |s| s.l().transpose());
        let independent = Normal::sum(movements.len(), |movement| {
            let rows = rows_of(movement);
            let mean = decoder.mean(problem, rows)?;
            let mut sums: Normal<COLUMNS> = Normal::none();
            for row in rows {
                let columns = less(&decoder.columns(row)?, &mean);
                let rooted: Columns = [0, 1, 2].map(|i| {
                    std::array::from_fn(|k| {
                        (0..3).fold(0.0, |sum, j| sum + root[(i, j)] * columns[j][k])
                    })
                });
                sums.add_row(&rooted, row.weight);
            }
            Some(sums)
        })?;
        sums.independent = Square::from_fn(|i, j| independent.curvature(i, j));
        Some(sums)
    }

    /// The standard errors of some unknowns.
    fn errors(&self, free: &[usize]) -> Errors {
        let curvature = Square::from_fn(|i, j| self.normal.curvature(i, j));
        let (inverse, undetermined) = pseudo_inverse(&curvature, free);
        let used = free.len() + self.zeros;
        let scale = self.residuals as f64 / self.residuals.saturating_sub(used).max(1) as f64;
        let mut errors = Errors {
            inverse,
            undetermined,
            clustered: [0.0; UNKNOWNS],
            independent: [0.0; UNKNOWNS],
        };
        for &k in free {
            let row = inverse.row(k);
            let error = |meat: &Square| ((row * meat * row.transpose())[0] * scale).sqrt();
            errors.independent[k] = error(&self.independent);
            errors.clustered[k] = error(&self.clustered);
        }
        errors
    }

    /// The lags of the probes, with all parameters that are fitted and the lag.
    fn motion(&self, free: &[usize]) -> MotionFit {
        let lags = [PROBE_LAGS, PROBE_LAGS + 1];
        let with_lags: Vec<usize> = free.iter().copied().chain([LAG]).chain(lags).collect();
        let errors = self.errors(&with_lags);
        let found = lags.map(|k| errors.standard_error(k));
        let ([Some(a), Some(b)], true) = (found, self.clusters > with_lags.len()) else {
            return MotionFit::unknown();
        };
        let descent = Column::from_fn(|k, _| self.normal.descent(k));
        let clustered = errors.inverse * self.clustered * errors.inverse;
        let clustered = clustered.fixed_view::<2, 2>(PROBE_LAGS, PROBE_LAGS);
        // With the standard errors on its diagonal.
        let scale = [a / clustered[(0, 0)].sqrt(), b / clustered[(1, 1)].sqrt()];
        let covariance = Matrix2::from_fn(|i, k| clustered[(i, k)] * scale[i] * scale[k]);
        let values = lags.map(|k| (errors.inverse.row(k) * descent)[0]);
        MotionFit::with_probe_lags(values, covariance)
    }

    /// The lag with all parameters that are fitted.
    fn lag(&self, free: &[usize]) -> Option<ReferenceLag> {
        let with_lag: Vec<usize> = free.iter().copied().chain([LAG]).collect();
        let errors = self.errors(&with_lag);
        let descent = Column::from_fn(|k, _| self.normal.descent(k));
        let standard_error_s = errors.standard_error(LAG).filter(|error| *error > 0.0)?;
        Some(ReferenceLag {
            value_s: (errors.inverse.row(LAG) * descent)[0],
            standard_error_s,
        })
    }
}

/// The inverse of the curvature over the free parameters, without the directions that hold no
/// information, and the parameters that take part in such a direction.
fn pseudo_inverse(curvature: &Square, free: &[usize]) -> (Square, Vec<usize>) {
    let scale = Column::from_fn(|k, _| {
        let d = curvature[(k, k)].sqrt();
        if free.contains(&k) && d.is_normal() {
            1.0 / d
        } else {
            0.0
        }
    });
    let mut scaled = Square::from_fn(|i, j| curvature[(i, j)] * scale[i] * scale[j]);
    for k in 0..UNKNOWNS {
        scaled[(k, k)] = 1.0;
    }
    let mut undetermined: Vec<usize> = free.iter().copied().filter(|&k| scale[k] == 0.0).collect();
    let eigen = SymmetricEigen::new(scaled);
    let mut inverse = Square::zeros();
    for (value, vector) in eigen
        .eigenvalues
        .iter()
        .zip(eigen.eigenvectors.column_iter())
    {
        if *value > EIGENVALUE_MIN {
            inverse += vector * vector.transpose() / *value;
        } else {
            undetermined.extend(free.iter().copied().filter(|&k| vector[k].abs() > 0.1));
        }
    }
    undetermined.sort_unstable();
    undetermined.dedup();
    let inverse = Square::from_fn(|i, j| inverse[(i, j)] * scale[i] * scale[j]);
    (inverse, undetermined)
}

fn less(columns: &Columns, mean: &Columns) -> Columns {
    [0, 1, 2].map(|axis| std::array::from_fn(|k| columns[axis][k] - mean[axis][k]))
}

#[cfg(test)]
#[path = "sandwich_tests.rs"]
mod tests;
