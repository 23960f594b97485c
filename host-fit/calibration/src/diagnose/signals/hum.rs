//! Hum: lines in the spectra of the residuals, the channel that each comes from, and its size
//! there. A line is taken out before the next is looked for: the motion modulates what an error of
//! a beam shows at the probes, which else would be told as lines beside it.

use super::channels::LogSignals;
use super::residual::Residuals;
use super::spectrum::{Spectrum, smooth, windows};
use crate::finding::{Code, Finding, Severity};
use std::f64::consts::TAU;
use std::ops::Range;

/// Longest and shortest window, s and rows.
const WINDOW_S: f64 = 2.0;
const ROWS_MIN: usize = 256;
/// Below this, and below this many times the frequency of the motion, residuals may hold what the
/// model does not describe.
const LOWEST_HZ: f64 = 10.0;
const OF_MOTION: f64 = 8.0;
/// Amplitude in parts of the noise of a probe from which a line is worth a warning.
const WARN_MIN: f64 = 0.3;
/// Lines that are told, and their least amplitude in parts of the largest.
const LINES_MAX: usize = 5;
const OF_LARGEST: f64 = 0.05;
/// Bins on each side of a line that hold what is left of it.
const WIDTH: usize = 5;
/// What a beam or gap explains of a line in parts of what a probe would, at least, and how far
/// its own spectrum may be off that, as a factor.
const EXPLAINED_MIN: f64 = 0.8;
const SEEN_FACTOR: f64 = 2.0;

/// A line of one channel: by window the amplitudes of cosine and sine, m.
struct Line {
    channel: usize,
    /// Power of the residuals that it explains, in units of their noise.
    explained: f64,
    waves_m: Vec<[f64; 2]>,
}

impl Line {
    /// Root mean square over the windows, as an amplitude, m.
    fn amplitude_m(&self) -> f64 {
        let squares: f64 = self.waves_m.iter().flatten().map(|m| m * m).sum();
        (squares / self.waves_m.len().max(1) as f64).sqrt()
    }
}

/// Names the lines above the motion, the clearest first.
pub(super) fn hum(log: &LogSignals, residuals: &Residuals) -> Vec<Finding> {
    let longest = log.segments.iter().map(Range::len).max().unwrap_or(0);
    let length = smooth(log.rows_in(WINDOW_S).min(longest));
    if length < ROWS_MIN {
        return Vec::new();
    }
    let mut windows = windows(&log.segments, length);
    // A mean over windows without residuals would be told as if all of them had gone in.
    windows.retain(|window| log.is_mostly_used(window));
    if windows.is_empty() {
        return Vec::new();
    }
    let raw: Vec<Spectrum> = (log.channels.iter())
        .map(|channel| Spectrum::new(&channel.values, &windows))
        .collect();
    let per_bin_hz = 1.0 / (length as f64 * log.period_s);
    let motion = raw[3..6].iter().map(Spectrum::highest).max().unwrap_or(0);
    let lowest_hz = (OF_MOTION * motion as f64 * per_bin_hz).max(LOWEST_HZ);
    let lowest = ((lowest_hz / per_bin_hz) as usize).max(4);

    let mut left = residuals.values.clone();
    let mut findings = Vec::new();
    let mut largest_m = 0.0;
    let mut told: Vec<usize> = Vec::new();
    for _ in 0..2 * LINES_MAX {
        let spectra = left
            .each_ref()
            .map(|values| Spectrum::new(values, &windows));
        let lines = (0..3).filter_map(|k| Some((k, spectra[k].clearest_line(lowest)?)));
        let Some((probe, (bin, _))) = lines.max_by(|a, b| a.1.1.total_cmp(&b.1.1)) else {
            break;
        };
        let cycles_per_row = spectra[probe].cycles_per_row(bin);
        let line = source(log, residuals, &left, &windows, &raw, bin, cycles_per_row);
        let Some(line) = line else { break };
        take_out(log, residuals, &mut left, &windows, cycles_per_row, &line);
        let shown_m = spectra[probe].amplitude(bin);
        if shown_m < OF_LARGEST * largest_m || told.iter().any(|at| at.abs_diff(bin) <= WIDTH) {
            continue;
        }
        told.push(bin);
        largest_m = shown_m.max(largest_m);
        let severity = if shown_m < WARN_MIN * residuals.noise_m[probe] {
            Severity::Note
        } else {
            Severity::Warn
        };
        let frequency_hz = cycles_per_row / log.period_s;
        findings.push(finding(log, &line, frequency_hz, severity));
        if findings.len() == LINES_MAX {
            break;
        }
    }
    findings
}

fn finding(log: &LogSignals, line: &Line, frequency_hz: f64, severity: Severity) -> Finding {
    let name = log.channels[line.channel].name;
    let message = format!(
        "{name} hums at {frequency_hz:.1} Hz with an amplitude of {:.2} um: look for mains (50 or 60 Hz and multiples) in \
         its cable and supply, or for a vibration of that part",
        line.amplitude_m() * 1e6,
    );
    Finding {
        severity,
        channel: Some(name.to_owned()),
        value: Some(frequency_hz),
        unit: Some("Hz"),
        ..log.warning(Code::Hum, message)
    }
}

/// Cosine and sine of a line at a row.
fn wave(cycles_per_row: f64, row: usize) -> [f64; 2] {
    let (sin, cos) = libm::sincos(TAU * (cycles_per_row * row as f64).fract());
    [cos, sin]
}

/// The channel whose line explains most of the residuals: of beams and gaps only those that show
/// it themselves, and these before a probe that explains little more.
fn source(
    log: &LogSignals,
    residuals: &Residuals,
    left: &[Vec<f64>; 3],
    windows: &[Range<usize>],
    raw: &[Spectrum],
    bin: usize,
    cycles_per_row: f64,
) -> Option<Line> {
    let lines = lines(log, residuals, left, windows, cycles_per_row);
    let worth = |line: &Line| {
        let (seen_m, wanted_m) = (raw[line.channel].amplitude(bin), line.amplitude_m());
        let seen = (wanted_m / SEEN_FACTOR..wanted_m * SEEN_FACTOR).contains(&seen_m);
        match line.channel {
            0..3 => EXPLAINED_MIN * line.explained,
            _ if seen => line.explained,
            _ => 0.0,
        }
    };
    (lines.into_iter()).max_by(|a, b| worth(a).total_cmp(&worth(b)))
}

/// The line of each channel that explains most of the residuals: least squares, by window.
fn lines(
    log: &LogSignals,
    residuals: &Residuals,
    left: &[Vec<f64>; 3],
    windows: &[Range<usize>],
    cycles_per_row: f64,
) -> Vec<Line> {
    let mut lines: Vec<Line> = (0..log.channels.len())
        .map(|channel| Line {
            channel,
            explained: 0.0,
            waves_m: Vec::with_capacity(windows.len()),
        })
        .collect();
    let weight = residuals
        .noise_m
        .map(|noise_m| 1.0 / (noise_m * noise_m).max(1e-20));
    for window in windows {
        // By channel: cos cos, cos sin, sin sin, cos residual, sin residual.
        let mut sums = vec![[0.0; 5]; log.channels.len()];
        for row in window.clone().filter(|&row| log.usable[row]) {
            let [cos, sin] = wave(cycles_per_row, row);
            let of_errors = residuals.of_errors(log, row);
            for (sums, slopes) in sums.iter_mut().zip(&of_errors) {
                for k in 0..3 {
                    let by = weight[k] * slopes[k] * slopes[k];
                    let with = weight[k] * slopes[k] * left[k][row];
                    let terms = [
                        by * cos * cos,
                        by * cos * sin,
                        by * sin * sin,
                        with * cos,
                        with * sin,
                    ];
                    (0..5).for_each(|i| sums[i] += terms[i]);
                }
            }
        }
        for (line, [cc, cs, ss, c, s]) in lines.iter_mut().zip(sums) {
            let determinant = (cc * ss - cs * cs).max(f64::MIN_POSITIVE);
            let waves = [
                (c * ss - s * cs) / determinant,
                (s * cc - c * cs) / determinant,
            ];
            line.explained += waves[0] * c + waves[1] * s;
            line.waves_m.push(waves);
        }
    }
    lines
}

fn take_out(
    log: &LogSignals,
    residuals: &Residuals,
    left: &mut [Vec<f64>; 3],
    windows: &[Range<usize>],
    cycles_per_row: f64,
    line: &Line,
) {
    for (window, waves_m) in windows.iter().zip(&line.waves_m) {
        for row in window.clone().filter(|&row| log.usable[row]) {
            let [cos, sin] = wave(cycles_per_row, row);
            let error_m = waves_m[0] * cos + waves_m[1] * sin;
            let slopes = residuals.of_errors(log, row)[line.channel];
            (0..3).for_each(|k| left[k][row] -= slopes[k] * error_m);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::sample_for_tests::{PERIOD_S, codes, only, recording};
    use super::*;

    #[test]
    fn hum_is_named_once_with_its_frequency_and_channel() {
        let sound = recording();
        for (channel, name, frequency_hz) in
            [(2, "hall_c", 50.0), (3, "ifm_x", 61.3), (4, "ifm_y1", 50.0)]
        {
            let mut recording = sound.clone();
            for samples in &mut recording.movements {
                for (k, sample) in samples.iter_mut().enumerate() {
                    let error_m = 2e-6 * libm::sin(TAU * frequency_hz * k as f64 * PERIOD_S);
                    match channel {
                        0..3 => sample.hall[channel] += codes(error_m),
                        _ => sample.beams_nm[channel - 3] += (error_m * 1e9) as i64,
                    }
                }
            }
            let found = only(&recording, Code::Hum, Some(name));
            let off_hz = found.value.expect("a frequency") - frequency_hz;
            assert!(off_hz.abs() < 0.05, "{off_hz} Hz");
        }
    }
}
