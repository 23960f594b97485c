//! Pose errors of rows, with their derivatives by the parameters.
//!
//! The pose q of three signals solves s = phi PM q. So its derivative by a parameter is
//! -PM^-1 diag(1/phi) d(phi PM)/dp q: what the signals would change by at the decoded pose, seen as a
//! pose. This is exact, and least squares of the pose errors with it are too.

use crate::problem::model::COUNT;
use crate::problem::parameters::{ETA, Parameters, SLOPES, THETA};
use crate::problem::{Problem, TrainRow};
use crate::solve::gauss_newton::{Equations, Normal, Point};
use nalgebra::{Matrix3, Vector3};
use runtime::geometry::SensingAxes;
use runtime::matrix::inverse;

/// Columns: the parameters, one left free, the residual.
pub const COLUMNS: usize = COUNT + 2;

/// Rows whose phi is smaller than this part of eta are next to a pole, and so are the parameters.
pub const SHARE_MIN: f64 = 0.05;

/// A model of the paper, ready to decode rows.
#[derive(Clone, Copy, Debug)]
pub struct Decoder {
    inverse: Matrix3<f64>,
    across: [[f64; 2]; 3],
    eta: [f64; 3],
    slopes: [[f64; 3]; 3],
    /// Roots of the weights of X, Y, Rz.
    weights: [f64; 3],
}

/// A decoded row.
struct Pose {
    /// um, um, urad.
    planar: [f64; 3],
    phi: [f64; 3],
    /// Displacement along the axis of each probe, um.
    along_um: [f64; 3],
}

impl Decoder {
    /// Of the parameters, for the errors of a problem; `None` where PM is singular or an eta is zero.
    pub fn new(problem: &Problem, parameters: &Parameters) -> Option<Self> {
        let geometry = parameters.geometry();
        let eta = parameters.eta();
        let is_regular = eta.iter().all(|eta| eta.is_normal());
        is_regular.then_some(Self {
            inverse: inverse(&geometry.plane())?,
            across: SensingAxes::at(geometry.misalignment_rad).across(),
            eta,
            slopes: parameters.slopes(),
            weights: problem.weights.map(f64::sqrt),
        })
    }

    fn pose(&self, row: &TrainRow) -> Option<Pose> {
        let phi = [0, 1, 2].map(|k| {
            let slopes = self.slopes[k].iter().zip(row.vertical);
            self.eta[k] + slopes.map(|(slope, by)| slope * by).sum::<f64>()
        });
        let is_near_pole = |k: usize| phi[k] / self.eta[k] <= SHARE_MIN;
        if (0..3).any(is_near_pole) {
            return None;
        }
        let along_um = [0, 1, 2].map(|k| row.signal_um[k] / phi[k]);
        Some(Pose {
            planar: (self.inverse * Vector3::from(along_um)).into(),
            phi,
            along_um,
        })
    }

    /// The reference less the decoded pose, no offset taken off: um, um, urad. `None` next to a pole.
    pub fn error(&self, row: &TrainRow) -> Option<[f64; 3]> {
        let pose = self.pose(row)?;
        Some([0, 1, 2].map(|axis| row.reference_um[axis] - pose.planar[axis]))
    }

    /// The same by the roots of the axes' weights, in the last column, and the derivatives of the
    /// decoded pose by the parameters in their order.
    #[inline(always)]
    pub fn columns(&self, row: &TrainRow) -> Option<[[f64; COLUMNS]; 3]> {
        let Pose {
            planar,
            phi,
            along_um,
        } = self.pose(row)?;
        let mut columns = [[0.0; COLUMNS]; 3];
        for probe in 0..3 {
            let [x, y] = self.across[probe];
            let per_phi = along_um[probe] / phi[probe];
            for (axis, column) in columns.iter_mut().enumerate() {
                let to_pose = -self.weights[axis] * self.inverse[(axis, probe)];
                column[probe] = to_pose * planar[2];
                column[THETA + probe] = to_pose * (x * planar[0] + y * planar[1]);
                column[ETA + probe] = to_pose * per_phi;
                for (k, by) in row.vertical.iter().enumerate() {
                    column[SLOPES + 3 * k + probe] = to_pose * (per_phi * by);
                }
            }
        }
        for (axis, column) in columns.iter_mut().enumerate() {
            let error = row.reference_um[axis] - planar[axis];
            column[COLUMNS - 1] = self.weights[axis] * error;
        }
        Some(columns)
    }

    /// The weighted mean of [`columns`](Self::columns) over the rows of a movement: what a free
    /// offset takes off. Zeros where the model has no zero deviations.
    pub fn mean(&self, problem: &Problem, rows: &[TrainRow]) -> Option<[[f64; COLUMNS]; 3]> {
        let mut sum = [[0.0; COLUMNS]; 3];
        let mut weights = 0.0;
        if !problem.model.has_zero_deviation {
            return Some(sum);
        }
        for row in rows {
            let columns = self.columns(row)?;
            add(&mut sum, &columns, row.weight);
            weights += row.weight;
        }
        Some(sum.map(|sum| sum.map(|x| x / weights)))
    }
}

fn add(sum: &mut [[f64; COLUMNS]; 3], columns: &[[f64; COLUMNS]; 3], weight: f64) {
    for (sum, columns) in sum.iter_mut().zip(columns) {
        for (sum, x) in sum.iter_mut().zip(columns) {
            *sum += weight * x;
        }
    }
}

impl Equations<COLUMNS> for Problem<'_> {
    fn normal(&self, at: &Point) -> Option<Normal<COLUMNS>> {
        let mut parameters = Parameters {
            values: [0.0; COUNT],
        };
        for (value, at) in parameters.values.iter_mut().zip(&at.values) {
            *value = *at;
        }
        let decoder = Decoder::new(self, &parameters)?;
        Normal::of_movements(self.groups.len(), |group| {
            let rows = &self.rows[self.groups[group].rows.clone()];
            let mut normal = Normal::none();
            // About the first row, near which the mean is, and then about the mean.
            let origin = match self.model.has_zero_deviation {
                true => decoder.columns(rows.first()?)?,
                false => [[0.0; COLUMNS]; 3],
            };
            let (mut sum, mut weights) = ([[0.0; COLUMNS]; 3], 0.0);
            for row in rows {
                let mut columns = decoder.columns(row)?;
                add(&mut columns, &origin, -1.0);
                normal.add_row(&columns, row.weight);
                add(&mut sum, &columns, row.weight);
                weights += row.weight;
            }
            if self.model.has_zero_deviation {
                normal.add_row(&sum, -1.0 / weights);
            }
            Some(normal)
        })
    }
}
