//! Slow residuals beyond noise and drift.

use super::means::Means;
use nalgebra::Vector3;
use std::ops::Range;

/// Means over these times, s, show residuals up to 10 Hz and up to 0.5 Hz. Sound logs have at most 1.08 and 1.46 times the
/// expected power, and more than the second number is no noise.
const BANDS: [(f64, f64); 2] = [(0.05, 1.32), (1.0, 1.69)];
/// The same, in standard deviations of the power.
const BAND_CLEAR: f64 = 4.5;

/// Means that are taken together for this time.
pub(super) fn groups(means: &Means, together_s: f64) -> Vec<Range<usize>> {
    let time_s = |at: usize| means.rows.rows[at].time_s;
    let mut groups = Vec::new();
    for movement in &means.rows.movements {
        let mut start = movement.start;
        for at in movement.clone() {
            if time_s(at) - time_s(start) >= together_s {
                groups.push(start..at);
                start = at;
            }
        }
        groups.push(start..movement.end);
    }
    groups
}

/// Variances of A, B, C by slow residuals beyond noise and drift, m2.
pub(super) fn slow_m2(means: &Means, left: &[Vector3<f64>]) -> [f64; 3] {
    let rows: f64 = means.rows.rows.iter().map(|row| row.weight).sum();
    let sum = |group: Range<usize>| {
        let share = 1.0 / group.len() as f64;
        left[group]
            .iter()
            .sum::<Vector3<f64>>()
            .map(|x| x * x * share)
    };
    let (mut slower, mut count, mut found) = (Vector3::zeros(), 0.0, [0.0; 3]);
    for (time_s, limit) in BANDS.into_iter().rev() {
        let groups = groups(means, time_s);
        let own = groups.len() as f64 - count;
        count += own;
        let squares: Vector3<f64> = groups.into_iter().map(sum).sum();
        for (k, white_m) in means.white_m.into_iter().enumerate() {
            let power = (squares[k] - slower[k]) / own;
            if power > limit.max(1.0 + BAND_CLEAR * (2.0 / own).sqrt()) {
                found[k] += (power - 1.0) * white_m * white_m * own / rows;
            }
        }
        slower = squares;
    }
    found
}
