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
/// A jump from row to row that is clear in its channel, in standard deviations of such jumps.
const SEEN_MIN: f64 = 8.0;
/// Steps of a channel that are told one by one.
const SHOWN: usize = 3;

/// Names steps, the largest of each channel, and begins a segment at each.
pub(super) fn steps(log: &mut LogSignals, residuals: &Residuals) -> Vec<Finding> {
    let shifts: [Vec<f64>; 3] = std::array::from_fn(|k| shifts_m(log, &residuals.values[k]));
    let usual_m: [f64; 3] = std::array::from_fn(|k| {
        let white_m = residuals.noise_m[k] * (5.0 / PIECE as f64).sqrt();
        robust_deviation(shifts[k].iter().copied().filter(|shift| *shift != 0.0)).max(white_m)
    });
    let noise_m: Vec<f64> = (log.channels.iter())
        .map(|channel| {
            let of = |segment: &Range<usize>| {
                let segment = segment.clone();
                (segment.clone()).filter_map(move |row| jump_m(&channel.values, &segment, row))
            };
            robust_deviation(log.segments.iter().flat_map(of))
        })
        .collect();
    let deviations = |row: usize| {
        (0..3)
            .map(|k| shifts[k][row].abs() / usual_m[k])
            .fold(0.0, f64::max)
    };
    let mut steps: Vec<(usize, Blame)> = Vec::new();
    for segment in &log.segments {
        let mut open: Vec<Range<usize>> = vec![segment.clone()];
        while let Some(rows) = open.pop() {
            let peak = (rows.clone()).max_by(|a, b| deviations(*a).total_cmp(&deviations(*b)));
            let Some(peak) = peak.filter(|&row| deviations(row) > STEP_MIN) else {
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
                let jump = |row: usize| {
                    jump_m(&log.channels[channel].values, segment, row).unwrap_or(0.0)
                };
                let row = near
                    .clone()
                    .max_by(|a, b| jump(*a).abs().total_cmp(&jump(*b).abs()));
                let row = row.unwrap_or(peak);
                if jump(row).abs() < JUMP_MIN_M.max(SEEN_MIN * noise_m[channel]) {
                    continue;
                }
                let mut seen_m = vec![None; log.channels.len()];
                seen_m[channel] = Some(jump(row));
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
fn jump_m(values: &[f64], segment: &Range<usize>, row: usize) -> Option<f64> {
    if row < segment.start + 2 || row + 1 >= segment.end {
        return None;
    }
    let step = |row: usize| values[row] - values[row - 1];
    Some(step(row) - 0.5 * (step(row - 1) + step(row + 1)))
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
