//! Flat tops: a converter or its amplifier at the end of its range.

use super::channels::{Channel, LogSignals};
use crate::diagnose::finding::{Code, Finding};
use std::ops::Range;

/// Equal codes in a row that noise does not give at an extreme.
const RUN_MIN: usize = 8;
/// Codes by which the signal changes beside a flat top, and within how many rows: a signal that
/// rests at its extreme is no flat top.
const EDGE_CODES: f64 = 10.0;
const EDGE_ROWS: usize = 10;

/// Names flat tops by channel and leaves their rows out.
pub(super) fn saturated(log: &mut LogSignals) -> Vec<Finding> {
    let mut findings = Vec::new();
    let mut left_out = Vec::new();
    for channel in log.channels.iter().filter(|c| c.m_per_code > 0.0) {
        let tops = flat_tops(log, channel);
        let rows: usize = tops.iter().map(Range::len).sum();
        let Some(longest) = tops.iter().max_by_key(|top| top.len()) else {
            continue;
        };
        let codes = channel.values[longest.start] / channel.m_per_code;
        let starts: Vec<usize> = tops.iter().map(|top| top.start).collect();
        let message = format!(
            "{} is flat at code {codes:.0} for {rows} rows, at most {} together ({}): its converter or amplifier is at the \
             end of its range; lower the gain or the motion, and leave these rows out",
            channel.name,
            longest.len(),
            log.places(&starts),
        );
        findings.push(Finding {
            channel: Some(channel.name.to_owned()),
            value: Some(rows as f64),
            unit: Some("rows"),
            ..log.warning_at(Code::Saturated, longest.start, message)
        });
        left_out.extend(tops);
    }
    for row in left_out.into_iter().flatten() {
        log.usable[row] = false;
    }
    findings
}

fn flat_tops(log: &LogSignals, channel: &Channel) -> Vec<Range<usize>> {
    let values = &channel.values;
    let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let low = values.iter().copied().fold(f64::INFINITY, f64::min);
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
    use crate::diagnose::finding::Code;
    use crate::diagnose::signals::sample::{only, recording};

    #[test]
    fn flat_tops_are_named_below_the_end_of_the_converter_too() {
        let mut recording = recording();
        let all = recording.movements.iter().flatten();
        let top = all.map(|sample| sample.hall[1]).max().unwrap_or(0) * 9 / 10;
        let mut clipped = 0;
        for sample in recording.movements.iter_mut().flatten() {
            clipped += usize::from(sample.hall[1] >= top);
            sample.hall[1] = sample.hall[1].min(top);
        }
        let found = only(&recording, Code::Saturated, Some("hall_b"));
        let told = found.value.expect("rows");
        assert!(
            told > 0.8 * clipped as f64 && told <= clipped as f64,
            "{told} {clipped}"
        );
    }
}
