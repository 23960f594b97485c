//! Flat tops: a converter or its amplifier at the end of its range.

use super::channels::{Channel, LogSignals};
use crate::diagnose::left_out;
use crate::finding::{Code, Finding};
use std::ops::Range;

/// Equal codes in a row that noise does not give at an extreme.
const RUN_MIN: usize = 8;
/// Codes by which the signal changes beside a flat top, and within how many rows: a signal that
/// rests at its extreme is no flat top.
const EDGE_CODES: f64 = 10.0;
const EDGE_ROWS: usize = 10;

/// Names flat tops at the ends of the range of each channel; their rows are left out.
pub(super) fn flat_tops(log: &mut LogSignals) -> Vec<Finding> {
    let mut findings = Vec::new();
    let mut left_out = Vec::new();
    for channel in log.channels.iter().filter(|c| c.m_per_code != 0.0) {
        let tops = of_channel(log, channel, range(&channel.values));
        findings.extend(of_tops(log, channel, &tops));
        left_out.extend(tops);
    }
    for row in left_out.into_iter().flatten() {
        log.usable[row] = false;
    }
    findings
}

fn of_tops(log: &LogSignals, channel: &Channel, tops: &[Range<usize>]) -> Option<Finding> {
    let rows: usize = tops.iter().map(Range::len).sum();
    let longest = tops.iter().max_by_key(|top| top.len())?;
    let codes = channel.values[longest.start] / channel.m_per_code;
    let starts: Vec<usize> = tops.iter().map(|top| top.start).collect();
    let message = format!(
        "{} is flat at code {codes:.0} for {rows} rows, at most {} together ({}): its converter or amplifier is at \
         the end of its range; lower the gain or the motion, and leave these rows out",
        channel.name,
        longest.len(),
        log.places(&starts),
    );
    let share = rows as f64 / log.len() as f64;
    Some(Finding {
        severity: left_out::severity(share),
        channel: Some(channel.name.to_owned()),
        value: Some(rows as f64),
        unit: Some("rows"),
        ..log.warning_at(Code::Saturated, longest.start, message)
    })
}

/// Lowest and highest value.
pub(super) fn range(values: &[f64]) -> [f64; 2] {
    values
        .iter()
        .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], &x| {
            [low.min(x), high.max(x)]
        })
}

fn of_channel(log: &LogSignals, channel: &Channel, [low, high]: [f64; 2]) -> Vec<Range<usize>> {
    let values = &channel.values;
    let mut tops = Vec::new();
    for segment in &log.segments {
        let mut row = segment.start;
        while row < segment.end {
            let start = row;
            let value = values[start];
            row += 1;
            if value != high && value != low {
                continue;
            }
            while row < segment.end && values[row] == value {
                row += 1;
            }
            let before = start.saturating_sub(EDGE_ROWS).max(segment.start);
            let after = (row - 1 + EDGE_ROWS).min(segment.end - 1);
            let edge = [before, after].map(|r| (values[r] - value).abs());
            let moves = edge[0].max(edge[1]) >= EDGE_CODES * channel.m_per_code;
            if row - start >= RUN_MIN && moves {
                tops.push(start..row);
            }
        }
    }
    tops
}

#[cfg(test)]
mod tests {
    use crate::diagnose::signals::sample_for_tests::{only, recording};
    use crate::finding::Code;
    use crate::finding::Severity;

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
            let told = found.value.expect("rows");
            assert!(
                told > 0.8 * clipped as f64 && told <= clipped as f64,
                "{told} {clipped}"
            );
        }
    }
}
