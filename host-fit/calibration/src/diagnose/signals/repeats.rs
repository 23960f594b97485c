//! Channels that repeat one value: at the end of a converter's range, or of a register that froze.

use super::channels::{Channel, LogSignals, spread};
use super::still::{hall_motion_m, stuck};
use crate::diagnose::left_out;
use crate::finding::{Code, Finding};
use crate::statistics::quantile;
use std::ops::Range;

/// Equal codes in a row that noise does not give at an extreme.
const TOP_MIN: usize = 8;
/// Codes by which the signal changes beside a flat top, and within how many rows: a signal that
/// rests at its extreme is no flat top.
const EDGE_CODES: f64 = 10.0;
const EDGE_ROWS: usize = 10;
/// Chance that noise repeats a code as often as a frozen channel does.
const CHANCE: f64 = 1e-9;
/// Fewest equal values in a row that are worth a word.
const RUN_MIN: usize = 50;
/// Codes that another gap moves by where one stands still.
const GAP_CODES: f64 = 20.0;
/// Rows of a stretch in which the liveliness of a channel is counted.
const STRETCH: usize = 250;
/// Residual that shows that a channel should have moved, m.
pub(super) const MISSED_M: f64 = 6e-6;

/// Where at least so many values that follow each other are one. Looked for from the row backwards that
/// such a run must reach: most rows need not be looked at.
fn repeats(values: &[f64], segment: &Range<usize>, least: usize) -> Vec<Range<usize>> {
    let mut runs = Vec::new();
    let mut start = segment.start;
    let reach = |start: usize| start.checked_add(least - 1);
    while let Some(last) = reach(start).filter(|last| *last < segment.end) {
        let value = values[last];
        match (start..last).rev().find(|&row| values[row] != value) {
            Some(other) => start = other + 1,
            None => {
                let rest = values[last..segment.end].iter();
                let end = last + rest.take_while(|rest| **rest == value).count();
                runs.push(start..end);
                start = end;
            }
        }
    }
    runs
}

/// Names flat tops at the ends of the range of each channel; their rows are left out.
pub(super) fn flat_tops(log: &mut LogSignals) -> Vec<Finding> {
    let mut findings = Vec::new();
    let mut left_out = Vec::new();
    for channel in log.channels.iter().filter(|c| c.m_per_code != 0.0) {
        let values = &channel.values;
        let [low, high] =
            [f64::min, f64::max].map(|end| values.iter().copied().fold(f64::NAN, end));
        let mut tops = Vec::new();
        for segment in &log.segments {
            let is_top = |run: &Range<usize>| {
                let value = values[run.start];
                let before = run.start.saturating_sub(EDGE_ROWS).max(segment.start);
                let after = (run.end - 1 + EDGE_ROWS).min(segment.end - 1);
                let edge = [before, after].map(|row| (values[row] - value).abs());
                let moves = edge[0].max(edge[1]) >= EDGE_CODES * channel.m_per_code;
                (value == high || value == low) && moves
            };
            tops.extend(repeats(values, segment, TOP_MIN).into_iter().filter(is_top));
        }
        findings.extend(of_tops(log, channel, &tops));
        left_out.extend(tops);
    }
    left_out
        .into_iter()
        .for_each(|top| log.usable[top].fill(false));
    findings
}

fn of_tops(log: &LogSignals, channel: &Channel, tops: &[Range<usize>]) -> Option<Finding> {
    let rows: usize = tops.iter().map(Range::len).sum();
    let longest = tops.iter().max_by_key(|top| top.len())?;
    let starts: Vec<usize> = tops.iter().map(|top| top.start).collect();
    let message = format!(
        "{} is flat at code {:.0} for {rows} rows, at most {} together ({}): its converter or amplifier is at \
         the end of its range; lower the gain or the motion, and leave these rows out",
        channel.name,
        channel.values[longest.start] / channel.m_per_code,
        longest.len(),
        log.places(&starts),
    );
    let severity = left_out::severity(rows as f64 / log.len() as f64);
    let found = log.warning_at(Code::Saturated, longest.start, message);
    Some(
        found
            .severe(severity)
            .on(channel.name)
            .of(rows as f64, "rows"),
    )
}

/// From how many equal values on a channel is frozen, by its own noise.
fn frozen_from(log: &LogSignals, channel: &Channel) -> Option<usize> {
    let lively = |values: &[f64]| {
        let changes = values.windows(2).filter(|pair| pair[0] != pair[1]).count();
        changes as f64 / (values.len() - 1) as f64
    };
    let stretches = log.segments.iter();
    let stretches = stretches.flat_map(|s| channel.values[s.clone()].chunks_exact(STRETCH));
    let share = quantile(&mut stretches.map(lively).collect::<Vec<_>>(), 0.75)?;
    // At a share of one, a single repetition would be beyond chance.
    let chance = (CHANCE.ln() / (-share.min(0.9)).ln_1p()) as usize;
    match spread(&channel.values) {
        0.0 => Some(1 + RUN_MIN),
        _ => (share > 0.0).then_some(1 + chance.max(RUN_MIN)),
    }
}

/// Names channels that repeat one value, at their longest run, and channels that stand still together
/// once; their rows are left out.
pub(super) fn frozen(log: &mut LogSignals, has_reference: bool) -> Vec<Finding> {
    let mut runs = Vec::new();
    // By finding: the channels, the longest run, and the rows of all runs.
    let mut found: Vec<(Vec<&'static str>, Range<usize>, usize)> = Vec::new();
    for (index, channel) in log.channels.iter().enumerate() {
        if (3..6).contains(&index) && !has_reference {
            continue;
        }
        let Some(least) = frozen_from(log, channel) else {
            continue;
        };
        let all = log.segments.iter();
        let own = all.flat_map(|segment| repeats(&channel.values, segment, least));
        let is_frozen = |run: &Range<usize>| log.usable[run.start] && others_move(log, index, run);
        let own: Vec<Range<usize>> = own.filter(is_frozen).collect();
        let rows = own.iter().map(Range::len).sum();
        let Some(run) = own.iter().max_by_key(|run| run.len()).cloned() else {
            continue;
        };
        let together = |other: &Range<usize>| {
            let shared = run
                .end
                .min(other.end)
                .saturating_sub(run.start.max(other.start));
            2 * shared > run.len().max(other.len())
        };
        match found.iter_mut().find(|(_, other, _)| together(other)) {
            Some((names, ..)) => names.push(channel.name),
            None => found.push((vec![channel.name], run, rows)),
        }
        runs.extend(own);
    }
    let finding = |(names, run, rows): (Vec<&str>, Range<usize>, usize)| {
        let mut channels = log.channels.iter();
        let share = rows as f64 / log.len() as f64;
        // Rows that repeat whole are true, if of no use.
        if channels.all(|channel| spread(&channel.values[run.clone()]) == 0.0) {
            return stuck(log, "every channel", &run, 0.0);
        }
        let found = stuck(log, &names.join(", "), &run, share);
        match names[..] {
            [name] => found.on(name),
            _ => found,
        }
    };
    let findings = found.into_iter().map(finding).collect();
    log.leave_out(runs);
    findings
}

/// Whether others move while a channel does not: a beam or gap of coarse steps may well rest. A
/// probe may not, its noise is many codes.
fn others_move(log: &LogSignals, channel: usize, run: &Range<usize>) -> bool {
    let moves = |gap: &Channel| spread(&gap.values[run.clone()]) > GAP_CODES * gap.m_per_code;
    match channel {
        0..3 => true,
        3..6 => hall_motion_m(log, run) > MISSED_M,
        _ => log.channels[6..].iter().any(moves),
    }
}

#[cfg(test)]
mod tests {
    use super::super::sample_for_tests::{dataset, only, recording, warnings};
    use crate::finding::{Code, Severity};
    use crate::simulate::random::{Purpose, Stream};

    #[test]
    fn a_channel_that_stands_still_is_stuck_with_its_noise_or_without() {
        let sound = recording();
        let mut random = Stream::new(7, Purpose::Sensors, 0);
        for (noise, rows) in [(0.0, 700..1400), (1.0, 0..1000)] {
            let mut probe = sound.clone();
            let held = probe.movements[1][rows.start].hall[2];
            for sample in &mut probe.movements[1][rows.clone()] {
                sample.hall[2] = held + random.normal(8.0 * noise).round() as i32;
            }
            let mut beam = sound.clone();
            let held = beam.movements[1][rows.start].beams_nm[0];
            for sample in &mut beam.movements[1][rows.clone()] {
                sample.beams_nm[0] = held + random.normal(5.0 * noise).round() as i64;
            }
            for (recording, name) in [(probe, "hall_c"), (beam, "ifm_x")] {
                let found = only(&recording, Code::Stuck, Some(name));
                assert_eq!(found.movement.as_deref(), Some("1"));
                assert_eq!(found.t_us, Some(2000 * rows.start as i64));
            }
        }
    }

    #[test]
    fn a_gap_that_repeats_its_code_while_the_heights_change_is_stuck() {
        let mut recording = recording();
        let held = recording.movements[0][500].capacitive[1];
        for sample in &mut recording.movements[0][500..1500] {
            sample.capacitive[1] = held;
        }
        let found = warnings(&dataset(&recording));
        let stuck = found.iter().find(|finding| finding.code == Code::Stuck);
        assert_eq!(
            stuck.and_then(|finding| finding.channel.as_deref()),
            Some("cap_2")
        );
    }
    #[test]
    fn a_channel_that_repeats_its_code_in_a_tenth_of_the_log_is_refused() {
        for (rows, severity) in [(300, Severity::Warn), (600, Severity::Refuse)] {
            let mut recording = recording();
            let held = recording.movements[0][500].capacitive[1];
            for sample in &mut recording.movements[0][500..500 + rows] {
                sample.capacitive[1] = held;
            }
            let found = only(&recording, Code::Stuck, Some("cap_2"));
            assert_eq!(found.severity, severity, "{rows} of 6,000 rows");
        }
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
                rows > 0.8 * clipped as f64 && rows <= clipped as f64,
                "{rows} {clipped}"
            );
        }
    }
}
