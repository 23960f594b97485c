//! Flat tops: a converter or its amplifier at the end of its range.

use super::channels::{Channel, LogSignals};
use super::places::{Place, Run, Told};
use crate::diagnose::finding::{Code, Finding};
use std::ops::Range;

/// Equal codes in a row that noise does not give at an extreme.
const RUN_MIN: usize = 8;
/// Codes by which the signal changes beside a flat top, and within how many rows: a signal that
/// rests at its extreme is no flat top.
const EDGE_CODES: f64 = 10.0;
const EDGE_ROWS: usize = 10;

/// Flat tops at the ends of the range of each channel, m; their rows are left out.
pub(super) fn flat_tops(log: &mut LogSignals, ranges: &[[f64; 2]]) -> Vec<Run> {
    let mut tops = Vec::new();
    let mut left_out = Vec::new();
    for ((index, channel), &range) in log.channels.iter().enumerate().zip(ranges) {
        if channel.m_per_code == 0.0 {
            continue;
        }
        let of_channel = of_channel(log, channel, range);
        tops.extend(of_channel.iter().map(|top| Run {
            channel: index,
            first: log.at(top.start),
            len: top.len(),
            value: channel.values[top.start],
            all_still: false,
        }));
        left_out.extend(of_channel);
    }
    for row in left_out.into_iter().flatten() {
        log.usable[row] = false;
    }
    tops
}

/// Names flat tops by channel.
pub(super) fn of_flat_tops(told: &Told, channels: &[Channel], tops: Vec<Run>) -> Vec<Finding> {
    let tops = Run::joined(tops);
    let of = |(index, channel): (usize, &Channel)| {
        let tops: Vec<&Run> = tops.iter().filter(|top| top.channel == index).collect();
        let rows: usize = tops.iter().map(|top| top.len).sum();
        let longest = tops.iter().max_by_key(|top| top.len)?;
        let codes = longest.value / channel.m_per_code;
        let starts: Vec<Place> = tops.iter().map(|top| top.first).collect();
        let message = format!(
            "{} is flat at code {codes:.0} for {rows} rows, at most {} together ({}): its converter or amplifier is at \
             the end of its range; lower the gain or the motion, and leave these rows out",
            channel.name,
            longest.len,
            told.places(&starts),
        );
        Some(Finding {
            channel: Some(channel.name.to_owned()),
            value: Some(rows as f64),
            unit: Some("rows"),
            ..told.warning_at(Code::Saturated, &longest.first, message)
        })
    };
    channels.iter().enumerate().filter_map(of).collect()
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
