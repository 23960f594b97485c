//! Steps: residuals that shift and stay.

use super::blame::{Blame, blame};
use super::channels::{LogSignals, robust_deviation};
use super::outliers::JUMP_MIN_M;
use super::residual::Residuals;
use crate::diagnose::finding::{Code, Finding};
use std::ops::Range;

/// Rows in each of two pieces on each side of a step that tell its size, and how many at least.
const PIECE: usize = 13;
const PIECE_MIN: usize = 5;
const SIDE: usize = 2 * PIECE;
/// A shift of residuals that is a step, in standard deviations of such shifts.
const STEP_MIN: f64 = 7.5;
/// The same where a beam or gap jumps at that row.
const SEEN_STEP_MIN: f64 = 5.0;
/// A jump from row to row that is clear in its channel, in standard deviations of such jumps.
const SEEN_MIN: f64 = 8.0;
/// Steps less clear than this part of the clearest may be what that one bends.
const OF_CLEAREST: f64 = 0.25;
/// Steps of a channel that are told one by one.
const SHOWN: usize = 3;

/// Names the clearest steps, the largest of each channel, and begins a segment at each.
pub(super) fn steps(log: &mut LogSignals, residuals: &Residuals) -> Vec<Finding> {
    let shifts: [Vec<f64>; 3] = std::array::from_fn(|k| shifts_m(log, &residuals.values[k]));
    let usual_m: [f64; 3] = std::array::from_fn(|k| {
        let white_m = residuals.noise_m[k] * (5.0 / PIECE as f64).sqrt();
        robust_deviation(shifts[k].iter().copied().filter(|shift| *shift != 0.0)).max(white_m)
    });
    let signals: &LogSignals = log;
    let noise_m: Vec<f64> = (signals.channels.iter())
        .map(|channel| {
            let of = |segment: &Range<usize>| {
                let segment = segment.clone();
                (segment.clone().filter(|&row| signals.usable[row]))
                    .filter_map(move |row| jump_m(signals, &channel.values, &segment, row))
            };
            robust_deviation(signals.segments.iter().flat_map(of))
        })
        .collect();
    let jumps = |segment: &Range<usize>, row: usize, channel: usize| {
        let size_m = jump_m(log, &log.channels[channel].values, segment, row)?;
        (size_m.abs() > JUMP_MIN_M.max(SEEN_MIN * noise_m[channel])).then_some(size_m)
    };
    let clear = |segment: &Range<usize>, row: usize| {
        let deviations = (0..3).map(|k| shifts[k][row].abs() / usual_m[k]);
        let most = deviations.fold(0.0, f64::max);
        let seen = || (3..log.channels.len()).any(|channel| jumps(segment, row, channel).is_some());
        if most > SEEN_STEP_MIN && seen() {
            most / SEEN_STEP_MIN
        } else {
            most / STEP_MIN
        }
    };
    let all = log.segments.iter();
    let clearest = all.flat_map(|segment| segment.clone().map(|row| clear(segment, row)));
    let least = (OF_CLEAREST * clearest.fold(0.0, f64::max)).max(1.0);
    let mut steps: Vec<(usize, Blame)> = Vec::new();
    for segment in &log.segments {
        let mut open: Vec<Range<usize>> = vec![segment.clone()];
        while let Some(rows) = open.pop() {
            let clearest = (rows.clone().map(|row| (row, clear(segment, row))))
                .max_by(|a, b| a.1.total_cmp(&b.1));
            let Some((peak, _)) = clearest.filter(|(_, clear)| *clear > least) else {
                continue;
            };
            let near = peak.saturating_sub(SIDE).max(rows.start)..(peak + SIDE).min(rows.end);
            open.push(rows.start..near.start);
            open.push(near.end..rows.end);
            let shown = |row: usize| [0, 1, 2].map(|k| shifts[k][row]);
            let probes = vec![None; 3];
            let mut best = (
                peak,
                blame(
                    shown(peak),
                    usual_m,
                    &residuals.of_errors(log, peak),
                    &probes,
                ),
            );
            for channel in 3..log.channels.len() {
                let jump = |row| Some((row, jumps(segment, row, channel)?));
                let largest =
                    (near.clone().filter_map(jump)).max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()));
                let Some((row, size_m)) = largest else {
                    continue;
                };
                let mut seen_m = vec![None; log.channels.len()];
                seen_m[channel] = Some(size_m);
                let blamed = blame(shown(row), usual_m, &residuals.of_errors(log, row), &seen_m);
                if blamed.channel == channel && blamed.left < best.1.left {
                    best = (row, blamed);
                }
            }
            steps.push(best);
        }
    }
    let mut findings = Vec::new();
    for channel in 0..log.channels.len() {
        let mut own: Vec<&(usize, Blame)> =
            (steps.iter().filter(|(_, step)| step.channel == channel)).collect();
        own.sort_by(|a, b| b.1.size_m.abs().total_cmp(&a.1.size_m.abs()));
        let more = own.len().saturating_sub(SHOWN);
        for (row, step) in own.into_iter().take(SHOWN) {
            findings.push(finding(log, *row, step, more));
        }
    }
    steps.iter().for_each(|(row, _)| log.split_at(*row));
    findings
}

fn finding(log: &LogSignals, row: usize, step: &Blame, more: usize) -> Finding {
    let name = log.channels[step.channel].name;
    let more = if more > 0 {
        format!(" ({more} more)")
    } else {
        String::new()
    };
    let message = format!(
        "{name} steps by {:+.2} um ({}){more}: look for a fringe lost at speed, a loose probe or beam; record the movement \
         again or leave it out",
        step.size_m * 1e6,
        log.place(row),
    );
    Finding {
        channel: Some(name.to_owned()),
        value: Some(step.size_m * 1e6),
        unit: Some("um"),
        ..log.warning_at(Code::Step, row, message)
    }
}

/// By how much a channel jumps from the row before to a row, beyond its motion, m.
fn jump_m(log: &LogSignals, values: &[f64], segment: &Range<usize>, row: usize) -> Option<f64> {
    if row < segment.start + 2 || row + 1 >= segment.end {
        return None;
    }
    let time_s = |row: usize| (log.time_s[row] - log.time_s[row - 1]).max(1e-6);
    let step = |row: usize| values[row] - values[row - 1];
    let slope = |row: usize| step(row) / time_s(row);
    Some(step(row) - 0.5 * time_s(row) * (slope(row - 1) + slope(row + 1)))
}

/// By row, by how much the residuals of a probe shift there, m: the lines through the two pieces of
/// each side, drawn on to the row, so that what is smooth is no shift. 0 where rows are too few.
fn shifts_m(log: &LogSignals, values: &[f64]) -> Vec<f64> {
    let mut shifts = vec![0.0; log.len()];
    for segment in &log.segments {
        let rows: Vec<usize> = segment.clone().filter(|&row| log.usable[row]).collect();
        let mut sums = Vec::with_capacity(rows.len() + 1);
        sums.push(0.0);
        for &row in &rows {
            sums.push(sums[sums.len() - 1] + values[row]);
        }
        for (k, &row) in rows.iter().enumerate() {
            let [before, behind] = [k, rows.len() - k].map(|side| (side / 2).min(PIECE));
            if before.min(behind) >= PIECE_MIN {
                let mean = |from: usize, to: usize| (sums[to] - sums[from]) / (to - from) as f64;
                let far = [
                    mean(k - 2 * before, k - before),
                    mean(k + behind, k + 2 * behind),
                ];
                let near = [mean(k - before, k), mean(k, k + behind)];
                shifts[row] = 1.5 * (near[1] - near[0]) - 0.5 * (far[1] - far[0]);
            }
        }
    }
    shifts
}

#[cfg(test)]
mod tests {
    use crate::diagnose::finding::Code;
    use crate::diagnose::signals::sample::{codes, only, recording};

    #[test]
    fn a_step_is_named_with_its_channel_place_and_size() {
        let sound = recording();
        for (channel, name) in [(0, "hall_a"), (3, "ifm_x"), (4, "ifm_y1")] {
            for size_um in [-10_i32, 4] {
                let mut recording = sound.clone();
                for sample in &mut recording.movements[1][1200..] {
                    match channel {
                        0..3 => sample.hall[channel] += codes(f64::from(size_um) * 1e-6),
                        _ => sample.beams_nm[channel - 3] += i64::from(size_um) * 1000,
                    }
                }
                let found = only(&recording, Code::Step, Some(name));
                assert_eq!(found.movement.as_deref(), Some("1"));
                let off_us = found.t_us.expect("a time") - 2_400_000;
                assert!(off_us.abs() <= 10_000, "{off_us} us");
                let off_um = found.value.expect("a size") - f64::from(size_um);
                assert!(off_um.abs() < 1.0, "{off_um} um");
            }
        }
    }
}
