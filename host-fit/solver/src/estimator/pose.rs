//! Models (12) to (31) by the errors of the decoded pose, with the derivatives by the parameters.
//!
//! The field model is fitted to what the probes read. The models of the paper are fitted to the pose: the
//! residual of a row, signal less model, is seen through T = PM^-1 diag(1/phi). At the decoded pose q the
//! model reads exactly the signal, so that reference less q is the error of the pose, and -T times the
//! derivatives of the reading there are the exact derivatives of q.

use super::parameters::FieldParameters;
use super::probe::{Probe, probes};
use super::rows::FieldRow;
use super::terms::CARRY;
use crate::estimator::gauss_newton::{Equations, Normal, Point};
use crate::estimator::model::COUNT;
use crate::estimator::paper::Parameters;
use crate::estimator::problem::{Problem, UNIT};
use hallstage_input::stage::Stage;
use runtime::matrix::{inverse, to_rows};
use std::ops::Range;

/// Columns: the parameters, the lag of the reference, the lags of A and B behind the mean of the probes (that of C is
/// the negative sum), the residual.
pub const COLUMNS: usize = COUNT + 4;
/// Place of the lag.
pub const LAG: usize = COUNT;
/// Place of the lags of the probes.
pub const PROBE_LAGS: usize = COUNT + 1;
/// Place of the residual.
pub const ERROR: usize = COUNT + 3;

/// A row with phi below this part of eta is next to a pole.
pub const SHARE_MIN: f64 = 0.05;

/// The error of a row's pose in the last column, and the derivatives of the decoded pose, in [`UNIT`].
pub type Columns = [[f64; COLUMNS]; 3];

/// A model of the paper, ready to decode rows.
#[derive(Clone, Copy, Debug)]
pub struct Decoder {
    probes: [Probe; 3],
    eta: [f64; 3],
    slopes: [[f64; 3]; 3],
    /// Rows of PM^-1.
    inverse: [[f64; 3]; 3],
}

/// A decoded row.
struct Decoded {
    /// X, Y, Rz: m, m, rad.
    planar: [f64; 3],
    phi: [f64; 3],
    /// Reference less pose: m, m, rad.
    error: [f64; 3],
}

impl Decoder {
    /// A decoder with these parameters; `None` where PM is singular or an eta is zero.
    pub fn new(parameters: &Parameters, stage: &Stage) -> Option<Self> {
        let eta = parameters.eta();
        let is_regular = eta.iter().all(|eta| eta.is_normal());
        let inverse = inverse(&parameters.geometry().plane())?;
        is_regular.then_some(Self {
            probes: probes(&FieldParameters::from_model_31(parameters, stage)),
            eta,
            slopes: parameters.slopes(),
            inverse: to_rows(&inverse),
        })
    }

    fn decode(&self, row: &FieldRow) -> Option<Decoded> {
        let phi = [0, 1, 2].map(|k| {
            let slopes = self.slopes[k].iter().zip(row.vertical);
            self.eta[k] + slopes.map(|(slope, by)| slope * by).sum::<f64>()
        });
        let is_near_pole = |k: usize| phi[k] / self.eta[k] <= SHARE_MIN;
        if (0..3).any(is_near_pole) {
            return None;
        }
        let along_m = [0, 1, 2].map(|k| row.signal_m[k] / phi[k]);
        let planar = self
            .inverse
            .map(|row| (row[0] * along_m[0] + row[1] * along_m[1]) + row[2] * along_m[2]);
        Some(Decoded {
            planar,
            phi,
            error: [0, 1, 2].map(|axis| row.reference[axis] - planar[axis]),
        })
    }

    /// The reference less the decoded pose, no offset taken off: m, m, rad. `None` next to a pole.
    pub fn error(&self, row: &FieldRow) -> Option<[f64; 3]> {
        Some(self.decode(row)?.error)
    }

    /// The error with its derivatives. `None` next to a pole.
    #[inline(always)]
    pub fn columns(&self, row: &FieldRow) -> Option<Columns> {
        let Decoded { planar, phi, error } = self.decode(row)?;
        let mut columns = [[0.0; COLUMNS]; 3];
        for (k, probe) in self.probes.iter().enumerate() {
            let read = probe.read(planar, row.vertical);
            let by = read.by_pose.iter().chain(&read.by_vertical);
            let rate_m_s: f64 = by.zip(row.rate).map(|(by, rate)| by * rate).sum();
            for (axis, column) in columns.iter_mut().enumerate() {
                let to_pose = -self.inverse[axis][k] / (phi[k] * UNIT);
                for (term, by) in read.by_parameter[..CARRY].iter().enumerate() {
                    column[3 * term + k] = to_pose * by;
                }
                let by_lag = -to_pose * rate_m_s;
                match k {
                    2 => {
                        column[PROBE_LAGS] -= by_lag;
                        column[PROBE_LAGS + 1] -= by_lag;
                    }
                    _ => column[PROBE_LAGS + k] += by_lag,
                }
            }
        }
        for (axis, column) in columns.iter_mut().enumerate() {
            column[LAG] = -row.rate[axis] / UNIT;
            column[ERROR] = error[axis] / UNIT;
        }
        Some(columns)
    }

    /// The weighted mean of [`columns`](Self::columns) over the rows of a movement: what a free
    /// offset takes off. Zeros where the model has no zero deviations.
    pub fn mean(&self, problem: &Problem, rows: &[FieldRow]) -> Option<Columns> {
        let mut sum = [[0.0; COLUMNS]; 3];
        let mut weights = 0.0;
        if !problem.model.has_zero_deviation {
            return Some(sum);
        }
        for row in rows {
            add(&mut sum, &self.columns(row)?, row.weight);
            weights += row.weight;
        }
        Some(sum.map(|sum| sum.map(|x| x / weights)))
    }
}

fn add(sum: &mut Columns, columns: &Columns, weight: f64) {
    for (sum, columns) in sum.iter_mut().zip(columns) {
        for (sum, x) in sum.iter_mut().zip(columns) {
            *sum += weight * x;
        }
    }
}

impl Problem<'_> {
    /// The rows of each movement.
    pub fn movement_rows(&self) -> Vec<Range<usize>> {
        self.rows.movement_rows().collect()
    }
}

impl Equations<COLUMNS> for Problem<'_> {
    fn normal(&self, at: &Point) -> Option<Normal<COLUMNS>> {
        let decoder = Decoder::new(&Parameters::from_slice(at.values.as_slice()), self.stage)?;
        let movements = self.movement_rows();
        Normal::sum(movements.len(), |movement| {
            let rows = &self.rows.rows[movements[movement].clone()];
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
