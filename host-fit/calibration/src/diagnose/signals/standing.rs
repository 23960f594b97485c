//! Channels that stand still, noise aside, where the residuals say that they should move.

use super::channels::{LogSignals, median};
use super::repeats::MISSED_M;
use super::residual::Residuals;
use super::still::stuck;
use crate::finding::Finding;
use crate::statistics::quantile;
use rayon::prelude::*;
use std::ops::Range;

/// A channel stands still if it moves by less than this share of what it moves elsewhere.
const STILL_SHARE: f64 = 0.01;
/// Length of the stretches in which a channel stands still, and of the blocks whose medians show
/// what it misses, s.
const STANDING_S: f64 = 0.25;
const BLOCK_S: f64 = 0.02;
/// Names channels that stand still, noise aside, where the others say that they move; the rows of such
/// runs are left out.
pub(super) fn standing(log: &mut LogSignals, residuals: &Residuals) -> Vec<Finding> {
    let missed = |channel: usize| {
        let mut runs = still_runs(log, residuals, channel);
        runs.retain(|run| is_missed(log, residuals, channel, run));
        runs
    };
    let channels = (0..log.channels.len()).into_par_iter();
    let runs: Vec<Vec<Range<usize>>> = channels.map(missed).collect();
    let finding = |(runs, channel): (&Vec<_>, &super::channels::Channel)| {
        let longest: &Range<usize> = runs.iter().max_by_key(|run: &&Range<usize>| run.len())?;
        // No cost: the residuals show it, and those of a wrong log may look alike.
        Some(stuck(log, channel.name, longest, 0.0).on(channel.name))
    };
    let findings = runs.iter().zip(&log.channels).filter_map(finding).collect();
    log.leave_out(runs.into_iter().flatten());
    findings
}

/// Runs within movements in which a channel hardly moves, of what it moves elsewhere.
fn still_runs(log: &LogSignals, residuals: &Residuals, channel: usize) -> Vec<Range<usize>> {
    let values = &log.channels[channel].values;
    let noise_m = residuals.noise_m.get(channel).copied().unwrap_or(0.0);
    let length = log.rows_in(STANDING_S);
    let stretches = |segment: &Range<usize>| -> Vec<Range<usize>> {
        let starts = segment.clone().step_by(length);
        let stretches = starts.map(|start| start..(start + length).min(segment.end));
        stretches.filter(|rows| rows.len() > length / 2).collect()
    };
    let spread = |rows: &Range<usize>| usual_spread(values[rows.clone()].to_vec());
    let all: Vec<Range<usize>> = log.segments.iter().flat_map(stretches).collect();
    let most = all.iter().map(spread).fold(0.0, f64::max);
    let is_still = |rows: &&Range<usize>| {
        log.usable[rows.start] && spread(rows) < (STILL_SHARE * most).max(4.0 * noise_m)
    };
    let mut runs: Vec<Range<usize>> = Vec::new();
    for rows in all.iter().filter(is_still) {
        match runs.last_mut() {
            Some(run) if run.end == rows.start && log.same_movement(run.start, rows.start) => {
                run.end = rows.end;
            }
            _ => runs.push(rows.clone()),
        }
    }
    runs
}

/// Whether an error of the channel explains the residuals in a run better than that of any other, and these
/// move like a stage: noise, hum and outliers vanish in medians of blocks of rows.
fn is_missed(log: &LogSignals, residuals: &Residuals, channel: usize, run: &Range<usize>) -> bool {
    let length = log.rows_in(BLOCK_S);
    let blocks = run
        .clone()
        .step_by(length)
        .filter(|start| start + length <= run.end);
    let levels = residuals.values.each_ref().map(|values| {
        let level = |start: usize| median(&mut values[start..start + length].to_vec());
        let mut levels: Vec<f64> = blocks.clone().map(level).collect();
        let mean = levels.iter().sum::<f64>() / levels.len().max(1) as f64;
        levels.iter_mut().for_each(|level| *level -= mean);
        levels
    });
    let mut explained = vec![0.0; log.channels.len()];
    for (k, row) in blocks.enumerate() {
        let shown_m = levels.each_ref().map(|levels| levels[k]);
        let errors = residuals.errors(log, row, shown_m);
        errors
            .iter()
            .for_each(|error| explained[error.channel] += error.explained);
    }
    let most = explained.iter().copied().fold(0.0, f64::max);
    let missed_m = MISSED_M + 4.0 * residuals.noise_m.into_iter().fold(0.0, f64::max);
    explained[channel] >= most
        && levels
            .into_iter()
            .any(|levels| usual_spread(levels) > missed_m)
}

/// Between the ninth part from below and from above: outliers do not count.
fn usual_spread(mut values: Vec<f64>) -> f64 {
    let [high, low] = [8.0 / 9.0, 1.0 / 9.0].map(|share| quantile(&mut values, share));
    high.unwrap_or(0.0) - low.unwrap_or(0.0)
}
