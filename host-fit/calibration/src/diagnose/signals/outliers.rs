//! Outliers: single rows far from the rows before and behind.

use super::BLOCK;
use super::channels::{LogSignals, median};
use super::residual::{Residuals, is_seen};
use crate::diagnose::limits::CLEAR;
use hallstage_input::channel::Channel;
use hallstage_input::finding::{Finding, Kind};
use hallstage_solver::statistics::robust_deviation;
use rayon::prelude::*;

/// Rows far outside the noise, by channel. They are left out.
pub(super) fn outliers(log: &mut LogSignals, residuals: &Residuals) -> Vec<Finding> {
    let rows: Vec<usize> = (0..log.rows.len()).filter(|&row| log.usable[row]).collect();
    // The distance from the median of the rows around it: a row beside a step is no outlier.
    let off_m = |&row: &usize| {
        let about = about(log, row, BLOCK);
        let middle_m = |values: &Vec<f64>| median(about.iter().map(|&row| values[row]));
        (residuals.values.each_ref()).map(|values| values[row] - middle_m(values))
    };
    let off_m: Vec<[f64; 3]> = rows.par_iter().map(off_m).collect();
    let most_m = [0, 1, 2].map(|k| CLEAR * robust_deviation(off_m.iter().map(|off_m| off_m[k])));
    let is_far = |(_, off_m): &(usize, [f64; 3])| (0..3).any(|k| off_m[k].abs() > most_m[k]);
    let far: Vec<(usize, [f64; 3])> = rows.into_iter().zip(off_m).filter(is_far).collect();
    far.iter().for_each(|(row, _)| log.usable[*row] = false);
    // Channel, row, size. A channel that itself jumps by the error that explains the residuals comes first.
    let cause = |&(row, shown_m): &(usize, [f64; 3])| {
        let beside = about(log, row, 1);
        let worth = |(channel, [size_m, explained]): &(usize, [f64; 2])| {
            let values = &log.channels[*channel];
            let sum = beside.iter().map(|&row| values[row]).sum::<f64>();
            let is_seen = is_seen(values[row] - sum / beside.len() as f64, *size_m);
            (f64::from(u8::from(is_seen)) + 1e-9) * explained
        };
        let errors = residuals.errors(log, row, shown_m).into_iter().enumerate();
        let (channel, [size_m, _]) = errors.max_by(|a, b| worth(a).total_cmp(&worth(b)))?;
        Some((channel, row, size_m.abs()))
    };
    let found: Vec<(usize, usize, f64)> = far.iter().filter_map(cause).collect();
    let finding = |channel: usize| {
        let own = || found.iter().filter(move |found| found.0 == channel);
        let first = own().next()?.1;
        let kind = Kind::OutlierRows {
            rows: own().count(),
            largest_um: 1e6 * own().map(|found| found.2).fold(0.0, f64::max),
        };
        Some(
            log.found_at(first, kind)
                .with_channel(Channel::SINGLE[channel]),
        )
    };
    (0..log.channels.len()).filter_map(finding).collect()
}

/// The usable rows of the same movement around a row.
fn about(log: &LogSignals, row: usize, reach: usize) -> Vec<usize> {
    let rows = row.saturating_sub(reach)..log.rows.len().min(row + reach + 1);
    let movement = |row: usize| log.rows[row].movement;
    rows.filter(|&other| log.usable[other] && movement(other) == movement(row))
        .collect()
}

#[cfg(test)]
mod tests {
    use crate::diagnose::signals::sample_for_tests::{codes, only, recording};
    use hallstage_input::channel::Channel;
    use hallstage_input::finding::Code;

    #[test]
    fn jumps_are_counted_and_the_channel_named_that_jumps() {
        let sound = recording();
        for (channel, name) in [
            (1, Channel::HallB),
            (3, Channel::BeamX),
            (5, Channel::BeamY2),
        ] {
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
            assert_eq!((found.value(), found.t_us()), (Some(10.0), Some(200_000)));
            assert_eq!(found.movement(), Some("0"));
        }
    }
}
