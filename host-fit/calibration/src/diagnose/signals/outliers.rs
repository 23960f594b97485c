//! Outliers: single rows far from those before and behind.

use super::channels::{LogSignals, robust_deviation};
use super::residual::{Error, Residuals, blamed};
use crate::finding::{Code, Finding};
use crate::statistics;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::ops::Range;

/// Deviation of an outlier, in standard deviations of such deviations. The largest of a million
/// rows of noise is at 5.
const OUTLIER_MIN: f64 = 7.0;
/// Rows on each side that show where a row should be.
const SIDE: usize = 12;

/// Names rows far outside the noise, by channel, and leaves them out.
pub(super) fn outliers(log: &mut LogSignals, residuals: &Residuals) -> Vec<Finding> {
    let all: Vec<(&Range<usize>, usize)> = rows(log).collect();
    let off = |&(segment, row): &(&Range<usize>, usize)| {
        [0, 1, 2].map(|k| off_m(log, &residuals.values[k], segment, row))
    };
    let off_m: Vec<[f64; 3]> = all.par_iter().map(off).collect();
    let usual_m = [0, 1, 2].map(|k| {
        let usual_m = robust_deviation(off_m.iter().map(|off_m| off_m[k]));
        usual_m.max(residuals.noise_m[k])
    });
    let is_far = |off_m: &[f64; 3]| (0..3).any(|k| off_m[k].abs() > OUTLIER_MIN * usual_m[k]);
    let found = all
        .into_iter()
        .zip(off_m)
        .filter(|(_, off_m)| is_far(off_m));
    let found: Vec<_> = found
        .map(|((s, row), off_m)| (s.clone(), row, off_m))
        .collect();
    for (_, row, _) in &found {
        log.usable[*row] = false;
    }
    let mut by_channel: BTreeMap<&'static str, Vec<(usize, Error)>> = BTreeMap::new();
    for (segment, row, shown_m) in found {
        let seen_m = |k: usize| off_line_m(log, &log.channels[k].values, &segment, row);
        let error = blamed(&residuals.errors(log, row, shown_m), seen_m).unwrap_or_default();
        let name = log.channels[error.channel].name;
        by_channel.entry(name).or_default().push((row, error));
    }
    let of_channel = |(name, rows): (&'static str, Vec<_>)| finding(log, name, &rows);
    by_channel.into_iter().map(of_channel).collect()
}

fn finding(log: &LogSignals, name: &str, outliers: &[(usize, Error)]) -> Finding {
    let sizes_m = outliers.iter().map(|(_, error)| error.size_m.abs());
    let rows: Vec<usize> = outliers.iter().map(|(row, _)| *row).collect();
    let count = rows.len();
    let message = format!(
        "{count} {} of {name} far outside the noise, by up to {:.1} um: {}. A fit with --loss cauchy, the default, leaves \
         them out of account; look for lost pulses, sparks and bits",
        if count == 1 { "row" } else { "rows" },
        sizes_m.fold(0.0, f64::max) * 1e6,
        log.places(&rows),
    );
    let found = log.warning_at(Code::Outliers, rows[0], message);
    found.on(name).of(count as f64, "rows")
}

/// The usable rows, each with its movement.
fn rows<'s>(log: &'s LogSignals) -> impl Iterator<Item = (&'s Range<usize>, usize)> {
    let of = |segment: &'s Range<usize>| segment.clone().map(move |row| (segment, row));
    (log.segments.iter().flat_map(of)).filter(|(_, row)| log.usable[*row])
}

/// How far a row is from the median of those before it, or from that of those behind it, whichever is
/// nearer: beside a step, or on the way from one level to another, is no outlier.
fn off_m(log: &LogSignals, values: &[f64], segment: &Range<usize>, row: usize) -> f64 {
    let off = |rows: Range<usize>| {
        let used = rows.filter(|&row| log.usable[row]);
        Some(
            values[row] - statistics::median(&mut used.map(|row| values[row]).collect::<Vec<_>>())?,
        )
    };
    let before = off(row.saturating_sub(SIDE).max(segment.start)..row);
    let behind = off(row + 1..(row + 1 + SIDE).min(segment.end));
    match (before, behind) {
        (Some(before), Some(behind)) if before * behind < 0.0 => 0.0,
        (Some(before), Some(behind)) if before.abs() > behind.abs() => behind,
        (before, behind) => before.or(behind).unwrap_or(0.0),
    }
}

/// How far a row is off the line through the used rows beside it, m.
fn off_line_m(log: &LogSignals, values: &[f64], segment: &Range<usize>, row: usize) -> f64 {
    let before = (segment.start..row).rev().find(|&row| log.usable[row]);
    let behind = (row + 1..segment.end).find(|&row| log.usable[row]);
    let (before, behind) = (
        before.or(behind).unwrap_or(row),
        behind.or(before).unwrap_or(row),
    );
    let share = row.abs_diff(before) as f64 / before.abs_diff(behind).max(1) as f64;
    values[row] - values[before] - share * (values[behind] - values[before])
}

#[cfg(test)]
mod tests {
    use crate::diagnose::signals::sample_for_tests::{codes, only, recording};
    use crate::finding::Code;

    #[test]
    fn jumps_are_counted_and_the_channel_named_that_jumps() {
        let sound = recording();
        for (channel, name) in [(1, "hall_b"), (3, "ifm_x"), (5, "ifm_y2")] {
            let mut recording = sound.clone();
            for k in 0..10 {
                let sample = &mut recording.movements[k % 3][100 + 171 * k];
                let sign = if k % 2 == 0 { 1 } else { -1 };
                match channel {
                    0..3 => sample.hall[channel] += sign * codes(50e-6),
                    _ => sample.beams_nm[channel - 3] += i64::from(sign) * 50_000,
                }
            }
            let found = only(&recording, Code::Outliers, Some(name));
            assert_eq!((found.value, found.t_us), (Some(10.0), Some(200_000)));
            assert_eq!(found.movement.as_deref(), Some("0"));
        }
    }
}
