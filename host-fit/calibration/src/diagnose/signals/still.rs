//! Movements without motion, channels that repeat one value, and channels that show their noise alone.

use super::BLOCK;
use super::channels::{LogSignals, levels};
use crate::diagnose::limits::CLEAR;
use crate::diagnose::limits::severity_of_share;
use hallstage_input::channel::Channel;
use hallstage_input::finding::{Finding, Kind, Severity};
use std::ops::Range;

/// Motion below this is none, m: it is a few times the drift of the interferometers in a movement.
const STILL_M: f64 = 2e-6;
/// Rows beside a run that are left out, too.
const BESIDE: usize = 2;

/// Movements without motion. Their rows are left out. A log where nothing moves at all proves nothing and is refused.
pub(super) fn idle(log: &mut LogSignals) -> Option<Finding> {
    let is_idle = |rows: &&Range<usize>| {
        // In short pieces, because the interferometers of a stage at rest drift.
        let rests = |start: usize| {
            let piece = start..rows.end.min(start + BLOCK);
            (3..6).all(|beam| spread(&log.channels[beam][piece.clone()]) < STILL_M)
        };
        let mut pieces = (rows.start..rows.end).step_by(BLOCK);
        log.source.has_reference && motion_m(log, 0..3, rows) < STILL_M && pieces.all(rests)
    };
    let idle: Vec<Range<usize>> = log.segments.iter().filter(is_idle).cloned().collect();
    let first = idle.first()?.start;
    let kind = Kind::IdleMovements {
        movements: idle.len(),
        of: log.segments.len(),
    };
    let moves = idle.len() < log.segments.len();
    log.leave_out(idle, 0);
    let found = log.found_at(first, kind);
    Some(match moves {
        true => found,
        false => found.with_severity(Severity::Refuse),
    })
}

/// Channels that repeat a value for longer than noise does.
pub(super) fn repeats(log: &mut LogSignals) -> Vec<Finding> {
    let runs = |(channel, values): (usize, &Vec<f64>)| -> Vec<Range<usize>> {
        // The mean square: the median is zero for a channel that is refreshed every tenth row.
        let threes = log
            .segments
            .iter()
            .flat_map(|s| values[s.clone()].windows(3));
        let second = threes.map(|v| (v[0] - 2.0 * v[1]) + v[2]);
        let squares: f64 = second.map(|x| x * x).sum();
        let white_m = (squares / (6.0 * values.len() as f64)).sqrt();
        let code_m = log.columns[channel].map_or(0.0, |column| column.step_m);
        // The chance of the most likely code, and the length of a run that is as rare as a clear deviation.
        let chance = libm::erf(code_m / 8f64.sqrt() / white_m.max(code_m / 12f64.sqrt()));
        let least = match spread(values) {
            0.0 => 2.0,
            _ => 1.0 + 0.5 * CLEAR * CLEAR / libm::log(chance).abs(),
        };
        let mut end = 0;
        let runs = values.chunk_by(|a, b| a == b).map(|run| {
            end += run.len();
            end - run.len()..end
        });
        let is_long = |run: &Range<usize>| run.len() as f64 >= least && log.usable[run.start];
        runs.filter(|run| is_long(run) && should_move(log, channel, run))
            .collect()
    };
    let runs = log.channels.iter().enumerate().map(runs).collect();
    named(log, runs)
}

/// A channel that shows its noise alone in a log in which all others move.
pub(super) fn noise_alone(log: &mut LogSignals) -> Vec<Finding> {
    let moves = |channel: usize| {
        let noise_m = log.columns[channel].and_then(|column| column.white_noise_m);
        let still_m = STILL_M.max(CLEAR * noise_m.unwrap_or(0.0));
        let moved_m = |rows: &Range<usize>| motion_m(log, channel..channel + 1, rows);
        log.columns[channel].is_some() && log.segments.iter().any(|rows| moved_m(rows) > still_m)
    };
    let still: Vec<usize> = (0..9).filter(|&channel| !moves(channel)).collect();
    let all = |channel: usize| {
        let is_alone = still == [channel];
        is_alone.then_some(0..log.rows.len()).into_iter().collect()
    };
    let runs = (0..9).map(all).collect();
    named(log, runs)
}

/// Whether a channel should change in these rows. A probe always has noise of many codes. A beam moves where a probe
/// moves, a gap where another gap moves.
fn should_move(log: &LogSignals, channel: usize, rows: &Range<usize>) -> bool {
    match channel {
        0..3 => true,
        3..6 => log.source.has_reference && motion_m(log, 0..3, rows) > STILL_M,
        _ => motion_m(log, 6..9, rows) > STILL_M,
    }
}

/// The largest motion of some channels by the medians of blocks, m.
fn motion_m(log: &LogSignals, channels: Range<usize>, rows: &Range<usize>) -> f64 {
    let channels = log.channels[channels].iter();
    let moved = channels.map(|values| spread(&levels(&values[rows.clone()])));
    moved.fold(0.0, f64::max)
}

/// Findings for channels that stand still in runs of rows, at the longest run: as saturated where its value is the
/// largest or the smallest of the channel. The rows and those beside are left out.
fn named(log: &mut LogSignals, runs: Vec<Vec<Range<usize>>>) -> Vec<Finding> {
    let finding = |(channel, runs): (usize, &Vec<Range<usize>>)| {
        let longest = runs.iter().max_by_key(|run| run.len())?;
        let rows = runs.iter().map(Range::len).sum::<usize>();
        let share = rows as f64 / log.rows.len() as f64;
        let percent = 100.0 * share;
        let values = &log.channels[channel];
        let value = values[longest.start];
        let is_end = values.iter().all(|&x| x <= value) != values.iter().all(|&x| x >= value);
        let is_flat = channel / 3 != 1 && spread(&values[longest.clone()]) == 0.0;
        let longest_s = longest.len() as f64 * log.period_s;
        let kind = Kind::Stands {
            rows,
            percent,
            longest_s,
            is_end: is_flat && is_end,
        };
        let found = log
            .found_at(longest.start, kind)
            .with_channel(Channel::SINGLE[channel]);
        Some(found.with_severity(severity_of_share(share).max(Severity::Warn)))
    };
    let findings = runs.iter().enumerate().filter_map(finding).collect();
    log.leave_out(runs.into_iter().flatten(), BESIDE);
    findings
}

/// The largest value less the smallest.
fn spread(values: &[f64]) -> f64 {
    let end = |end: fn(f64, f64) -> f64| values.iter().copied().reduce(end).unwrap_or(0.0);
    end(f64::max) - end(f64::min)
}

#[cfg(test)]
mod tests {
    use super::super::sample_for_tests::{ROWS, held, only, recording};
    use hallstage_input::channel::Channel;
    use hallstage_input::finding::{Code, Severity};

    #[test]
    fn a_channel_that_repeats_its_code_is_stuck_and_one_that_does_so_in_a_tenth_refused() {
        for (channel, name) in [(2, Channel::HallC), (3, Channel::BeamX), (7, Channel::Gap2)] {
            for (rows, severity) in [(300, Severity::Warn), (600, Severity::Refuse)] {
                let frozen = held(&recording(), channel, 1, 500..500 + rows, 0.0);
                let found = only(&frozen, Code::Stuck, Some(name));
                assert_eq!(found.severity, severity, "{rows} of 6,000 rows");
                assert_eq!(
                    (found.movement(), found.t_us()),
                    (Some("1"), Some(1_000_000))
                );
            }
        }
    }

    #[test]
    fn a_channel_that_shows_its_noise_alone_is_stuck() {
        for (channel, name) in [(2, Channel::HallC), (3, Channel::BeamX), (7, Channel::Gap2)] {
            let still = (0..3).fold(recording(), |recording, movement| {
                held(&recording, channel, movement, 0..ROWS, 1.0)
            });
            let found = only(&still, Code::Stuck, Some(name));
            assert_eq!(found.severity, Severity::Refuse);
        }
    }

    #[test]
    fn a_probe_that_is_read_at_a_tenth_of_the_rate_is_stuck() {
        let mut slow = recording();
        for samples in &mut slow.movements {
            for ten in samples.chunks_mut(10) {
                let read = ten[0].hall[2];
                ten.iter_mut().for_each(|sample| sample.hall[2] = read);
            }
        }
        let found = only(&slow, Code::Stuck, Some(Channel::HallC));
        assert_eq!(found.severity, Severity::Refuse);
    }

    #[test]
    fn a_movement_in_which_nothing_moves_is_idle() {
        let mut idle = recording();
        for channel in 0..9 {
            idle = held(&idle, channel, 2, 0..ROWS, 1.0);
        }
        let found = only(&idle, Code::IdleMovement, None);
        assert_eq!(found.movement(), Some("2"));
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
            let found = only(&recording, Code::Saturated, Some(Channel::HallB));
            assert_eq!(found.severity, severity);
            let rows = found.value().expect("rows");
            assert!(
                rows > 0.8 * f64::from(clipped as u32) && rows <= f64::from(clipped as u32),
                "{rows} {clipped}"
            );
        }
    }
}
