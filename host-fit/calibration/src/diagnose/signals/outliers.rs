//! Outliers: single rows far from those before and behind.

use super::blame::blame;
use super::channels::{LogSignals, median, robust_deviation};
use super::residual::Residuals;
use crate::finding::{Code, Finding};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::ops::Range;

/// Deviation of an outlier, in standard deviations of such deviations. The largest of a million
/// rows of noise is at 5.
const OUTLIER_MIN: f64 = 7.0;
/// Rows on each side that tell where a row should be.
const SIDE: usize = 12;
/// How far a beam or gap is off its neighbours where that is clear, in standard deviations.
const SEEN_MIN: f64 = 6.0;
/// Least jump of a beam or gap that is one, m.
pub(super) const JUMP_MIN_M: f64 = 0.1e-6;

/// Names rows far outside the noise, by channel, and leaves them out.
pub(super) fn outliers(log: &mut LogSignals, residuals: &Residuals) -> Vec<Finding> {
    let signals: &LogSignals = log;
    let usual_m = (residuals.values.par_iter().zip(residuals.noise_m)).map(|(values, noise_m)| {
        let off = |(segment, row)| off_sides_m(signals, values, segment, row);
        let sample = rows(signals).step_by(7).filter_map(off);
        robust_deviation(sample).max(noise_m)
    });
    let usual_m: Vec<f64> = usual_m.collect();
    let usual_m = [0, 1, 2].map(|k| usual_m[k]);
    let mut found: Vec<(usize, [f64; 3])> = Vec::new();
    for (segment, row) in rows(log) {
        // Cheap first: most rows are near their neighbours.
        let ends = [
            row.saturating_sub(3).max(segment.start),
            (row + 3).min(segment.end - 1),
        ];
        let far = (0..3).any(|k| {
            let values = &residuals.values[k];
            let limit_m = 0.5 * OUTLIER_MIN * usual_m[k];
            ends.iter()
                .any(|&end| (values[row] - values[end]).abs() > limit_m)
        });
        if !far {
            continue;
        }
        let off_m =
            [0, 1, 2].map(|k| off_sides_m(log, &residuals.values[k], segment, row).unwrap_or(0.0));
        if (0..3).any(|k| off_m[k].abs() > OUTLIER_MIN * usual_m[k]) {
            found.push((row, off_m));
        }
    }
    if found.is_empty() {
        return Vec::new();
    }
    for (row, _) in &found {
        log.usable[*row] = false;
    }
    let noise_m: Vec<f64> = (log.channels.iter())
        .map(|channel| {
            let off = |(segment, row)| off_neighbours_m(log, &channel.values, segment, row);
            robust_deviation(rows(log).step_by(7).filter_map(off))
        })
        .collect();
    let mut by_channel: BTreeMap<&'static str, Vec<(usize, f64)>> = BTreeMap::new();
    for (row, off_m) in found {
        let Some(segment) = log.segments.iter().find(|segment| segment.contains(&row)) else {
            continue;
        };
        let seen_m: Vec<Option<f64>> = (log.channels.iter().zip(&noise_m))
            .map(|(channel, noise_m)| {
                let off_m = off_neighbours_m(log, &channel.values, segment, row)?;
                (off_m.abs() > JUMP_MIN_M.max(SEEN_MIN * noise_m)).then_some(off_m)
            })
            .collect();
        let blamed = blame(off_m, usual_m, &residuals.of_errors(log, row), &seen_m);
        let name = log.channels[blamed.channel].name;
        by_channel
            .entry(name)
            .or_default()
            .push((row, blamed.size_m));
    }
    by_channel
        .into_iter()
        .map(|(name, rows)| finding(log, name, &rows))
        .collect()
}

fn finding(log: &LogSignals, name: &str, outliers: &[(usize, f64)]) -> Finding {
    let largest_m = (outliers.iter()).fold(0.0, |most: f64, (_, size_m)| most.max(size_m.abs()));
    let rows: Vec<usize> = outliers.iter().map(|(row, _)| *row).collect();
    let message = format!(
        "{} of {name} far outside the noise, by up to {:.1} um: {}. A fit with --loss cauchy, the default, leaves \
         them out of account; look for lost pulses, sparks and bits",
        if rows.len() == 1 {
            "1 row".to_owned()
        } else {
            format!("{} rows", rows.len())
        },
        largest_m * 1e6,
        log.places(&rows),
    );
    Finding {
        channel: Some(name.to_owned()),
        value: Some(rows.len() as f64),
        unit: Some("rows"),
        ..log.warning_at(Code::Outliers, rows[0], message)
    }
}

/// The usable rows, each with its segment.
fn rows<'s>(log: &'s LogSignals) -> impl Iterator<Item = (&'s Range<usize>, usize)> {
    let of = |segment: &'s Range<usize>| segment.clone().map(move |row| (segment, row));
    (log.segments.iter().flat_map(of)).filter(|(_, row)| log.usable[*row])
}

/// How far a row is from the median of the rows before it, or from that of the rows behind it,
/// whichever is nearer: a row beside a step is no outlier.
fn off_sides_m(
    log: &LogSignals,
    values: &[f64],
    segment: &Range<usize>,
    row: usize,
) -> Option<f64> {
    let off = |rows: Range<usize>| {
        let mut side: Vec<f64> = (rows.filter(|&r| log.usable[r]))
            .map(|r| values[r])
            .collect();
        (side.len() >= SIDE / 2).then(|| values[row] - median(&mut side))
    };
    let before = off(row.saturating_sub(SIDE).max(segment.start)..row);
    let behind = off(row + 1..(row + 1 + SIDE).min(segment.end));
    match (before, behind) {
        // On the way from one to the other.
        (Some(before), Some(behind)) if before * behind < 0.0 => Some(0.0),
        (Some(before), Some(behind)) if before.abs() > behind.abs() => Some(behind),
        (before, behind) => before.or(behind),
    }
}

/// How far a row is off the line through its usable neighbours, m.
fn off_neighbours_m(
    log: &LogSignals,
    values: &[f64],
    segment: &Range<usize>,
    row: usize,
) -> Option<f64> {
    let before = (segment.start..row).rev().find(|&r| log.usable[r]);
    let behind = (row + 1..segment.end).find(|&r| log.usable[r]);
    match (before, behind) {
        (Some(before), Some(behind)) => {
            let [t0, t, t1] = [before, row, behind].map(|row| log.time_s[row]);
            let share = (t - t0) / (t1 - t0).max(1e-6);
            Some(values[row] - values[before] - share * (values[behind] - values[before]))
        }
        (Some(one), None) | (None, Some(one)) => Some(values[row] - values[one]),
        (None, None) => None,
    }
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
