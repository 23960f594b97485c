//! What stands still: movements in which nothing moves, and channels that repeat one value.

use super::BLOCK;
use super::channels::LogSignals;
use crate::diagnose::left_out;
use crate::finding::{Code, Finding, Severity};
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
        "nothing moves in {} of {} movements (the first: {}): they add nothing to the fit; leave them out or record them again",
        idle.len(),
        log.segments.len(),
        log.place(first),
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
        let seconds = log
            .segments
            .iter()
            .flat_map(|s| channel.values[s.clone()].windows(3));
        let seconds = seconds.map(|v| v[0] - 2.0 * v[1] + v[2]);
        let count = log.rows.len() as f64;
        let noise_m = (seconds.map(|x| x * x).sum::<f64>() / (6.0 * count)).sqrt();
        let chance = libm::erf(channel.m_per_code / (8f64.sqrt() * noise_m));
        let least = match spread(&channel.values) {
            0.0 => 2.0,
            _ => 1.0 + libm::log(RARITY * count) / libm::log(chance).abs(),
        };
        runs.retain(|run| run.len() as f64 >= least && should_move(log, k, run));
        all.push(runs);
    }
    named_stuck(log, all)
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
/// end of what the channel reads. What is stuck together is named once. The rows are left out.
pub(super) fn named_stuck(log: &mut LogSignals, runs: Vec<Vec<Range<usize>>>) -> Vec<Finding> {
    let mut found: Vec<(Vec<usize>, &Range<usize>, bool, usize)> = Vec::new();
    for (k, (channel, runs)) in log.channels.iter().zip(&runs).enumerate() {
        let Some(longest) = runs.iter().max_by_key(|run| run.len()) else {
            continue;
        };
        let rows = runs.iter().map(Range::len).sum();
        let values = &channel.values;
        let is_end = |end: fn(f64, f64) -> f64| {
            values.iter().copied().reduce(end) == Some(values[longest.start])
        };
        let is_top = channel.m_per_code > 0.0
            && spread(&values[longest.clone()]) == 0.0
            && is_end(f64::min) != is_end(f64::max);
        let middle = (longest.start + longest.end) / 2;
        let mut others = found
            .iter_mut()
            .filter(|(_, _, other, _)| !is_top && !other);
        match others.find(|(_, run, ..)| run.contains(&middle)) {
            Some((channels, ..)) => channels.push(k),
            None => found.push((vec![k], longest, is_top, rows)),
        }
    }
    let finding = |(channels, longest, is_top, rows): (Vec<usize>, &Range<usize>, bool, usize)| {
        let mut all = log.channels.iter();
        // Rows that repeat whole are true, if of no use.
        let is_whole = all.all(|channel| spread(&channel.values[longest.clone()]) == 0.0);
        let share = rows as f64 / log.rows.len() as f64;
        let severity = if is_whole {
            Severity::Warn
        } else {
            left_out::severity(share)
        };
        let names: Vec<&str> = channels.iter().map(|&k| log.channels[k].name).collect();
        let who = if is_whole {
            "every channel".to_owned()
        } else {
            names.join(", ")
        };
        let (place, percent) = (log.place(longest.start), 100.0 * share);
        let stood_s = longest.len() as f64 * log.period_s;
        let (code, size, what) = match is_top {
            true => {
                let channel = &log.channels[channels[0]];
                let code = channel.values[longest.start] / channel.m_per_code;
                let what = format!(
                    "is flat at code {code:.0} for {rows} rows, {percent:.1} % of the log, at most {} together ({place}): its \
                     converter or amplifier is at the end of its range; lower the gain or the motion",
                    longest.len()
                );
                (Code::Saturated, (rows as f64, "rows"), what)
            }
            false => {
                let what = format!(
                    "stood still for {stood_s:.2} s ({place}), in {percent:.1} % of the log in all, while it should have moved \
                     or shown its noise: look for a stage that stopped, a cable or a frozen register"
                );
                (Code::Stuck, (stood_s, "s"), what)
            }
        };
        let message = format!("{who} {what}, and leave these rows out");
        let found = log
            .warning_at(code, longest.start, message)
            .severe(severity);
        let found = found.of(size.0, size.1);
        match names[..] {
            [name] => found.on(name),
            _ => found,
        }
    };
    let findings = found.into_iter().map(finding).collect();
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
    use super::super::sample_for_tests::{ROWS, dataset, held, only, recording, warnings};
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
    fn a_logger_that_hangs_is_named_once() {
        let mut hung = recording();
        for channel in 0..9 {
            hung = held(&hung, channel, 0, 300..400, 0.0);
        }
        let found = &warnings(&dataset(&hung))[0];
        assert!(
            found
                .message
                .starts_with("every channel stood still for 0.20 s"),
            "{found:?}"
        );
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
