//! What stands still: movements in which nothing moves, and channels that repeat one value.

use super::BLOCK;
use super::channels::{Channel, LogSignals};
use crate::diagnose::left_out;
use crate::finding::{Code, Finding};
use std::ops::Range;

/// What moves by less stands still, m: a few times what the interferometers drift in a movement.
const STILL_M: f64 = 2e-6;
/// One sound log in so many has a run of equal values that is called one.
const RARITY: f64 = 1e6;

/// Names movements in which nothing moves; their rows are left out.
pub(super) fn idle(log: &mut LogSignals) -> Option<Finding> {
    let is_idle = |rows: &&Range<usize>| {
        // Over longer the interferometers of a stage at rest drift.
        let mut pieces = (rows.start..rows.end).step_by(BLOCK);
        let is_still = |start: usize| {
            let piece = start..rows.end.min(start + BLOCK);
            (3..6).all(|beam| spread(&log.channels[beam].values[piece.clone()]) < STILL_M)
        };
        log.source.has_reference && hall_motion_m(log, rows) < STILL_M && pieces.all(is_still)
    };
    let idle: Vec<Range<usize>> = log.segments.iter().filter(is_idle).cloned().collect();
    let first = idle.first()?.start;
    let message = format!(
        "nothing moves in {} of {} movements: they add nothing to the fit; leave them out or record them again",
        idle.len(),
        log.segments.len(),
    );
    log.leave_out(idle);
    Some(log.warning_at(Code::IdleMovement, first, message))
}

/// Names channels that repeat a value for longer than noise does.
pub(super) fn repeats(log: &mut LogSignals) -> Vec<Finding> {
    let mut all = Vec::new();
    for (k, channel) in log.channels.iter().enumerate() {
        let mut runs: Vec<Range<usize>> = Vec::new();
        for segment in &log.segments {
            let mut start = segment.start;
            for values in channel.values[segment.clone()].chunk_by(|a, b| a == b) {
                runs.push(start..start + values.len());
                start += values.len();
            }
        }
        // White noise by second differences; the most likely of its codes comes with this chance.
        let of = |s: &Range<usize>| channel.values[s.clone()].windows(3);
        let seconds = (log.segments.iter().flat_map(of)).map(|v| v[0] - 2.0 * v[1] + v[2]);
        let count = log.rows.len() as f64;
        let noise_m = (seconds.map(|x| x * x).sum::<f64>() / (6.0 * count)).sqrt();
        let chance = libm::erf(channel.m_per_code / (8f64.sqrt() * noise_m));
        let least = match spread(&channel.values) {
            0.0 => 2.0,
            _ => 1.0 + libm::log(RARITY * count) / libm::log(chance).abs(),
        };
        // Not where nothing moves at all.
        let is_new = |run: &Range<usize>| run.len() as f64 >= least && log.usable[run.start];
        runs.retain(|run| is_new(run) && should_move(log, k, run));
        all.push(runs);
    }
    named(log, all)
}

/// Whether a channel should show something in these rows: a probe its noise, which is many codes; a beam
/// motion that a probe shows, a gap that of another.
fn should_move(log: &LogSignals, channel: usize, rows: &Range<usize>) -> bool {
    let moves = |channel: usize| spread(&log.channels[channel].values[rows.clone()]) > STILL_M;
    match channel {
        0..3 => true,
        3..6 => log.source.has_reference && hall_motion_m(log, rows) > STILL_M,
        _ => (6..log.channels.len()).any(moves),
    }
}

/// Names channels that stand still in runs of rows, by channel, at their longest: as saturated where that is an
/// end of what the channel reads. The rows are left out.
pub(super) fn named(log: &mut LogSignals, runs: Vec<Vec<Range<usize>>>) -> Vec<Finding> {
    let finding = |(channel, runs): (&Channel, &Vec<Range<usize>>)| {
        let longest = runs.iter().max_by_key(|run| run.len())?;
        let rows = runs.iter().map(Range::len).sum::<usize>() as f64;
        let share = rows / log.rows.len() as f64;
        let (values, start) = (&channel.values, longest.start);
        let value = values[start];
        let is_end = values.iter().all(|&x| x <= value) != values.iter().all(|&x| x >= value);
        let is_flat = channel.m_per_code > 0.0 && spread(&values[longest.clone()]) == 0.0;
        let stood_s = longest.len() as f64 * log.period_s;
        let (code, size, unit) = match is_flat && is_end {
            true => (Code::Saturated, rows, "rows"),
            false => (Code::Stuck, stood_s, "s"),
        };
        let message = format!(
            "{} stands still in {rows} rows, {:.1} % of the log, for up to {stood_s:.3} s together: {}",
            channel.name,
            100.0 * share,
            code.entry().remedy,
        );
        let found = log.warning_at(code, start, message).on(channel.name);
        Some(found.severe(left_out::severity(share)).of(size, unit))
    };
    let findings = log.channels.iter().zip(&runs).filter_map(finding).collect();
    log.leave_out(runs.into_iter().flatten());
    findings
}

/// How far a stage moves by any probe, by means of rows, m.
fn hall_motion_m(log: &LogSignals, rows: &Range<usize>) -> f64 {
    let moved = |k: usize| {
        let pieces = log.channels[k].values[rows.clone()].chunks_exact(BLOCK);
        let means = pieces.map(|piece| piece.iter().sum::<f64>() / BLOCK as f64);
        spread(&means.collect::<Vec<_>>())
    };
    moved(0).max(moved(1)).max(moved(2))
}

/// Largest less smallest.
fn spread(values: &[f64]) -> f64 {
    let end = |end: fn(f64, f64) -> f64| values.iter().copied().reduce(end).unwrap_or(0.0);
    end(f64::max) - end(f64::min)
}

#[cfg(test)]
mod tests {
    use super::super::sample_for_tests::{ROWS, held, only, recording};
    use crate::finding::{Code, Severity};

    #[test]
    fn a_channel_that_repeats_its_code_is_stuck_and_one_that_does_so_in_a_tenth_refused() {
        for (channel, name) in [(2, "hall_c"), (3, "ifm_x"), (7, "cap_2")] {
            for (rows, severity) in [(300, Severity::Warn), (600, Severity::Refuse)] {
                let frozen = held(&recording(), channel, 1, 500..500 + rows, 0.0);
                let found = only(&frozen, Code::Stuck, Some(name));
                assert_eq!(found.severity, severity, "{rows} of 6,000 rows");
                assert_eq!(
                    (found.movement.as_deref(), found.t_us),
                    (Some("1"), Some(1_000_000))
                );
            }
        }
    }

    #[test]
    fn a_movement_in_which_nothing_moves_is_idle() {
        let mut idle = recording();
        for channel in 0..9 {
            idle = held(&idle, channel, 2, 0..ROWS, 1.0);
        }
        let found = only(&idle, Code::IdleMovement, None);
        assert_eq!(found.movement.as_deref(), Some("2"));
    }

    #[test]
    fn flat_tops_are_named_below_the_end_of_the_converter_too() {
        for (tenths, severity) in [(9, Severity::Warn), (4, Severity::Refuse)] {
            let mut recording = recording();
            let all = recording.movements.iter().flatten();
            let top = all.map(|sample| sample.hall[1]).max().unwrap_or(0) * tenths / 10;
            let mut clipped = 0;
            for sample in recording.movements.iter_mut().flatten() {
                clipped += usize::from(sample.hall[1] >= top);
                sample.hall[1] = sample.hall[1].min(top);
            }
            let found = only(&recording, Code::Saturated, Some("hall_b"));
            assert_eq!(found.severity, severity);
            let rows = found.value.expect("rows");
            assert!(
                rows > 0.8 * f64::from(clipped as u32) && rows <= f64::from(clipped as u32),
                "{rows} {clipped}"
            );
        }
    }
}
