//! Jumps: single rows far outside the noise, and steps that stay.

use super::channels::{LogSignals, median, robust_deviation};
use super::residual::Residuals;
use crate::diagnose::finding::{Code, Finding};
use std::collections::BTreeMap;
use std::ops::Range;

/// Deviation of an outlier from the rows around it, in standard deviations of the noise. The
/// largest of a million rows of noise is at 5.
const OUTLIER_MIN: f64 = 7.0;
/// Rows on each side of a row that tell where it should be, and of a step.
const SIDE: usize = 25;
/// A step in the means of residuals, in standard deviations of such differences.
const STEP_MIN: f64 = 8.0;
/// A jump of one channel from row to row, in standard deviations of its differences.
const JUMP_MIN: f64 = 8.0;
/// Smallest jump of a beam that is looked at, m.
const BEAM_JUMP_MIN_M: f64 = 0.3e-6;
/// Steps of a channel that are told one by one.
const SHOWN: usize = 3;

/// By how much a channel jumps from the row before to a row, beyond its motion: m.
fn jump_m(values: &[f64], segment: &Range<usize>, row: usize) -> f64 {
    if row < segment.start + 2 || row + 1 >= segment.end {
        return 0.0;
    }
    let step = |row: usize| values[row] - values[row - 1];
    step(row) - 0.5 * (step(row - 1) + step(row + 1))
}

/// Standard deviations of the jumps of the channels, m.
fn jump_noise_m(log: &LogSignals) -> Vec<f64> {
    let noise = |values: &[f64]| {
        let rows = log
            .segments
            .iter()
            .flat_map(|s| s.clone().map(move |row| (s, row)));
        robust_deviation(rows.map(|(segment, row)| jump_m(values, segment, row))).max(1e-9)
    };
    log.channels
        .iter()
        .map(|channel| noise(&channel.values))
        .collect()
}

/// The channel that jumps most within some rows, where, and by how much, m.
fn jumping(
    log: &LogSignals,
    noise_m: &[f64],
    segment: &Range<usize>,
    rows: Range<usize>,
) -> Option<(usize, usize, f64)> {
    let mut most = None;
    let mut most_deviations = JUMP_MIN;
    for row in rows.start.max(segment.start)..rows.end.min(segment.end) {
        for (channel, noise_m) in noise_m.iter().enumerate() {
            let jump_m = jump_m(&log.channels[channel].values, segment, row);
            // A beam is so quiet that a jolt of the stage would count.
            let least_m = if (3..6).contains(&channel) {
                BEAM_JUMP_MIN_M
            } else {
                0.0
            };
            if jump_m.abs() > least_m && jump_m.abs() / noise_m > most_deviations {
                most_deviations = jump_m.abs() / noise_m;
                most = Some((channel, row, jump_m));
            }
        }
    }
    most
}

/// How far a row is from the mean of its neighbours, m.
fn off_neighbours_m(values: &[f64], row: usize) -> f64 {
    let around = [row.saturating_sub(1), (row + 1).min(values.len() - 1)];
    (values[row] - 0.5 * (values[around[0]] + values[around[1]])).abs()
}

/// Names rows far outside the noise, by channel, and leaves them out.
pub(super) fn outliers(log: &mut LogSignals, residuals: &Residuals) -> Vec<Finding> {
    // By row: the residual farthest off, m.
    let mut found: BTreeMap<usize, (f64, usize)> = BTreeMap::new();
    for (probe, values) in residuals.values.iter().enumerate() {
        let limit_m = OUTLIER_MIN * residuals.noise_m[probe].max(1e-9);
        for segment in &log.segments {
            for row in segment.clone().filter(|&row| log.usable[row]) {
                let rows =
                    row.saturating_sub(SIDE).max(segment.start)..(row + SIDE + 1).min(segment.end);
                // Cheap first: most rows are near the mean of their neighbours.
                let near = [rows.start, rows.end - 1].map(|r| (values[row] - values[r]).abs());
                if near[0].max(near[1]) < limit_m / 2.0 {
                    continue;
                }
                let used = rows.filter(|&r| log.usable[r]);
                let off_m = values[row] - median(&mut used.map(|r| values[r]).collect::<Vec<_>>());
                let before = found.get(&row).map_or(0.0, |(off_m, _)| *off_m);
                if off_m.abs() > limit_m.max(before) {
                    found.insert(row, (off_m.abs(), probe));
                }
            }
        }
    }
    let noise_m = jump_noise_m(log);
    let mut by_channel: BTreeMap<&'static str, Vec<(usize, f64)>> = BTreeMap::new();
    for (&row, &(off_m, probe)) in &found {
        let segment = log.segments.iter().find(|s| s.contains(&row));
        let jump = segment.and_then(|segment| jumping(log, &noise_m, segment, row..row + 2));
        let (channel, size_m) = match jump {
            Some((channel, ..)) if channel >= 3 => (
                channel,
                off_neighbours_m(&log.channels[channel].values, row),
            ),
            _ => (probe, off_m),
        };
        let rows = by_channel.entry(log.channels[channel].name).or_default();
        rows.push((row, size_m));
    }
    let mut findings = Vec::new();
    for (name, outliers) in by_channel {
        let largest = outliers.iter().max_by(|a, b| a.1.total_cmp(&b.1));
        let &(worst, size_m) = largest.unwrap_or(&(0, 0.0));
        let rows: Vec<usize> = outliers.iter().map(|(row, _)| *row).collect();
        let message = format!(
            "{} rows of {name} are far outside the noise, by up to {:.1} um: {}. Take them out of the log, or fit without them",
            rows.len(),
            size_m * 1e6,
            log.places(&rows),
        );
        findings.push(Finding {
            channel: Some(name.to_owned()),
            value: Some(size_m * 1e6),
            unit: Some("um"),
            ..log.warning_at(Code::Outliers, worst, message)
        });
    }
    for row in found.into_keys() {
        log.usable[row] = false;
    }
    findings
}

/// Means of the residuals of a probe after a row less those before, m; `None` where rows are few.
fn shift_m(log: &LogSignals, values: &[f64], segment: &Range<usize>, row: usize) -> Option<f64> {
    if row < segment.start + SIDE || row + SIDE > segment.end {
        return None;
    }
    let mean = |rows: Range<usize>| {
        let (mut sum, mut count) = (0.0, 0.0);
        for row in rows.filter(|&row| log.usable[row]) {
            sum += values[row];
            count += 1.0;
        }
        (count > 0.5 * SIDE as f64).then(|| sum / count)
    };
    Some(mean(row..row + SIDE)? - mean(row - SIDE..row)?)
}

/// A step: channel, row, size in m.
type Step = (usize, usize, f64);

/// Names steps, the largest of each channel, and begins a segment at each.
pub(super) fn steps(log: &mut LogSignals, residuals: &Residuals) -> Vec<Finding> {
    let shifts: [Vec<f64>; 3] = std::array::from_fn(|probe| {
        let values = &residuals.values[probe];
        let mut shifts = vec![0.0; log.len()];
        for segment in &log.segments {
            for row in segment.clone() {
                shifts[row] = shift_m(log, values, segment, row).unwrap_or(0.0);
            }
        }
        shifts
    });
    let usual_m: [f64; 3] = std::array::from_fn(|probe| {
        let white_m = residuals.noise_m[probe] * (2.0 / SIDE as f64).sqrt();
        robust_deviation(shifts[probe].iter().copied().filter(|s| *s != 0.0)).max(white_m)
    });
    let noise_m = jump_noise_m(log);
    let mut steps: Vec<Step> = Vec::new();
    for segment in &log.segments {
        let mut row = segment.start;
        while row < segment.end {
            let deviations = |row: usize| {
                (0..3)
                    .map(|i| shifts[i][row].abs() / usual_m[i])
                    .fold(0.0, f64::max)
            };
            if deviations(row) < STEP_MIN / 2.0 {
                row += 1;
                continue;
            }
            let end = (row + 2 * SIDE).min(segment.end);
            let peak = (row..end).max_by(|a, b| deviations(*a).total_cmp(&deviations(*b)));
            let peak = peak.unwrap_or(row);
            let near = peak.saturating_sub(SIDE)..peak + SIDE;
            let step = jumping(log, &noise_m, segment, near)
                .filter(|&(channel, at, size_m)| {
                    (0..3).all(|i| {
                        let implied_m = residuals.slope(i, channel) * size_m;
                        let off_m = (shifts[i][at] - implied_m).abs();
                        off_m
                            < (4.0 * usual_m[i]).max(0.4 * implied_m.abs()).max(
                                if channel < 3 && i == channel {
                                    4.0 * noise_m[channel]
                                } else {
                                    0.0
                                },
                            )
                    }) && deviations(at) > STEP_MIN / 2.0
                })
                .or_else(|| small_step(residuals, log, &shifts, &usual_m, segment, peak));
            if let Some((channel, at, size_m)) = step {
                // The mean of rows tells more than one row of a noisy probe.
                let size_m = if channel < 3 {
                    shifts[channel][at]
                } else {
                    size_m
                };
                steps.push((channel, at, size_m));
            }
            row = peak + SIDE;
        }
    }
    let mut findings = Vec::new();
    for channel in 0..log.channels.len() {
        let mut own: Vec<&Step> = steps.iter().filter(|step| step.0 == channel).collect();
        own.sort_by(|a, b| b.2.abs().total_cmp(&a.2.abs()));
        let others = own.len().saturating_sub(SHOWN);
        for (_, row, size_m) in own.into_iter().take(SHOWN) {
            let name = log.channels[channel].name;
            let more = if others > 0 {
                format!(" ({others} more)")
            } else {
                String::new()
            };
            let message = format!(
                "{name} steps by {:.2} um ({}){more}: look for a fringe lost at speed, a loose probe or beam; record the \
                 movement again or leave it out",
                size_m * 1e6,
                log.place(*row),
            );
            findings.push(Finding {
                channel: Some(name.to_owned()),
                value: Some(size_m * 1e6),
                unit: Some("um"),
                ..log.warning_at(Code::Step, *row, message)
            });
        }
    }
    steps.iter().for_each(|step| log.split_at(step.1));
    findings
}

/// A step of one probe that is too small to see from row to row: the residual of that probe
/// alone shifts, and it does so within few rows.
fn small_step(
    residuals: &Residuals,
    log: &LogSignals,
    shifts: &[Vec<f64>; 3],
    usual_m: &[f64; 3],
    segment: &Range<usize>,
    peak: usize,
) -> Option<Step> {
    let deviations: [f64; 3] = std::array::from_fn(|i| shifts[i][peak].abs() / usual_m[i]);
    let probe = (0..3).max_by(|a, b| deviations[*a].total_cmp(&deviations[*b]))?;
    let alone = (0..3).all(|i| i == probe || deviations[i] < 4.0);
    if !alone
        || deviations[probe] < STEP_MIN
        || peak < segment.start + SIDE
        || peak + SIDE > segment.end
    {
        return None;
    }
    let values = &residuals.values[probe];
    let rows: Vec<usize> = (peak - SIDE..peak + SIDE)
        .filter(|&row| log.usable[row])
        .collect();
    let n = rows.len() as f64;
    let mean = rows.iter().map(|&row| values[row]).sum::<f64>() / n;
    let middle = rows.iter().map(|&row| row as f64).sum::<f64>() / n;
    let (mut of_ramp, mut ramp_ramp, mut of_step, mut step_step) = (0.0, 0.0, 0.0, 0.0);
    for &row in &rows {
        let (ramp, step) = (row as f64 - middle, if row < peak { -0.5 } else { 0.5 });
        of_ramp += ramp * (values[row] - mean);
        ramp_ramp += ramp * ramp;
        of_step += step * (values[row] - mean);
        step_step += step * step;
    }
    // A step explains more of the rows than a slope does.
    let variance = residuals.noise_m[probe] * residuals.noise_m[probe];
    let better = of_step * of_step / step_step - of_ramp * of_ramp / ramp_ramp;
    (better > 8.0 * variance).then_some((probe, peak, shifts[probe][peak]))
}
