//! Slow residuals beyond noise and drift.

use super::effects::Effects;
use super::estimate::{Estimate, RESIDUAL};
use super::means::Means;
use nalgebra::{Matrix3, Vector3};
use std::ops::Range;

/// Means over these times, s, show residuals up to 10, 0.5 and 0.17 Hz. Sound logs have at most 1.08, 1.46 and 1.66 times
/// the expected power, and more than the second number is no noise.
const BANDS: [(f64, f64); 3] = [(0.05, 1.32), (DRIFTS_S, 1.69), (3.0, 1.69)];
/// Residuals of this time, s, and slower ones look like a drift to the filter that whitens.
const DRIFTS_S: f64 = 1.0;
/// Motion of service is slower than this time, s, and misfit counts at its frequencies.
const TOGETHER_S: f64 = 0.3;
/// The same, in standard deviations of the power.
const BAND_CLEAR: f64 = 4.5;

/// The noise of a channel explains a residual if less than this part remains.
const LEFT_MAX: f64 = 0.2;

/// Means that are taken together for this time.
fn groups(means: &Means, together_s: f64) -> Vec<Range<usize>> {
    let time_s = |at: usize| means.rows.rows[at].time_s;
    let movements = means.rows.movements.iter().cloned();
    movements
        .flat_map(|of| cut(of, time_s, together_s))
        .collect()
}

/// Pieces of this time.
fn cut(range: Range<usize>, time_s: impl Fn(usize) -> f64, piece_s: f64) -> Vec<Range<usize>> {
    let (mut pieces, mut start) = (Vec::new(), range.start);
    for at in range.clone() {
        if time_s(at) - time_s(start) >= piece_s {
            pieces.push(start..at);
            start = at;
        }
    }
    pieces.push(start..range.end);
    pieces
}

/// The power of the residual over the power of noise: of all means, or at the frequencies of motion, where noise that is
/// not white is largest.
pub(super) fn misfit(means: &Means, estimate: &Estimate) -> f64 {
    let groups = groups(means, TOGETHER_S);
    // The parameters follow up to half of the slow residual.
    let freedom = 0.5 * 3.0 * groups.len() as f64;
    let slow = (groups.into_iter()).map(|group| power(estimate, group).sum());
    let all = estimate.chi_squared / means.freedom();
    (slow.sum::<f64>() / freedom).max(all).max(1.0)
}

/// The beam with a noise that explains the residual, if the noise of no probe does; in service there are no beams.
pub(super) fn noisy_beam(effects: &Effects, estimate: &Estimate) -> Option<usize> {
    let (mut all, mut left) = (0.0, [0.0; 9]);
    let groups = groups(effects.means, BANDS[0].0);
    // Chance makes half of this sum of squares.
    let least = 2.0 * BAND_CLEAR * (6.0 * groups.len() as f64).sqrt();
    for group in groups {
        let factor = Matrix3::from(estimate.gains[group.start].factor).transpose();
        let Some(to_white) = factor.try_inverse() else {
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
    let explains = |channel: &usize| all > least && left[*channel] < LEFT_MAX * all;
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
    let residuals = rows.map(|row| Vector3::from(row.map(|of| of[RESIDUAL])));
    residuals.sum::<Vector3<f64>>() * share
}

/// Variances of A, B, C by slow residuals beyond noise and drift, m2: by a wrong calibration, and by what may be a drift of
/// the probes or of the reference.
pub(super) fn slow_m2(effects: &Effects, estimate: &Estimate) -> [[f64; 3]; 2] {
    if noisy_beam(effects, estimate).is_some() {
        return [[0.0; 3]; 2];
    }
    let means = effects.means;
    let rows: f64 = means.rows.rows.iter().map(|row| row.weight).sum();
    let drifts_m2 = beyond_drift_m2(means, estimate);
    let (mut slower, mut slower_m2) = (Vector3::zeros(), Vector3::<f64>::zeros());
    let (mut count, mut found, mut drifts) = (0.0, [0.0; 3], [0.0; 3]);
    for ((time_s, limit), drift_m2) in BANDS.into_iter().zip(drifts_m2).rev() {
        let groups = groups(means, time_s);
        let own = groups.len() as f64 - count;
        count += own;
        let squares: Vector3<f64> = groups.into_iter().map(|group| power(estimate, group)).sum();
        for (k, white_m) in means.white_m.into_iter().enumerate() {
            let power = (squares[k] - slower[k]) / own;
            if power > limit.max(1.0 + BAND_CLEAR * (2.0 / own).sqrt()) {
                match time_s < DRIFTS_S {
                    true => found[k] += (power - 1.0) * white_m * white_m * own / rows,
                    false => drifts[k] += (drift_m2[k] - slower_m2[k]).max(0.0),
                }
            }
        }
        (slower, slower_m2) = (squares, drift_m2);
    }
    [found, drifts]
}

/// By band, the variances of means of the residuals of A, B, C that are no drift, m2.
fn beyond_drift_m2(means: &Means, estimate: &Estimate) -> [Vector3<f64>; 3] {
    let mut bands = [Vector3::zeros(); 3];
    let per_s = Vector3::from(estimate.noise.drift.map(|drift| drift * drift));
    let movements = means.rows.movements.iter();
    for movement in movements.filter(|movement| !movement.is_empty()) {
        let (mut error, mut drift_m2) = (Vector3::zeros(), Vector3::zeros());
        // The filter that whitens, backwards.
        let signals = movement.clone().map(|at| {
            let gain = &estimate.gains[at];
            let of = [gain.by_pose, gain.kalman, gain.factor];
            let [by_error, kalman, factor] = of.map(|rows| Matrix3::from(rows).transpose());
            let new = factor * Vector3::from(estimate.rows[at].map(|of| of[RESIDUAL]));
            let signals = new + by_error * error;
            error += kalman * new;
            drift_m2 += by_error.component_mul(&by_error) * per_s;
            signals
        });
        let signals: Vec<Vector3<f64>> = signals.collect();
        let time_s = |at: usize| means.rows.rows[movement.start + at].time_s;
        let length_s = time_s(signals.len() - 1) - time_s(0);
        // A line is a drift.
        let from_middle_s = |at: usize| time_s(at) - time_s(0) - 0.5 * length_s;
        let (mut sum, mut by_time, mut squares) = (Vector3::zeros(), Vector3::zeros(), 0.0);
        for (at, signals) in signals.iter().enumerate() {
            sum += signals;
            by_time += signals * from_middle_s(at);
            squares += from_middle_s(at).powi(2);
        }
        let (middle, slope) = (
            sum / signals.len() as f64,
            by_time / f64::max(squares, 1e-12),
        );
        for (band, (together_s, _)) in bands.iter_mut().zip(BANDS) {
            for group in cut(0..signals.len(), time_s, together_s) {
                let part = group.len() as f64;
                let own = group.map(|at| signals[at] - middle - slope * from_middle_s(at));
                let mean = own.sum::<Vector3<f64>>() / part;
                *band += mean.component_mul(&mean) * part;
            }
            // A walk about its line, less the walk within means.
            *band -= drift_m2 * (length_s / 15.0 - together_s / 6.0).max(0.0);
        }
    }
    bands.map(|band| band / means.rows.rows.len().max(1) as f64)
}
