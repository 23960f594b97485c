//! What the motion does not explain of the Hall signals: residuals of a regression on smooth
//! functions of the reference and of the vertical pose.
//!
//! Any probe over any magnet is described by a polynomial of third order in the pose; the
//! velocities take up a lag of the reference, and every segment has an offset of its own. No
//! model of the decoder is needed, and no fit: a fault of one channel stays in its residual.

use super::channels::{LogSignals, robust_deviation};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

/// Functions: 9 linear ones, 21 squares, 10 cubes of q, 18 of q q V, 18 of q V V.
const FUNCTIONS: usize = 76;
/// Rows that the regression uses at most, about: enough for any noise.
const ROWS_MAX: usize = 30_000;
/// Weight of the prior that all coefficients are zero, in parts of what the rows say: it decides
/// where a log does not.
const RIDGE: f64 = 1e-8;

/// Magnitudes that the arguments of the functions are divided by.
pub(super) struct Units {
    planar: [f64; 3],
    vertical: [f64; 3],
    /// Half as much again as it usually is: a jump is no velocity.
    velocity: [f64; 3],
}

impl Units {
    /// The largest magnitudes of the usable rows.
    pub(super) fn of(log: &LogSignals) -> Self {
        let mut units = Self {
            planar: [1e-12; 3],
            vertical: [1e-12; 3],
            velocity: [1e-12; 3],
        };
        let mut speeds: [Vec<f64>; 3] = Default::default();
        for segment in &log.segments {
            for row in segment.clone().filter(|&row| log.usable[row]) {
                let velocity = velocity(log, segment, row);
                for i in 0..3 {
                    let raise = |unit: &mut f64, x: f64| *unit = unit.max(x.abs());
                    raise(&mut units.planar[i], log.rows[row].reference[i]);
                    raise(&mut units.vertical[i], log.rows[row].vertical[i]);
                    speeds[i].push(velocity[i].abs());
                }
            }
        }
        for (unit, speeds) in units.velocity.iter_mut().zip(&mut speeds) {
            let high = speeds.len() * 19 / 20;
            if high < speeds.len() {
                let usual = *speeds.select_nth_unstable_by(high, f64::total_cmp).1;
                *unit = unit.max(1.5 * usual);
            }
        }
        units
    }

    fn functions(
        &self,
        log: &LogSignals,
        segment: &std::ops::Range<usize>,
        row: usize,
    ) -> [f64; FUNCTIONS] {
        let speed = velocity(log, segment, row);
        let row = &log.rows[row];
        let q: [f64; 3] = std::array::from_fn(|i| row.reference[i] / self.planar[i]);
        let v: [f64; 3] = std::array::from_fn(|i| row.vertical[i] / self.vertical[i]);
        let mut out = [0.0; FUNCTIONS];
        let mut count = 0;
        let mut push = |value: f64| {
            out[count] = value;
            count += 1;
        };
        q.iter().chain(&v).for_each(|&x| push(x));
        (0..3).for_each(|i| push((speed[i] / self.velocity[i]).clamp(-1.0, 1.0)));
        for i in 0..3 {
            for j in 0..3 {
                push(q[i] * v[j]);
                for k in j..3 {
                    push(q[i] * v[j] * v[k]);
                }
            }
            for j in i..3 {
                push(q[i] * q[j]);
                push(v[i] * v[j]);
                (0..3).for_each(|k| push(q[i] * q[j] * v[k]));
                (j..3).for_each(|k| push(q[i] * q[j] * q[k]));
            }
        }
        out
    }
}

/// Of X, Y, Rz by central differences within a segment, per s.
fn velocity(log: &LogSignals, segment: &std::ops::Range<usize>, row: usize) -> [f64; 3] {
    let before = row.saturating_sub(1).max(segment.start);
    let after = (row + 1).min(segment.end - 1);
    let time_s = log.time_s[after] - log.time_s[before];
    if time_s <= 0.0 {
        return [0.0; 3];
    }
    std::array::from_fn(|i| (log.rows[after].reference[i] - log.rows[before].reference[i]) / time_s)
}

/// Residuals of the three Hall signals.
pub(super) struct Residuals<'u> {
    units: &'u Units,
    stride: usize,
    means: Vec<[f64; FUNCTIONS]>,
    scales: Vec<f64>,
    factor: Cholesky<f64, Dyn>,
    /// By probe and row, m at the designed scale; 0 in rows that are left out.
    pub(super) values: [Vec<f64>; 3],
    /// White noise, m.
    pub(super) noise_m: [f64; 3],
    /// Slopes of the signal of a probe over the beams X, Y1, Y2.
    pub(super) gains: [[f64; 3]; 3],
}

impl<'u> Residuals<'u> {
    /// `None` where too few rows are left.
    pub(super) fn new(log: &LogSignals, units: &'u Units) -> Option<Self> {
        let stride = log.len().div_ceil(ROWS_MAX).max(1);
        let mut means = Vec::with_capacity(log.segments.len());
        let mut gram = vec![0.0; FUNCTIONS * FUNCTIONS];
        let mut count = 0;
        for segment in &log.segments {
            let used = || (segment.clone().step_by(stride)).filter(|&row| log.usable[row]);
            let mut mean = [0.0; FUNCTIONS];
            let rows = used().count();
            for row in used() {
                let f = units.functions(log, segment, row);
                (0..FUNCTIONS).for_each(|k| mean[k] += f[k] / rows as f64);
            }
            for row in used() {
                let mut f = units.functions(log, segment, row);
                (0..FUNCTIONS).for_each(|k| f[k] -= mean[k]);
                for (i, line) in gram.chunks_exact_mut(FUNCTIONS).enumerate() {
                    let fi = f[i];
                    (line.iter_mut().zip(&f)).for_each(|(sum, fj)| *sum += fi * fj);
                }
            }
            count += rows;
            means.push(mean);
        }
        if count < 2 * FUNCTIONS {
            return None;
        }
        let gram = DMatrix::from_vec(FUNCTIONS, FUNCTIONS, gram);
        // A function that stands still within the segments tells nothing.
        let least = 1e-12 * count as f64;
        let scales: Vec<f64> = (0..FUNCTIONS)
            .map(|k| 1.0 / gram[(k, k)].max(least).sqrt())
            .collect();
        let scaled = DMatrix::from_fn(FUNCTIONS, FUNCTIONS, |i, j| {
            gram[(i, j)] * scales[i] * scales[j] + if i == j { RIDGE } else { 0.0 }
        });
        let mut residuals = Self {
            units,
            stride,
            means,
            scales,
            factor: Cholesky::new(scaled)?,
            values: Default::default(),
            noise_m: [0.0; 3],
            gains: [[0.0; 3]; 3],
        };
        for probe in 0..3 {
            let (values, slopes) = residuals.solve(log, &log.channels[probe].values);
            let [x, y, rz] = std::array::from_fn(|i| slopes[i] / units.planar[i]);
            let turn = rz / log.baseline_m;
            residuals.gains[probe] = [x, 0.5 * y + turn, 0.5 * y - turn];
            residuals.noise_m[probe] = white_noise(log, &values);
            residuals.values[probe] = values;
        }
        Some(residuals)
    }

    /// What the functions do not explain of a signal, by row.
    pub(super) fn unexplained(&self, log: &LogSignals, signal: &[f64]) -> Vec<f64> {
        self.solve(log, signal).0
    }

    /// How an error of a channel (Hall A, B, C; beam X, Y1, Y2) shows in the residual of a probe.
    pub(super) fn slope(&self, probe: usize, channel: usize) -> f64 {
        match channel.checked_sub(3) {
            None => f64::from(u8::from(probe == channel)),
            Some(beam) => self.gains[probe].get(beam).map_or(0.0, |gain| -gain),
        }
    }

    fn solve(&self, log: &LogSignals, signal: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let mut right = [0.0; FUNCTIONS];
        for (segment, mean) in log.segments.iter().zip(&self.means) {
            let used = || (segment.clone().step_by(self.stride)).filter(|&row| log.usable[row]);
            let rows = used().count().max(1) as f64;
            let middle = used().map(|row| signal[row]).sum::<f64>() / rows;
            for row in used() {
                let f = self.units.functions(log, segment, row);
                let value = signal[row] - middle;
                (0..FUNCTIONS).for_each(|k| right[k] += (f[k] - mean[k]) * value);
            }
        }
        let scaled = DVector::from_fn(FUNCTIONS, |k, _| right[k] * self.scales[k]);
        let solved = self.factor.solve(&scaled);
        let slopes: Vec<f64> = (0..FUNCTIONS).map(|k| solved[k] * self.scales[k]).collect();
        let mut values = vec![0.0; log.len()];
        for segment in &log.segments {
            let used = || segment.clone().filter(|&row| log.usable[row]);
            let mut sum = 0.0;
            for row in used() {
                let f = self.units.functions(log, segment, row);
                let explained: f64 = f.iter().zip(&slopes).map(|(f, slope)| f * slope).sum();
                values[row] = signal[row] - explained;
                sum += values[row];
            }
            let middle = sum / used().count().max(1) as f64;
            used().for_each(|row| values[row] -= middle);
        }
        (values, slopes)
    }
}

/// From differences of neighbours.
fn white_noise(log: &LogSignals, values: &[f64]) -> f64 {
    let rows = log.segments.iter().flat_map(|s| s.start + 1..s.end);
    let used = rows.filter(|&row| log.usable[row] && log.usable[row - 1]);
    robust_deviation(used.map(|row| values[row] - values[row - 1])) / 2f64.sqrt()
}
