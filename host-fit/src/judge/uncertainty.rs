//! Standard errors of the parameters.
//!
//! The residuals of neighbouring rows are not independent: the interferometers drift. So the
//! covariance is the sandwich A^-1 M A^-1 with M summed over clusters of rows that may depend on
//! each other: whole movements where there are at least 20, else blocks of
//! half a second within them. Where independence would give the larger figure that one is taken,
//! so that a chance cancellation within few clusters promises nothing.

use crate::problem::model::{COUNT, ParameterId, SLOPES_MAX};
use crate::problem::parameters::Parameters;
use crate::problem::{Problem, TrainRow};
use crate::solve::least_squares::coordinates::{Boxed, Coordinates, parameter_jacobian, point_of};
use crate::solve::least_squares::normal::{
    Column, Point, Square, cost, descent, gram, residual_products,
};
use crate::solve::least_squares::scatter::{Offset, Q, Scatter, U, origin, regressors, scatter};
use nalgebra::{Matrix3, SMatrix, SymmetricEigen};

/// Fewer movements than this are cut into blocks.
const CLUSTERS_MIN: usize = 20;
/// Length of a block, s: the drift of an interferometer in a laboratory changes over seconds.
const BLOCK_S: f64 = 0.5;

/// How well the log determines the parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct Uncertainty {
    /// Standard error of each parameter, SI; `None` for one that the model fixes, that stands at
    /// an end of its range, or that the log does not determine at all.
    pub standard_error: [Option<f64>; COUNT],
    /// The same if rows were independent: what the log's motion alone allows, whatever the model
    /// leaves unexplained. Zero where there is none.
    pub motion_error: [f64; COUNT],
    /// Parameters that the log does not determine: no motion shows them, or only in combination
    /// with others.
    pub undetermined: Vec<ParameterId>,
    /// Pairs of parameters whose estimates are correlated by more than [`CORRELATION_TOLD`], either
    /// way, with their correlation.
    pub correlations: Vec<(String, String, f64)>,
}

/// Correlations above this are told: the parameters stand in for each other.
pub const CORRELATION_TOLD: f64 = 0.95;

/// A probe is moved if it is by more than this part of what that is which moves most.
const MOVED_MIN: f64 = 0.1;

/// Smallest eigenvalue of the scaled curvature that still counts as information.
const EIGENVALUE_MIN: f64 = 1e-10;

/// Standard errors at a solution; `held` are parameters that stand at an end of their range.
/// `None` when the solution itself cannot be evaluated.
pub fn uncertainty(
    problem: &Problem,
    parameters: &Parameters,
    held: &[ParameterId],
) -> Option<Uncertainty> {
    let point = point_of(parameters)?;
    let offset = if problem.model.has_zero_deviation {
        Offset::Free
    } else {
        Offset::Fixed([0.0; 3])
    };
    let sums = scatter(problem, &point.ratios, &vec![offset; problem.groups.len()])?;
    let coordinates = Boxed {
        stage: problem.stage,
        model: problem.model,
    };
    let chain = parameter_jacobian(parameters, &point);
    let weights = Matrix3::from_diagonal(&problem.weights.into());
    let to_parameters = |x: Square| chain.transpose() * x * chain;
    let curvature = to_parameters(gram(&sums, &point.gain, &weights));
    let clustered = to_parameters(clustered_scores(problem, &point, offset)?);
    let independent = to_parameters(independent_scores(problem, &sums, &point, &weights));

    let may_change = coordinates.free();
    let ids = problem.model.free();
    let free: Vec<usize> = ids
        .filter(|id| may_change[id.index] && !held.contains(id))
        .map(|id| id.index)
        .collect();
    let (inverse, undetermined) = pseudo_inverse(&curvature, &free);
    // What the fit itself used up: unknowns and zero deviations.
    let used = free.len()
        + if offset == Offset::Free {
            3 * problem.groups.len()
        } else {
            0
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
        if !undetermined.contains(&k) && largest.is_finite() {
            standard_error[k] = Some(largest);
        }
    }
    let covariance = inverse * clustered * inverse;
    let names: Vec<(usize, String)> = (problem.model.free())
        .filter(|id| standard_error[id.index].is_some())
        .map(|id| (id.index, id.name()))
        .collect();
    let mut correlations = Vec::new();
    for (j, (b, name_b)) in names.iter().enumerate() {
        for (a, name_a) in &names[..j] {
            let (a, b) = (*a, *b);
            let product = covariance[(a, a)] * covariance[(b, b)];
            let correlation = covariance[(a, b)] / product.sqrt();
            if correlation.abs() > CORRELATION_TOLD {
                correlations.push((name_a.clone(), name_b.clone(), correlation));
            }
        }
    }
    Some(Uncertainty {
        correlations,
        standard_error,
        motion_error,
        undetermined: (problem.model.free())
            .filter(|id| undetermined.contains(&id.index))
            .collect(),
    })
}

/// The weighted sum of squared errors of some rows near a solution, um^2, to second order in the
/// change of the parameters. Those of movements add up.
#[derive(Clone, Copy, Debug)]
pub struct OwnFit {
    /// At the solution.
    pub cost: f64,
    gain: Matrix3<f64>,
    descent: Column,
    curvature: Square,
}

impl OwnFit {
    /// Of no rows.
    pub fn none() -> Self {
        Self {
            cost: 0.0,
            gain: Matrix3::zeros(),
            descent: Column::zeros(),
            curvature: Square::zeros(),
        }
    }

    /// Zero deviations are free. `None` as for [`uncertainty`].
    pub fn new(problem: &Problem, parameters: &Parameters) -> Option<Self> {
        let point = point_of(parameters)?;
        let offsets = vec![Offset::Free; problem.groups.len()];
        let sums = scatter(problem, &point.ratios, &offsets)?;
        let weights = Matrix3::from_diagonal(&problem.weights.into());
        Some(Self {
            cost: cost(&sums, &point.gain, problem.weights),
            gain: point.gain,
            descent: descent(&sums, &point.gain, problem.weights),
            curvature: gram(&sums, &point.gain, &weights),
        })
    }

    /// With more rows.
    pub fn add(&mut self, more: &Self) {
        self.cost += more.cost;
        self.descent += more.descent;
        self.curvature += more.curvature;
    }

    /// The step of Gauss and Newton to parameters of their own; what the rows do not determine stays
    /// as it is.
    pub fn step(&self) -> Column {
        let all: Vec<usize> = (0..COUNT).collect();
        pseudo_inverse(&self.curvature, &all).0 * self.descent
    }

    /// By what part the gain of each probe would change, if nothing else did: `None` for a probe that the rows
    /// hardly move, beside that which they move most, and where they do not determine all three.
    pub fn gain_step(&self) -> Option<[Option<f64>; 3]> {
        // A gain is a column of G, whose numbers stand row by row before the ratios.
        let directions = SMatrix::<f64, COUNT, 3>::from_fn(|place, probe| {
            let is_of_probe = place < 9 && place % 3 == probe;
            if is_of_probe {
                self.gain[(place / 3, probe)]
            } else {
                0.0
            }
        });
        let curvature = directions.transpose() * self.curvature * directions;
        let factor = curvature.cholesky()?;
        let steps = factor.solve(&(directions.transpose() * self.descent));
        let most = curvature.diagonal().max();
        let is_moved = |k: usize| curvature[(k, k)] > MOVED_MIN * MOVED_MIN * most;
        Some([0, 1, 2].map(|k| is_moved(k).then(|| steps[k])))
    }

    /// The cost after a step.
    pub fn cost_after(&self, step: &Column) -> f64 {
        let first = self.descent.dot(step);
        let second = step.dot(&(self.curvature * step));
        self.cost - 2.0 * first + second
    }

    /// The cost with parameters of their own.
    pub fn cost_alone(&self) -> f64 {
        self.cost_after(&self.step())
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

/// Sum of J' W S W J with the covariance S of the residuals: rows independent, axes not.
fn independent_scores(
    problem: &Problem,
    sums: &Scatter,
    point: &Point,
    weights: &Matrix3<f64>,
) -> Square {
    let covariance = residual_products(sums, &point.gain) / problem.rows.len() as f64;
    gram(sums, &point.gain, &(weights * covariance * weights))
}

/// Sum over clusters of the outer product of their summed scores J' W e, with the usual
/// correction for few clusters.
fn clustered_scores(problem: &Problem, point: &Point, offset: Offset) -> Option<Square> {
    let block = if problem.groups.len() >= CLUSTERS_MIN {
        usize::MAX
    } else {
        (BLOCK_S / problem.stage.servo_period_s).ceil().max(1.0) as usize
    };
    let mut total = Square::zeros();
    let mut clusters = 0;
    for group in &problem.groups {
        let rows = &problem.rows[group.rows.clone()];
        let origin = origin(rows, &point.ratios, offset)?;
        for cluster in rows.chunks(block.min(rows.len())) {
            let mut sum = Column::zeros();
            for row in cluster {
                sum += score(problem, point, row, &origin)?;
            }
            total += sum * sum.transpose();
            clusters += 1;
        }
    }
    let n = f64::from(clusters);
    Some(if clusters > 1 {
        total * (n / (n - 1.0))
    } else {
        total
    })
}

/// J' W e of one row.
fn score(problem: &Problem, point: &Point, row: &TrainRow, origin: &[f64]) -> Option<Column> {
    let mut z = regressors(row, &point.ratios)?;
    for (z, origin) in z.iter_mut().zip(origin) {
        *z -= origin;
    }
    let weighted: [f64; 3] = std::array::from_fn(|axis| {
        let decoded: f64 = (0..3).map(|k| point.gain[(axis, k)] * z[k]).sum();
        row.weight * (problem.weights[axis] * (z[Q + axis] - decoded))
    });
    Some(Column::from_fn(|k, _| {
        if k < 9 {
            weighted[k / 3] * z[k % 3]
        } else {
            let probe = (k - 9) / SLOPES_MAX;
            let pull: f64 = (0..3)
                .map(|axis| weighted[axis] * point.gain[(axis, probe)])
                .sum();
            pull * z[U + k - 9]
        }
    }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::input::log::{ReadOptions, read_bytes};
    use crate::input::shipped::{LOG_GZ, STAGE_TOML};
    use crate::input::stage::Stage;
    use crate::problem::model::Model;
    use crate::solve::{Projection, Solver, SolverOptions};
    use runtime::ModelKind;

    /// Sandwich over the 57 movements of the shipped log, computed apart from this program from
    /// differences of the residuals of all rows; for `c_c` the rows-independent figure is larger.
    const EXPECTED: [f64; 18] = [
        5.3852e-5, 6.1580e-5, 4.6554e-5, 6.4834e-5, 5.8853e-5, 2.5133e-5, 6.0485e-5, 7.3917e-5,
        4.6547e-5, 0.95172, 1.3032, 0.68427, 0.14024, 0.19391, 0.23914, 0.15327, 0.16378, 0.13738,
    ];

    #[test]
    fn standard_errors_of_the_shipped_log_are_those_of_an_independent_computation() {
        let stage = Stage::from_toml(STAGE_TOML, "stage.toml".as_ref()).expect("sound");
        let path = "paper.csv.gz".as_ref();
        let log = read_bytes(LOG_GZ, path, &stage, &ReadOptions::default()).expect("sound");
        let rows: Vec<usize> = (0..log.dataset.rows.len()).collect();
        let model = Model::of(ModelKind::M31);
        let problem = Problem::new(&log.dataset, &rows, &stage, model);
        let options = SolverOptions::new(Projection::Linear, 1);
        let solution = Solver::LeastSquares
            .solve(&problem, &options)
            .expect("a solution");
        let found = uncertainty(&problem, &solution.parameters, &[]).expect("evaluated");
        for (id, expected) in model.parameters().zip(EXPECTED) {
            let found = found.standard_error[id.index].expect("determined");
            assert!(
                (found - expected).abs() < 1e-3 * expected,
                "{}: {found:e} {expected:e}",
                id.name()
            );
        }
    }
}
