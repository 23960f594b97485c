//! Channels that stand still, noise aside, where the residuals say that they should move.

use super::channels::{Channel, LogSignals, median};
use super::repeats::MISSED_M;
use super::residual::Residuals;
use super::still::stuck;
use crate::finding::Finding;
use rayon::prelude::*;
use std::ops::Range;

/// A channel stands still if it moves by less than this share of what it moves elsewhere.
const STILL_SHARE: f64 = 0.01;
/// Length of the stretches in which a channel stands still, and of the blocks whose means show
/// what it misses, s.
const STANDING_S: f64 = 0.25;
const BLOCK_S: f64 = 0.02;
/// Power of the residuals that the error of one channel may leave, and by how much more than that
/// of another; the largest part of its own that two levels may explain: that is a step.
const LEFT_MAX: f64 = 0.45;
const WORSE_MAX: f64 = 0.1;
const STEP_SHARE: f64 = 0.93;

/// Channels that stand still, noise aside, where the others say that they move; the rows of such
/// runs are left out.
pub(super) fn standing(log: &mut LogSignals, residuals: &Residuals) -> Vec<Finding> {
    let noise_m = residuals.noise_m.iter().copied().fold(0.0, f64::max);
    let signals: &LogSignals = log;
    let runs = |(channel, signal): (usize, &Channel)| {
        let own_noise_m = residuals.noise_m.get(channel).copied().unwrap_or(0.0);
        let mut runs = still_runs(signals, &signal.values, 4.0 * own_noise_m);
        let missed_m = MISSED_M + 4.0 * noise_m;
        runs.retain(|run| is_missed(signals, residuals, channel, run, missed_m));
        runs
    };
    let runs: Vec<Vec<Range<usize>>> = (signals.channels.par_iter().enumerate())
        .map(runs)
        .collect();
    let mut findings = Vec::new();
    let mut left_out: Vec<Range<usize>> = Vec::new();
    for (signal, stuck_runs) in log.channels.iter().zip(runs) {
        if let Some(longest) = stuck_runs.iter().max_by_key(|run| run.len()) {
            // Told by what the field model leaves, which a wrong log may leave too.
            findings.push(stuck(log, signal.name, longest, 0.0).on(signal.name));
        }
        left_out.extend(stuck_runs);
    }
    log.leave_out(left_out);
    findings
}

/// Runs within segments in which a channel hardly moves, of what it moves elsewhere.
fn still_runs(log: &LogSignals, values: &[f64], noise_m: f64) -> Vec<Range<usize>> {
    let length = log.rows_in(STANDING_S);
    let stretches = |segment: &Range<usize>| {
        let (start, end) = (segment.start, segment.end);
        let starts = (start..end).step_by(length);
        let stretches = starts.map(move |start| start..(start + length).min(end));
        stretches
            .filter(|stretch| stretch.len() > length / 2)
            .collect::<Vec<_>>()
    };
    let range = |stretch: &Range<usize>| usual_spread(&values[stretch.clone()]);
    let all = || log.segments.iter().flat_map(stretches);
    let most = all().map(|stretch| range(&stretch)).fold(0.0, f64::max);
    let mut runs: Vec<Range<usize>> = Vec::new();
    for stretch in all() {
        let still = range(&stretch) < (STILL_SHARE * most).max(noise_m);
        if !still || !log.usable[stretch.start] {
            continue;
        }
        let starts_segment = log.segments.iter().any(|s| s.start == stretch.start);
        match runs.last_mut() {
            Some(run) if run.end == stretch.start && !starts_segment => run.end = stretch.end,
            _ => runs.push(stretch),
        }
    }
    runs
}

/// Whether an error of the channel explains the residuals in a run, and these move like a stage:
/// noise, hum and outliers vanish in medians of blocks of rows, and a step is no motion.
fn is_missed(
    log: &LogSignals,
    residuals: &Residuals,
    channel: usize,
    run: &Range<usize>,
    missed_m: f64,
) -> bool {
    let length = log.rows_in(BLOCK_S);
    let blocks: Vec<Range<usize>> = (run.clone().step_by(length))
        .map(|start| start..start + length)
        .filter(|block| block.end <= run.end)
        .collect();
    let level = |values: &[f64], block: &Range<usize>| median(&mut values[block.clone()].to_vec());
    let mut shown: Vec<[f64; 3]> = (blocks.iter())
        .map(|block| [0, 1, 2].map(|k| level(&residuals.values[k], block)))
        .collect();
    for k in 0..3 {
        let middle = shown.iter().map(|m| m[k]).sum::<f64>() / shown.len().max(1) as f64;
        shown.iter_mut().for_each(|m| m[k] -= middle);
    }
    let dot = |a: &[f64; 3], b: &[f64; 3]| (0..3).map(|k| a[k] * b[k]).sum::<f64>();
    let mut all = 0.0;
    let mut left = vec![0.0; log.channels.len()];
    let mut errors_m = Vec::with_capacity(blocks.len());
    for (block, shown) in blocks.iter().zip(&shown) {
        all += dot(shown, shown);
        let of_errors = residuals.of_errors(log, block.start);
        for (other, slopes) in of_errors.iter().enumerate() {
            let error_m = dot(slopes, shown) / dot(slopes, slopes).max(1e-6);
            let rest = [0, 1, 2].map(|k| shown[k] - slopes[k] * error_m);
            left[other] += dot(&rest, &rest);
            if other == channel {
                errors_m.push(error_m);
            }
        }
    }
    let least = left.iter().copied().fold(f64::INFINITY, f64::min);
    left[channel] < (LEFT_MAX * all).min(least + WORSE_MAX * all)
        && (0..3).any(|k| usual_spread(&shown.iter().map(|m| m[k]).collect::<Vec<_>>()) > missed_m)
        && two_levels(&errors_m) < STEP_SHARE
}

/// The part of the variance that the best two levels, one after the other, explain.
fn two_levels(values: &[f64]) -> f64 {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let all: f64 = values.iter().map(|x| (x - mean) * (x - mean)).sum();
    let (mut sum, mut most) = (0.0, 0.0_f64);
    for (k, x) in values
        .iter()
        .enumerate()
        .take(values.len().saturating_sub(1))
    {
        sum += x - mean;
        let before = (k + 1) as f64;
        most = most.max(sum * sum * n / (before * (n - before)));
    }
    most / all.max(f64::MIN_POSITIVE)
}

/// Between the ninth part from below and from above: outliers do not count.
fn usual_spread(values: &[f64]) -> f64 {
    let mut values = values.to_vec();
    values.sort_unstable_by(f64::total_cmp);
    let ninth = values.len() / 9;
    match (
        values.get(ninth),
        values.get(values.len().saturating_sub(1 + ninth)),
    ) {
        (Some(low), Some(high)) => high - low,
        _ => 0.0,
    }
}
