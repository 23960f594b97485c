//! White noise of the probes and the walk of the reference, as three scalar channels.
//!
//! In the space of the pose the reference's walk has a diagonal covariance D a second, and the probes'
//! noise N = B^-1 S B^-T (B: derivatives of the signals by the pose). A matrix T with T N T' = 1 and
//! T D T' diagonal makes three channels that a scalar filter each turns into innovations. The offset of
//! each movement, which starts anywhere, is projected out exactly; where errors of resets are declared it is
//! unknown within these.

use super::blocks::Log;
use super::map::{Row, WIDTH};
use nalgebra::{Matrix3, SymmetricEigen, Vector3};
use std::ops::Range;

/// Declared drift of the interferometers in a movement: mm, mm, mrad. A free walk swallows faults.
const DRIFT_MAX: [f64; 3] = [0.6e-3; 3];
/// Walks that are tried, as parts of the largest.
const PARTS: [f64; 5] = [1.0, 0.7, 0.45, 0.25, 0.1];

/// The filter of one log: for each mean and channel gain and scale.
#[derive(Clone, Debug)]
pub(super) struct Filter {
    /// From B^-1 y to the channels.
    pub(super) to_channels: Matrix3<f64>,
    /// By mean: gains and scales of the three channels.
    steps: Vec<[[f64; 2]; 3]>,
    movements: Vec<Range<usize>>,
    log_determinant: f64,
}

impl Filter {
    /// For a walk (mm, mm, mrad in a root of a second) and what turns signals into a pose at the middle.
    fn new(log: &Log, inverse: &Matrix3<f64>, walk: [f64; 3]) -> Option<Self> {
        let white = Matrix3::from_diagonal(&Vector3::from(log.white_mm.map(|x| x * x)));
        let noise = inverse * white * inverse.transpose();
        let lower = noise.cholesky()?.l().try_inverse()?;
        let walk = Matrix3::from_diagonal(&Vector3::from(walk.map(|x| x * x)));
        let eigen = SymmetricEigen::new(lower * walk * lower.transpose());
        let to_channels = eigen.eigenvectors.transpose() * lower;
        // Nearly diagonal: resets and walk are those of the same beams.
        let resets = log.resets_mm.map(|resets_mm| {
            let resets = Matrix3::from_diagonal(&Vector3::from(resets_mm.map(|x| x * x)));
            to_channels * resets * to_channels.transpose()
        });
        let mut steps = vec![[[0.0; 2]; 3]; log.means.len()];
        let mut log_determinant = 0.0;
        for movement in &log.movements {
            for (channel, per_s) in eigen.eigenvalues.iter().enumerate() {
                let first = &log.means[movement.start].row;
                let (mut spread, mut time_s) = (1.0 / first.weight, first.time_s);
                // Where nothing is known of it the first mean sets the offset, and says nothing else.
                let mut step = [1.0, 0.0];
                if let Some(resets) = &resets {
                    let reset = resets[(channel, channel)];
                    let sum = reset + spread;
                    step = [reset / sum, 1.0 / sum.sqrt()];
                    spread *= step[0];
                    log_determinant += libm::log(sum);
                }
                steps[movement.start][channel] = step;
                let of_movement = steps[movement.clone()]
                    .iter_mut()
                    .zip(&log.means[movement.clone()]);
                for (step, mean) in of_movement.skip(1) {
                    let row = &mean.row;
                    spread += per_s.max(0.0) * (row.time_s - time_s).max(0.0);
                    time_s = row.time_s;
                    let sum = spread + 1.0 / row.weight;
                    let gain = spread / sum;
                    step[channel] = [gain, 1.0 / sum.sqrt()];
                    spread *= 1.0 - gain;
                    log_determinant += libm::log(sum);
                }
            }
        }
        Some(Self {
            to_channels,
            steps,
            movements: log.movements.clone(),
            log_determinant,
        })
    }

    /// The walk that explains the residuals (pose, by mean) best, up to the declared drift.
    pub(super) fn best(
        log: &Log,
        to_pose: &Matrix3<f64>,
        residuals: &[Vector3<f64>],
    ) -> Option<Self> {
        let longest_s = log.movements.iter().map(|movement| {
            log.means[movement.end - 1].row.time_s - log.means[movement.start].row.time_s
        });
        let root_s = longest_s.fold(0.0, f64::max).max(0.1).sqrt();
        let mut best: Option<(f64, Self)> = None;
        for part in PARTS {
            let filter = Self::new(log, to_pose, DRIFT_MAX.map(|most| part * most / root_s))?;
            let column = residuals.iter().map(|r| (filter.to_channels * r).into());
            let column: Vec<[f64; 3]> = column.collect();
            let cost = filter.squares(&column, &(0..column.len())) + filter.log_determinant;
            if best.as_ref().is_none_or(|(least, _)| cost < *least) {
                best = Some((cost, filter));
            }
        }
        Some(best?.1)
    }

    /// The sum of squares of a whitened column that is `raw` in a range and zero elsewhere.
    pub(super) fn squares(&self, raw: &[[f64; 3]], range: &Range<usize>) -> f64 {
        let mut sum = 0.0;
        for movement in &self.movements {
            let (start, end) = (range.start.max(movement.start), range.end.min(movement.end));
            if start >= end {
                continue;
            }
            let mut expected = [0.0; 3];
            let after = std::iter::repeat_n(&[0.0; 3], movement.end - end);
            let values = raw[start..end].iter().chain(after);
            for (steps, value) in self.steps[start..movement.end].iter().zip(values) {
                for channel in 0..3 {
                    let [gain, scale] = steps[channel];
                    let value = value[channel];
                    let innovation = value - expected[channel];
                    expected[channel] += gain * innovation;
                    sum += (scale * innovation) * (scale * innovation);
                }
            }
        }
        sum
    }

    /// Innovations of the rows of a movement that begins at this mean, over their standard deviations.
    pub(super) fn whiten(&self, start: usize, rows: &mut [Row]) {
        let mut expected = [[0.0; WIDTH]; 3];
        for (steps, row) in self.steps[start..].iter().zip(rows) {
            for channel in 0..3 {
                let [gain, scale] = steps[channel];
                for (x, expected) in row[channel].iter_mut().zip(&mut expected[channel]) {
                    let innovation = *x - *expected;
                    *expected += gain * innovation;
                    *x = scale * innovation;
                }
            }
        }
    }

    /// The transposed of [`whiten`](Self::whiten), of all movements.
    pub(super) fn whiten_back(&self, rows: &mut [Row]) {
        for movement in &self.movements {
            let mut after = [[0.0; WIDTH]; 3];
            for at in movement.clone().rev() {
                for channel in 0..3 {
                    let [gain, scale] = self.steps[at][channel];
                    for (x, after) in rows[at][channel].iter_mut().zip(&mut after[channel]) {
                        let scaled = scale * *x;
                        *x = scaled + gain * *after;
                        *after = (1.0 - gain) * *after - scaled;
                    }
                }
            }
        }
    }
}
