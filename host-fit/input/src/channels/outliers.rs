//! Rows far from the rows before and behind.

use super::signal::Signal;
use super::{codes, noise};
use crate::statistics::CLEAR;

/// Variance of the fourth differences of white noise of variance one.
const POWER: f64 = 70.0;
/// The weight of the middle row in fourth differences.
const MIDDLE: f64 = 6.0;
/// The distance from the line through two rows has six times the variance, and must exceed this many standard deviations.
const CLEAR_OF_LINE: f64 = 4.5;

/// The rows that are outliers, with their errors, m. A row beside a step is none: it is near the line through the two rows
/// before, or behind.
pub fn outliers(signal: &Signal) -> Vec<(usize, f64)> {
    let Some(noise) = noise::white(signal) else {
        return Vec::new();
    };
    let noise = noise.max(codes::step(signal));
    let least = CLEAR * POWER.sqrt() / MIDDLE * noise;
    let off_line = CLEAR_OF_LINE * 6f64.sqrt() * noise;
    let mut found = Vec::new();
    for run in signal.runs {
        for (row, v) in run.clone().zip(signal.values[run.clone()].windows(5)) {
            let error = ((v[0] + v[4]) - 4.0 * (v[1] + v[3]) + MIDDLE * v[2]) / MIDDLE;
            let sides = [2.0 * v[1] - v[0], 2.0 * v[3] - v[4]];
            let off = |side: f64| (v[2] - side) * error.signum();
            let is_far = |side: f64| off(side) > (0.5 * error.abs()).max(off_line);
            if error.abs() > least && sides.into_iter().all(is_far) {
                found.push((row + 2, error * signal.unit_m));
            }
        }
    }
    found
}
