//! Slow residuals beyond noise and drift.

use super::effects::Effects;
use super::estimate::{Estimate, RESIDUAL};
use super::means::Means;
use nalgebra::{Matrix3, Vector3};
use std::ops::Range;

/// Means over these times, s, show residuals up to 10 Hz and up to 0.5 Hz. Sound logs have at most 1.08 and 1.46 times the
/// expected power, and more than the second number is no noise.
const BANDS: [(f64, f64); 2] = [(0.05, 1.32), (1.0, 1.69)];
/// Motion of service is slower than this time, s, and misfit counts at its frequencies.
const TOGETHER_S: f64 = 0.3;
/// The same, in standard deviations of the power.
const BAND_CLEAR: f64 = 4.5;

/// The noise of a channel explains a residual if less than this part remains.
const LEFT_MAX: f64 = 0.2;

/// Means that are taken together for this time.
fn groups(means: &Means, together_s: f64) -> Vec<Range<usize>> {
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

/// The power of the residual over the power of noise: of all means, or at the frequencies of motion, where noise that is
/// not white is largest.
pub(super) fn misfit(means: &Means, estimate: &Estimate) -> f64 {
    let groups = groups(means, TOGETHER_S);
    // The parameters follow up to half of the slow residual.
    let freedom = 0.5 * 3.0 * groups.len() as f64;
    let slow: f64 = groups
        .into_iter()
        .map(|group| power(estimate, group).sum())
        .sum();
    let all = estimate.chi_squared / means.freedom();
    (slow / freedom).max(all).max(1.0)
}

/// The beam with a noise that explains the residual, if the noise of no probe does; in service there are no beams.
pub(super) fn noisy_beam(effects: &Effects, estimate: &Estimate) -> Option<usize> {
    let (mut all, mut left) = (0.0, [0.0; 9]);
    for group in groups(effects.means, BANDS[0].0) {
        let Some(to_white) = Matrix3::from(estimate.gains[group.start].factor)
            .transpose()
            .try_inverse()
        else {
            continue;
        };
        let by_channel = effects.by_channel(group.start);
        let sum = sum(estimate, group);
        let squares = sum.norm_squared();
        all += squares - 3.0;
        for (left, by) in left.iter_mut().zip(by_channel) {
            let white = to_white * by;
            *left += squares - sum.dot(&white).powi(2) / white.norm_squared() - 2.0;
        }
    }
    let explains = |channel: &usize| left[*channel] < LEFT_MAX * all;
    let beam = (3..6).find(explains)?;
    (!(0..3).any(|probe| explains(&probe))).then_some(beam)
}

/// The squares of A, B, C in the mean of a group, over the variance of its noise.
fn power(estimate: &Estimate, group: Range<usize>) -> Vector3<f64> {
    sum(estimate, group).map(|sum| sum * sum)
}

fn sum(estimate: &Estimate, group: Range<usize>) -> Vector3<f64> {
    let share = 1.0 / (group.len() as f64).sqrt();
    let rows = estimate.rows[group].iter();
    let sum: Vector3<f64> = rows
        .map(|row| Vector3::from(row.map(|of| of[RESIDUAL])))
        .sum();
    sum * share
}

/// Variances of A, B, C by slow residuals beyond noise and drift, m2.
pub(super) fn slow_m2(effects: &Effects, estimate: &Estimate) -> [f64; 3] {
    if noisy_beam(effects, estimate).is_some() {
        return [0.0; 3];
    }
    let means = effects.means;
    let rows: f64 = means.rows.rows.iter().map(|row| row.weight).sum();
    let (mut slower, mut count, mut found) = (Vector3::zeros(), 0.0, [0.0; 3]);
    for (time_s, limit) in BANDS.into_iter().rev() {
        let groups = groups(means, time_s);
        let own = groups.len() as f64 - count;
        count += own;
        let squares: Vector3<f64> = groups.into_iter().map(|group| power(estimate, group)).sum();
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
