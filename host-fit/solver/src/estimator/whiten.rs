//! The normal equations of a log under white noise of the probes and a drifting reference.
//!
//! The error of the reference is a random walk in X, Y, Rz that starts anywhere: its start is
//! the offset of the movement's reset. A Kalman filter that follows it turns residuals and their
//! derivatives into innovations that don't depend on each other, and takes the offset out at the
//! same time: without drift this is the same as solving for each movement's offset. A and B are
//! whitened jointly with C, for all three see the same reference.

use super::blocks::Block;
use super::dynamics::Dynamics;
use super::parameters::FieldParameters;
use super::probe::probes;
use super::rows::Rows;
use super::temperature::Coefficient;
use super::terms::PER_PROBE;
use crate::estimator::gauss_newton::{Equations, Normal, Point};

/// The column of the lag of the reference, behind the parameters and k and h of A, B, C beyond their priors.
pub const LAG: usize = Coefficient::ROWS;
/// The columns of the lags of A and B behind the mean of the probes; the lag of C is the negative sum.
pub const PROBE_LAGS: usize = LAG + 1;
/// The columns of the changes by acceleration of the six axes, of A, B, C.
pub const ACCELERATIONS: usize = PROBE_LAGS + 2;
/// All unknowns.
pub const UNKNOWNS: usize = ACCELERATIONS + 18;
/// The column of the lag's growth by time, which an alignment of two clocks takes too.
pub const LAG_RATE: usize = UNKNOWNS;
/// Columns: these and the residual, a multiple of four.
pub const COLUMNS: usize = (LAG_RATE + 2).next_multiple_of(4);
/// Standard deviation of an offset before a movement is seen, m: far beyond any reset's.
const OFFSET_M: f64 = 1e-3;

/// Noise of the log.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Noise {
    /// White noise of the probes A, B, C from row to row, standard deviation, m.
    pub white_m: [f64; 3],
    /// Random walk of the reference in X, Y, Rz: standard deviation after a second, m, m, rad.
    pub drift: [f64; 3],
}

/// The field model with the rows of a log.
#[derive(Clone, Copy, Debug)]
pub struct FieldEquations<'a> {
    /// The rows.
    pub rows: &'a Rows,
    /// Designed places of the probes: see [`FieldParameters::places`].
    pub places: [[f64; 2]; 3],
    /// Their noise.
    pub noise: Noise,
    /// Errors of the resets in X, Y, Rz, standard deviations, m, m, rad; `None` where nothing is known.
    pub resets: Option<[f64; 3]>,
    /// What a unit of each fault adds to the signals A, B, C, by block, m; how large it is stands behind the
    /// [`UNKNOWNS`].
    pub faults: &'a [Vec<[f64; 3]>],
}

impl FieldEquations<'_> {
    /// The parameters at a point.
    pub fn parameters(&self, at: &Point) -> FieldParameters {
        let values = at.values.as_slice();
        let mut parameters = FieldParameters::from_values(values, self.places);
        for of in Coefficient::ALL {
            parameters.gain_per_k[of.probe][of.sensor] = values[of.row()];
        }
        parameters
    }

    /// Standard deviation of the offset of a movement before it is seen, and its mean beyond the offset that is taken off
    /// already, m, m, rad.
    fn start(&self, offset: [f64; 3]) -> [[f64; 3]; 2] {
        match self.resets {
            Some(resets) => [resets, offset.map(|x| -x)],
            None => [[OFFSET_M; 3], [0.0; 3]],
        }
    }

    /// The normal equations of evaluated blocks, with no offset.
    pub fn sum_blocks(&self, blocks: &[Block]) -> Normal<COLUMNS> {
        let movement = |k: usize| {
            let blocks = &blocks[self.rows.movements[k].clone()];
            Some(self.sums(k, blocks, [0.0; 3], &[]))
        };
        let sums = Normal::sum(self.rows.movements.len(), movement);
        sums.unwrap_or_else(Normal::none)
    }

    /// The whitened columns at a point and the steps of the filter, block by block.
    pub fn whitened<const W: usize>(&self, at: &Point) -> (Vec<[[f64; W]; 3]>, Vec<Gain>) {
        let probes = probes(&self.parameters(at));
        let dynamics = Dynamics::from_values(at.values.as_slice());
        let (mut rows, mut gains) = (Vec::new(), Vec::new());
        for (k, offset) in at.offsets.iter().enumerate() {
            let blocks = self.rows.evaluate_movement(k, &probes, &dynamics, *offset);
            self.filter(k, &blocks, *offset, self.sizes(at), |gain, row| {
                rows.push(row);
                gains.push(gain);
            });
        }
        (rows, gains)
    }

    fn sizes<'v>(&self, at: &'v Point) -> &'v [f64] {
        &at.values.as_slice()[at.values.len() - self.faults.len()..]
    }

    /// The sums over the blocks of a movement.
    fn sums<const W: usize>(
        &self,
        movement: usize,
        blocks: &[Block],
        offset: [f64; 3],
        sizes: &[f64],
    ) -> Normal<W> {
        let mut out = Normal::none();
        let end = self.filter(movement, blocks, offset, sizes, |_, row| {
            out.add_row(&row, 1.0);
        });
        out.ends.push(end);
        out
    }

    /// Whitens a movement block by block; the reference's error at its end.
    fn filter<const W: usize>(
        &self,
        movement: usize,
        blocks: &[Block],
        offset: [f64; 3],
        sizes: &[f64],
        mut take: impl FnMut(Gain, [[f64; W]; 3]),
    ) -> [[f64; W]; 3] {
        let [resets, expected] = self.start(offset);
        let mut end = [[0.0; W]; 3];
        let mut spread: Matrix = [[0.0; 3]; 3];
        for (axis, row) in spread.iter_mut().enumerate() {
            row[axis] = resets[axis] * resets[axis];
            end[axis][W - 1] = expected[axis];
        }
        let mut time_s = blocks.first().map_or(0.0, |block| block.time_s);
        for (number, block) in (self.rows.movements[movement].start..).zip(blocks) {
            for (axis, drift) in self.noise.drift.into_iter().enumerate() {
                spread[axis][axis] += drift * drift * (block.time_s - time_s).max(0.0);
            }
            time_s = block.time_s;
            let gain = Gain::new(block, &spread, &self.noise);
            let mut columns = columns(block);
            for (k, (fault, size)) in self.faults.iter().zip(sizes).enumerate() {
                for (column, by) in columns.iter_mut().zip(fault[number]) {
                    column[UNKNOWNS + k] = by;
                    column[W - 1] -= size * by;
                }
            }
            innovations(&mut columns, block, &end);
            let [row_a, row_b, row_c] = &columns;
            for (end, [a, b, c]) in end.iter_mut().zip(gain.kalman) {
                for (j, end) in end.iter_mut().enumerate() {
                    *end += (a * row_a[j] + b * row_b[j]) + c * row_c[j];
                }
            }
            spread = gain.spread;
            gain.whiten(&mut columns);
            take(gain, columns);
        }
        end
    }
}

impl<const W: usize> Equations<W> for FieldEquations<'_> {
    fn normal(&self, at: &Point) -> Option<Normal<W>> {
        let probes = probes(&self.parameters(at));
        let dynamics = Dynamics::from_values(at.values.as_slice());
        Normal::sum(self.rows.movements.len(), |k| {
            let offset = at.offsets[k];
            let blocks = (self.rows).evaluate_movement(k, &probes, &dynamics, offset);
            Some(self.sums(k, &blocks, offset, self.sizes(at)))
        })
    }
}

type Matrix = [[f64; 3]; 3];

/// Residuals and derivatives of a block.
#[inline(always)]
pub(super) fn columns<const W: usize>(block: &Block) -> [[f64; W]; 3] {
    let mut columns = [[0.0; W]; 3];
    for (probe, column) in columns.iter_mut().enumerate() {
        let own = probe * PER_PROBE;
        column[own..own + PER_PROBE].copy_from_slice(&block.by_parameter[probe]);
        column[LAG] = block.by_lag[probe];
        for (sensor, by) in block.by_temperature[probe].into_iter().enumerate() {
            column[Coefficient::new(probe, sensor).row()] = by;
        }
        let late = block.by_probe_lag[probe];
        match probe {
            2 => column[PROBE_LAGS..ACCELERATIONS].fill(-late),
            _ => column[PROBE_LAGS + probe] = late,
        }
        let own = ACCELERATIONS + 6 * probe;
        column[own..own + 6].copy_from_slice(&block.acceleration_m_s2);
        column[LAG_RATE] = block.by_lag[probe] * block.time_s;
        column[W - 1] = block.residual_m[probe];
    }
    columns
}

/// Columns less what the filter expects of them.
#[inline(always)]
fn innovations<const W: usize>(
    columns: &mut [[f64; W]; 3],
    block: &Block,
    expected: &[[f64; W]; 3],
) {
    for (column, [x, y, rz]) in columns.iter_mut().zip(block.by_pose) {
        for (j, column) in column.iter_mut().enumerate() {
            *column -= (x * expected[0][j] + y * expected[1][j]) + rz * expected[2][j];
        }
    }
}

/// One step of the filter.
#[derive(Clone, Copy, Debug)]
pub struct Gain {
    /// Innovation (A, B, C) per error of the reference (X, Y, Rz).
    pub by_pose: [[f64; 3]; 3],
    /// Pose (X, Y, Rz) per innovation (A, B, C).
    pub kalman: [[f64; 3]; 3],
    /// Covariance of the reference's error after the step.
    spread: Matrix,
    /// Cholesky factor of the covariance of the innovations.
    pub factor: [[f64; 3]; 3],
}

impl Gain {
    fn new(block: &Block, spread: &Matrix, noise: &Noise) -> Self {
        let h = &block.by_pose;
        // P H', by axis and probe.
        let seen = each(|axis, probe| dot(&spread[axis], &h[probe]));
        let mut innovation =
            each(|i, k| h[i][0] * seen[0][k] + h[i][1] * seen[1][k] + h[i][2] * seen[2][k]);
        for (k, row) in innovation.iter_mut().enumerate() {
            row[k] += noise.white_m[k] * noise.white_m[k] / block.rows;
        }
        let factor = cholesky(&innovation);
        let kalman = seen.map(|row| solve(&factor, row));
        let spread = each(|i, k| spread[i][k] - dot(&kalman[i], &seen[k]));
        let spread = each(|i, k| 0.5 * (spread[i][k] + spread[k][i]));
        Self {
            by_pose: *h,
            kalman,
            spread,
            factor,
        }
    }

    #[inline(always)]
    fn whiten<const W: usize>(&self, columns: &mut [[f64; W]; 3]) {
        let l = &self.factor;
        let [first, second, third] = [1.0 / l[0][0], 1.0 / l[1][1], 1.0 / l[2][2]];
        let [row_a, row_b, row_c] = columns;
        for ((x, y), z) in row_a.iter_mut().zip(row_b).zip(row_c) {
            *x *= first;
            *y = (*y - l[1][0] * *x) * second;
            *z = (*z - l[2][0] * *x - l[2][1] * *y) * third;
        }
    }
}

fn each(value: impl Fn(usize, usize) -> f64) -> Matrix {
    [0, 1, 2].map(|i| [0, 1, 2].map(|k| value(i, k)))
}

fn dot(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    (a[0] * b[0] + a[1] * b[1]) + a[2] * b[2]
}

/// The lower factor of a covariance. A pivot that rounding makes negative counts as the smallest number.
fn cholesky(m: &Matrix) -> Matrix {
    let root = |x: f64| x.max(f64::MIN_POSITIVE).sqrt();
    let a = root(m[0][0]);
    let (b, c) = (m[1][0] / a, m[2][0] / a);
    let d = root(m[1][1] - b * b);
    let e = (m[2][1] - c * b) / d;
    let f = root(m[2][2] - c * c - e * e);
    [[a, 0.0, 0.0], [b, d, 0.0], [c, e, f]]
}

/// The solution of L L' x = right.
fn solve(l: &Matrix, right: [f64; 3]) -> [f64; 3] {
    let a = right[0] / l[0][0];
    let b = (right[1] - l[1][0] * a) / l[1][1];
    let c = (right[2] - l[2][0] * a - l[2][1] * b) / l[2][2];
    let z = c / l[2][2];
    let y = (b - l[2][1] * z) / l[1][1];
    let x = (a - l[1][0] * y - l[2][0] * z) / l[0][0];
    [x, y, z]
}

#[cfg(test)]
#[path = "whiten_tests.rs"]
mod tests;
