//! Channels that stand still, noise aside, where the residuals say that they should move.

use super::channels::{LogSignals, median};
use super::residual::Residuals;
use super::spectrum::windows;
use super::still;
use super::{BLOCK, CLEAR};
use crate::finding::Finding;
use rayon::prelude::*;
use std::ops::Range;

/// Rows of a window.
const WINDOW: usize = BLOCK * BLOCK;

/// Names channels that stand still in windows in which their motion would explain the residuals better than
/// an error of any other.
pub(super) fn standing(log: &mut LogSignals, residuals: &Residuals) -> Vec<Finding> {
    let windows = windows(&log.segments, WINDOW);
    let standing =
        |window: &Range<usize>| Some((stuck_in(log, residuals, window)?, window.clone()));
    let found: Vec<(usize, Range<usize>)> = windows.par_iter().filter_map(standing).collect();
    let mut runs: Vec<Vec<Range<usize>>> = vec![Vec::new(); log.channels.len()];
    for (channel, window) in found {
        match runs[channel].last_mut() {
            Some(run) if run.end == window.start => run.end = window.end,
            _ => runs[channel].push(window),
        }
    }
    // It may have begun and ended in the windows beside.
    let beside = |run: &Range<usize>| run.start.saturating_sub(WINDOW)..run.end + WINDOW;
    let wider: Vec<Range<usize>> = runs.iter().flatten().map(beside).collect();
    let found = still::named(log, runs);
    log.leave_out(wider);
    found
}

/// The channel that stands still in a window.
fn stuck_in(log: &LogSignals, residuals: &Residuals, window: &Range<usize>) -> Option<usize> {
    if !log.usable[window.clone()].iter().all(|used| *used) {
        return None;
    }
    let levels = |values: &[f64]| {
        let blocks = values[window.clone()].chunks(BLOCK);
        let levels: Vec<f64> = blocks.map(|block| median(block.iter().copied())).collect();
        let mean = levels.iter().sum::<f64>() / BLOCK as f64;
        levels
            .into_iter()
            .map(move |level| level - mean)
            .collect::<Vec<f64>>()
    };
    let shown_m = residuals.values.each_ref().map(|values| levels(values));
    let mut sums = vec![[0.0; 2]; log.channels.len()];
    for block in 0..BLOCK {
        let row = window.start + block * BLOCK + BLOCK / 2;
        let errors = residuals.errors(log, row, shown_m.each_ref().map(|levels| levels[block]));
        for (sums, [size_m, explained]) in sums.iter_mut().zip(errors) {
            sums[0] += explained;
            sums[1] += size_m * size_m;
        }
    }
    let best = (0..sums.len()).max_by(|&a, &b| sums[a][0].total_cmp(&sums[b][0]))?;
    let [explained, missed] = sums[best];
    let own: f64 = levels(&log.channels[best].values)
        .iter()
        .map(|x| x * x)
        .sum();
    let clear = CLEAR * CLEAR;
    (explained > clear * BLOCK as f64 && missed > clear * own).then_some(best)
}

#[cfg(test)]
mod tests {
    use super::super::sample_for_tests::{held, only, recording};
    use crate::finding::Code;

    #[test]
    fn a_channel_that_stands_still_but_for_its_noise_is_stuck() {
        for (channel, name) in [(2, "hall_c"), (3, "ifm_x")] {
            let found = only(
                &held(&recording(), channel, 1, 0..1000, 1.0),
                Code::Stuck,
                Some(name),
            );
            assert_eq!(
                (found.movement.as_deref(), found.t_us),
                (Some("1"), Some(0))
            );
        }
    }
}
