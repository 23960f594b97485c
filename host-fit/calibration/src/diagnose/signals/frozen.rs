//! Channels that repeat one value.

use super::channels::{Channel, LogSignals, spread};
use super::places::{Run, Told};
use super::still::{hall_motion_m, leave_out, stuck};
use crate::finding::Finding;
use crate::statistics::quantile;
use std::ops::Range;

/// Chance that noise repeats a code so often.
const CHANCE: f64 = 1e-9;
/// Fewest equal values in a row that are worth a word.
const RUN_MIN: usize = 50;
/// Codes that another gap moves by where one stands still.
const GAP_CODES: f64 = 20.0;
/// Rows of a stretch in which the liveliness of a channel is counted.
const STRETCH: usize = 250;
/// Residual that shows that a channel should have moved, m.
pub(super) const MISSED_M: f64 = 6e-6;

/// How often each channel may repeat a value, by its own noise; `None` where that is not looked at.
pub(super) fn most_repeats(log: &LogSignals, has_reference: bool) -> Vec<Option<f64>> {
    let lively = |values: &[f64]| {
        let changes = values.windows(2).filter(|pair| pair[0] != pair[1]).count();
        changes as f64 / (values.len() - 1) as f64
    };
    let most = |(index, channel): (usize, &Channel)| {
        let mut shares: Vec<f64> = (log.segments.iter())
            .flat_map(|segment| channel.values[segment.clone()].chunks_exact(STRETCH))
            .map(lively)
            .collect();
        if (3..6).contains(&index) && !has_reference {
            return None;
        }
        let share = quantile(&mut shares, 0.75)?;
        // At a share of one, a single repetition would be beyond chance.
        let chance = (CHANCE.ln() / (-share.min(0.9)).ln_1p()).max(RUN_MIN as f64);
        Some(match spread(&channel.values) {
            0.0 => RUN_MIN as f64,
            _ if share > 0.0 => chance,
            _ => f64::INFINITY,
        })
    };
    log.channels.iter().enumerate().map(most).collect()
}

/// Where channels repeat one value more often than `most` says; such rows are left out.
pub(super) fn frozen(log: &mut LogSignals, most: &[Option<f64>]) -> Vec<Run> {
    let mut runs: Vec<(usize, Range<usize>)> = Vec::new();
    for (index, channel) in log.channels.iter().enumerate() {
        let Some(Some(most)) = most.get(index) else {
            continue;
        };
        let all = log.segments.iter();
        let repeats = all.flat_map(|segment| repeats(&channel.values, segment, *most));
        let is_frozen = |run: &Range<usize>| log.usable[run.start] && others_move(log, index, run);
        runs.extend(repeats.filter(is_frozen).map(|run| (index, run)));
    }
    let still = |rows: &Range<usize>| {
        let mut channels = log.channels.iter();
        channels.all(|channel| spread(&channel.values[rows.clone()]) == 0.0)
    };
    let run = |(channel, rows): &(usize, Range<usize>)| Run {
        channel: *channel,
        first: log.at(rows.start),
        len: rows.len(),
        all_still: still(rows),
    };
    let found = runs.iter().map(run).collect();
    leave_out(log, runs.into_iter().map(|(_, run)| run));
    found
}

/// Where more than `most` values that follow each other are one. Looked for from the row backwards that
/// such a run must reach: most rows need not be looked at.
fn repeats(values: &[f64], segment: &Range<usize>, most: f64) -> Vec<Range<usize>> {
    let mut runs = Vec::new();
    let mut start = segment.start;
    let reach = |start: usize| start.checked_add(most as usize);
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

/// Whether others move while a channel does not: a beam or gap of coarse steps may well rest. A
/// probe may not, its noise is many codes.
fn others_move(log: &LogSignals, channel: usize, run: &Range<usize>) -> bool {
    let gap_moves = |other: usize| {
        let gap = &log.channels[other];
        other != channel && spread(&gap.values[run.clone()]) > GAP_CODES * gap.m_per_code
    };
    match channel {
        0..3 => true,
        3..6 => hall_motion_m(log, run) > MISSED_M,
        _ => (6..log.channels.len()).any(gap_moves),
    }
}

/// One finding for a channel, at its longest run; one for channels that stand still together.
pub(super) fn of_frozen(
    told: &Told,
    channels: &[Channel],
    runs: &[Run],
    period_s: f64,
) -> Vec<Finding> {
    let mut longest: Vec<(Vec<&'static str>, &Run, usize)> = Vec::new();
    for (index, channel) in channels.iter().enumerate() {
        let own = || runs.iter().filter(|run| run.channel == index);
        let rows = own().map(|run| run.len).sum();
        let Some(run) = own().max_by_key(|run| run.len) else {
            continue;
        };
        let together = |other: &Run| {
            let start = run.first.row.max(other.first.row);
            let shared = run.end().min(other.end()).saturating_sub(start);
            2 * shared > run.len.max(other.len)
        };
        match longest.iter_mut().find(|(_, other, _)| together(other)) {
            Some((names, ..)) => names.push(channel.name),
            None => longest.push((vec![channel.name], run, rows)),
        }
    }
    (longest.into_iter())
        .map(|(names, run, rows)| {
            let (who, channel) = match &names[..] {
                _ if run.all_still => ("every channel".to_owned(), None),
                [name] => ((*name).to_owned(), Some(*name)),
                names => (names.join(", "), None),
            };
            let stood_s = run.len as f64 * period_s;
            // Rows that repeat whole are true, if of no use.
            let share = match run.all_still {
                true => 0.0,
                false => rows as f64 / told.rows as f64,
            };
            stuck(told, &who, channel, &run.first, stood_s, share)
        })
        .collect()
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
}
