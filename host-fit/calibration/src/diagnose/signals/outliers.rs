//! Outliers: single rows far from those before and behind.

use super::channels::{LogSignals, median};
use super::residual::{Residuals, is_seen};
use super::{BLOCK, CLEAR};
use crate::finding::{Code, Finding};
use crate::statistics::robust_deviation;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::ops::Range;

/// Names rows far outside the noise, by channel, and leaves them out.
pub(super) fn outliers(log: &mut LogSignals, residuals: &Residuals) -> Vec<Finding> {
    let rows = log
        .segments
        .iter()
        .flat_map(|s| s.clone().map(move |row| (s, row)));
    let rows: Vec<(&Range<usize>, usize)> = rows.filter(|(_, row)| log.usable[*row]).collect();
    // From the median of those about it: beside a step is no outlier.
    let off_m = |&(segment, row): &(&Range<usize>, usize)| {
        let about = row.saturating_sub(BLOCK).max(segment.start)..segment.end.min(row + BLOCK + 1);
        let about: Vec<usize> = about.filter(|&row| log.usable[row]).collect();
        let middle_m = |values: &Vec<f64>| median(about.iter().map(|&row| values[row]));
        (residuals.values.each_ref()).map(|values| values[row] - middle_m(values))
    };
    let off_m: Vec<[f64; 3]> = rows.par_iter().map(off_m).collect();
    let usual_m = [0, 1, 2].map(|k| robust_deviation(off_m.iter().map(|off_m| off_m[k])));
    let is_far = |off_m: &[f64; 3]| (0..3).any(|k| off_m[k].abs() > CLEAR * usual_m[k]);
    let far = rows
        .into_iter()
        .zip(off_m)
        .filter(|(_, off_m)| is_far(off_m));
    let far = far.map(|((segment, row), off_m)| (segment.clone(), row, off_m));
    let far: Vec<(Range<usize>, usize, [f64; 3])> = far.collect();
    far.iter().for_each(|(_, row, _)| log.usable[*row] = false);
    let mut by_channel: BTreeMap<usize, Vec<(usize, f64)>> = BTreeMap::new();
    for (segment, row, shown_m) in far {
        let mut rows = (segment.start..row).rev().filter(|&row| log.usable[row]);
        let before = rows.next();
        let behind = (row + 1..segment.end).find(|&row| log.usable[row]);
        let beside = [before.or(behind), behind.or(before)].map(|row| row.unwrap_or(0));
        // A channel that jumps by what the residuals ask of it, before any other.
        let worth = |(channel, [size_m, explained]): &(usize, [f64; 2])| {
            let values = &log.channels[*channel].values;
            let own_m = values[row] - 0.5 * (values[beside[0]] + values[beside[1]]);
            (f64::from(u8::from(is_seen(own_m, *size_m))) + 1e-9) * explained
        };
        let errors = residuals.errors(log, row, shown_m).into_iter().enumerate();
        if let Some((channel, [size_m, _])) = errors.max_by(|a, b| worth(a).total_cmp(&worth(b))) {
            by_channel
                .entry(channel)
                .or_default()
                .push((row, size_m.abs()));
        }
    }
    let finding = |(channel, outliers): (usize, Vec<(usize, f64)>)| {
        let (name, count) = (log.channels[channel].name, outliers.len());
        let message = format!(
            "{count} {} of {name} far outside the noise, by up to {:.1} um. A fit with --loss cauchy, the default, leaves them \
             out of account; look for lost pulses, sparks and bits",
            if count == 1 { "row" } else { "rows" },
            outliers
                .iter()
                .map(|(_, size_m)| *size_m)
                .fold(0.0, f64::max)
                * 1e6,
        );
        let found = log.warning_at(Code::Outliers, outliers[0].0, message);
        found.on(name).of(count as f64, "rows")
    };
    by_channel.into_iter().map(finding).collect()
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
