//! Standard errors of the parameters.
//!
//! The residuals of neighbouring rows are not independent: the interferometers drift. So the
//! covariance is the sandwich A^-1 M A^-1 with M summed over clusters of rows that may depend on
//! each other: whole movements where there are at least 20, else blocks of
//! half a second within them. Where independence would give the larger figure that one is taken,
//! so that a chance cancellation within few clusters promises nothing.

use hallstage_input::stage::Stage;
use hallstage_solver::problem::model::{COUNT, ParameterId};
use hallstage_solver::problem::parameters::Parameters;
use hallstage_solver::problem::{Group, Problem};
use hallstage_solver::solve::field::parameters::FieldParameters;
use hallstage_solver::solve::field::posterior::Posterior;
use hallstage_solver::solve::field::terms::PER_PROBE;
use hallstage_solver::solve::gauss_newton::{Equations, Normal, Point};
use hallstage_solver::solve::least_squares::rows::{COLUMNS, Decoder};
use hallstage_solver::solve::least_squares::solve::free;
use nalgebra::{DMatrix, DVector, Matrix3, SMatrix, SVector, SymmetricEigen};
use rayon::prelude::*;

type Square = SMatrix<f64, COUNT, COUNT>;
type Column = SVector<f64, COUNT>;

/// Fewer movements than this are cut into blocks.
const CLUSTERS_MIN: usize = 20;
/// Length of a block, s: the drift of an interferometer in a laboratory changes over seconds.
const BLOCK_S: f64 = 0.5;

/// How well the log determines the parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct Uncertainty {
    /// The parameters that have a standard error, ascending. The model does not fit the others, or the log
    /// does not determine them; none has one where there are fewer clusters than parameters.
    pub determined: Vec<usize>,
    /// Their covariance in this order, SI.
    pub covariance: DMatrix<f64>,
    /// Standard errors if rows were independent: what the log's motion alone allows, whatever the model
    /// leaves unexplained. Zero where there is none.
    pub motion_error: [f64; COUNT],
    /// Parameters that the log does not determine: no motion shows them, or only in combination
    /// with others.
    pub undetermined: Vec<ParameterId>,
}

/// Smallest eigenvalue of the scaled curvature that still counts as information.
const EIGENVALUE_MIN: f64 = 1e-10;

/// Standard errors at a solution. `None` when the solution itself cannot be evaluated.
pub fn uncertainty(problem: &Problem, parameters: &Parameters) -> Option<Uncertainty> {
    let normal = normal(problem, parameters)?;
    let curvature = Square::from_fn(|i, j| normal.curvature(i, j));
    let Scores {
        clustered,
        clusters,
        independent,
    } = Scores::new(problem, parameters)?;
    let free = free(problem);
    let (inverse, undetermined) = pseudo_inverse(&curvature, &free);
    // What the fit itself used up: unknowns and zero deviations.
    let used = free.len()
        + match problem.model.has_zero_deviation {
            true => 3 * problem.groups.len(),
            false => 0,
        };
    let all = 3 * problem.rows.len();
    let scale = all as f64 / all.saturating_sub(used).max(1) as f64;
    let mut standard_error = [None; COUNT];
    let mut motion_error = [0.0; COUNT];
    for &k in &free {
        let row = inverse.row(k);
        let error = |meat: &Square| ((row * meat * row.transpose())[0] * scale).sqrt();
        motion_error[k] = error(&independent);
        let largest = motion_error[k].max(error(&clustered));
        // Fewer clusters than parameters say nothing of some of them.
        if !undetermined.contains(&k) && largest.is_finite() && clusters > free.len() {
            standard_error[k] = Some(largest);
        }
    }
    let covariance = inverse * clustered * inverse;
    let determined: Vec<usize> = (0..COUNT)
        .filter(|&k| standard_error[k].is_some())
        .collect();
    // Of an exact fit there is none.
    let correlation = |a: usize, b: usize| {
        let product = covariance[(a, a)] * covariance[(b, b)];
        match product > 0.0 {
            true => covariance[(a, b)] / product.sqrt(),
            false => 0.0,
        }
    };
    // With the standard errors on its diagonal, whichever way they were found.
    let error = |k: usize| standard_error[determined[k]].unwrap_or_default();
    let n = determined.len();
    let covariance = DMatrix::from_fn(n, n, |i, j| match i == j {
        true => error(i).powi(2),
        false => error(i) * error(j) * correlation(determined[i], determined[j]),
    });
    Some(Uncertainty {
        determined,
        covariance,
        motion_error,
        undetermined: (problem.model.free())
            .filter(|id| undetermined.contains(&id.index))
            .collect(),
    })
}

impl Uncertainty {
    /// The posterior of parameters.
    pub fn posterior(&self, parameters: &Parameters, stage: &Stage) -> Posterior {
        let parameters = FieldParameters::of_model_31(parameters, stage);
        let place = |&index: &usize| index % 3 * PER_PROBE + index / 3;
        let determined = self.determined.iter().map(place).collect();
        Posterior::of_some(determined, self.covariance.clone(), &parameters)
    }

    /// Standard error of a parameter, SI.
    pub fn standard_error(&self, index: usize) -> Option<f64> {
        let place = self.determined.binary_search(&index).ok()?;
        Some(self.covariance[(place, place)].sqrt())
    }
}

/// The normal equations of a problem at parameters.
fn normal(problem: &Problem, parameters: &Parameters) -> Option<Normal<COLUMNS>> {
    problem.normal(&Point {
        values: DVector::from_column_slice(&parameters.values),
        offsets: Vec::new(),
    })
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
    for k in 0..COUNT {
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

/// Sums over the rows of outer products of their scores J' W e.
struct Scores {
    /// Summed over each cluster first, with the usual correction for few clusters.
    clustered: Square,
    clusters: usize,
    /// As if rows were independent, axes not: of J' W S W J with the covariance S of the residuals.
    independent: Square,
}

/// Residuals of a row by the roots of the weights, in the last column, and their derivatives.
type Columns = [[f64; COLUMNS]; 3];

impl Scores {
    fn new(problem: &Problem, parameters: &Parameters) -> Option<Self> {
        const ERROR: usize = COLUMNS - 1;
        let decoder = &Decoder::new(problem, parameters)?;
        let block = if problem.groups.len() >= CLUSTERS_MIN {
            usize::MAX
        } else {
            (BLOCK_S / problem.stage.servo_period_s).ceil().max(1.0) as usize
        };
        let of_group = |group: &Group| {
            let rows = &problem.rows[group.rows.clone()];
            let mean = decoder.mean(problem, rows)?;
            let mut covariance = Matrix3::zeros();
            let mut sums = Vec::new();
            for cluster in rows.chunks(block.min(rows.len())) {
                let mut sum = Column::zeros();
                for row in cluster {
                    let columns = less(&decoder.columns(row)?, &mean);
                    for i in 0..3 {
                        let error = row.weight * columns[i][ERROR];
                        for (sum, by) in sum.iter_mut().zip(&columns[i]) {
                            *sum += error * by;
                        }
                        for j in 0..3 {
                            covariance[(i, j)] += error * columns[j][ERROR];
                        }
                    }
                }
                sums.push(sum);
            }
            Some((covariance, sums))
        };
        let groups: Option<Vec<_>> = problem.groups.par_iter().map(of_group).collect();
        let mut clustered = Square::zeros();
        let (mut clusters, mut covariance) = (0, Matrix3::zeros());
        for (of_group, sums) in groups? {
            covariance += of_group / problem.rows.len() as f64;
            clusters += sums.len();
            for sum in sums {
                clustered.ger(1.0, &sum, &sum, 1.0);
            }
        }
        let n = clusters.max(2) as f64;
        // J' S J with S = R' R.
        let root = covariance
            .cholesky()
            .map_or_else(Matrix3::zeros, |s| s.l().transpose());
        let independent = Normal::of_movements(problem.groups.len(), |group| {
            let rows = &problem.rows[problem.groups[group].rows.clone()];
            let mean = decoder.mean(problem, rows)?;
            let mut sums = Normal::none();
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
        Some(Self {
            clustered: clustered * (n / (n - 1.0)),
            clusters,
            independent: Square::from_fn(|i, j| independent.curvature(i, j)),
        })
    }
}

fn less(columns: &Columns, mean: &Columns) -> Columns {
    [0, 1, 2].map(|axis| std::array::from_fn(|k| columns[axis][k] - mean[axis][k]))
}

#[cfg(test)]
#[path = "uncertainty_tests.rs"]
mod tests;
