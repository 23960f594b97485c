//! Channels that show only their noise where the residuals show that they should move.

use super::BLOCK;
use super::channels::{LogSignals, levels};
use super::residual::Residuals;
use super::still;
use crate::diagnose::limits::CLEAR;
use crate::judge::spectrum::windows;
use hallstage_input::finding::Finding;
use rayon::prelude::*;
use std::ops::Range;

/// Rows of a window.
const WINDOW: usize = BLOCK * BLOCK;

/// Channels that stand still in windows where their motion would explain the residuals better than any other error.
pub(super) fn standing(log: &mut LogSignals, residuals: &Residuals) -> Vec<Finding> {
    let mut windows = windows(&log.segments, WINDOW);
    windows.retain(|window| log.usable[window.clone()].iter().all(|used| *used));
    let stuck = windows
        .par_iter()
        .map(|window| stuck_in(log, residuals, window));
    let mut runs: Vec<Vec<Range<usize>>> = vec![Vec::new(); log.channels.len()];
    for (channel, window) in stuck.collect::<Vec<_>>().into_iter().zip(windows) {
        let Some(channel) = channel else { continue };
        match runs[channel].last_mut() {
            Some(run) if run.end == window.start => run.end = window.end,
            _ => runs[channel].push(window),
        }
    }
    // The channel may stand still in parts of the windows beside, too.
    still::named(log, runs, WINDOW)
}

/// The channel that stands still in a window.
fn stuck_in(log: &LogSignals, residuals: &Residuals, window: &Range<usize>) -> Option<usize> {
    let centred = |values: &Vec<f64>| {
        let levels = levels(&values[window.clone()]);
        let mean = levels.iter().sum::<f64>() / BLOCK as f64;
        levels.into_iter().map(move |level| level - mean)
    };
    let squares = |values: &Vec<f64>| centred(values).map(|x| x * x).sum::<f64>();
    let shown_m = residuals
        .values
        .each_ref()
        .map(|values| centred(values).collect::<Vec<_>>());
    // By channel: the residuals that its errors explain, and the squares of these errors.
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
    let clear = CLEAR * CLEAR;
    let is_stuck =
        explained > clear * BLOCK as f64 && missed > clear * squares(&log.channels[best]);
    is_stuck.then_some(best)
}

#[cfg(test)]
mod tests {
    use super::super::sample_for_tests::{held, only, recording};
    use hallstage_input::channel::Channel;
    use hallstage_input::finding::Code;

    #[test]
    fn a_channel_that_stands_still_but_for_its_noise_is_stuck() {
        for (channel, name) in [(2, Channel::HallC), (3, Channel::BeamX)] {
            let found = only(
                &held(&recording(), channel, 1, 0..1000, 1.0),
                Code::Stuck,
                Some(name),
            );
            assert_eq!((found.movement(), found.t_us()), (Some("1"), Some(0)));
        }
    }
}
