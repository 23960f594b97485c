//! Hum: lines in the spectrum of the residuals.

use super::channels::{BEAMS, HALL, LogSignals};
use super::residual::Residuals;
use crate::diagnose::finding::{Code, Finding, Severity};
use rustfft::FftPlanner;
use rustfft::num_complex::Complex;
use std::f64::consts::TAU;
use std::ops::Range;

/// Longest and shortest window, s and rows.
const WINDOW_S: f64 = 2.0;
const ROWS_MIN: usize = 256;
/// Bins on each side that tell the level of the noise.
const SIDE: usize = 20;
/// How far outside the noise a line is, in standard deviations of a normal number.
const LINE_MIN: f64 = 6.5;
/// Below this, and below this many times the frequency of the motion, residuals may hold what no
/// polynomial describes.
const LOWEST_HZ: f64 = 10.0;
const OF_MOTION: f64 = 8.0;
/// Amplitude in parts of the noise of a probe from which a line is worth a warning.
const WARN_MIN: f64 = 0.3;
/// Amplitude of a sideband in parts of its line, at most.
const SIDEBAND: f64 = 0.3;
/// Lines that are told.
const LINES_MAX: usize = 5;

/// Mean power spectrum over windows with a Hann taper.
pub(crate) struct Spectrum {
    /// Mean squared magnitude of the transform, by bin; unit that of the values, squared.
    pub(crate) power: Vec<f64>,
    /// Windows that went in.
    pub(crate) windows: usize,
    length: usize,
}

impl Spectrum {
    /// Of the windows of `length` rows that fit into the segments; their means are taken off.
    pub(crate) fn new(segments: &[Range<usize>], values: &[f64], length: usize) -> Self {
        let transform = FftPlanner::new().plan_fft_forward(length);
        let taper: Vec<f64> = (0..length)
            .map(|k| 0.5 - 0.5 * (TAU * k as f64 / length as f64).cos())
            .collect();
        let mut power = vec![0.0; length / 2];
        let mut windows = 0;
        for segment in segments {
            for chunk in values[segment.clone()].chunks_exact(length) {
                let mean = chunk.iter().sum::<f64>() / length as f64;
                let mut buffer: Vec<Complex<f64>> = (chunk.iter().zip(&taper))
                    .map(|(value, taper)| Complex::new((value - mean) * taper, 0.0))
                    .collect();
                transform.process(&mut buffer);
                (power.iter_mut().zip(&buffer)).for_each(|(sum, bin)| *sum += bin.norm_sqr());
                windows += 1;
            }
        }
        power
            .iter_mut()
            .for_each(|sum| *sum /= f64::max(windows as f64, 1.0));
        Self {
            power,
            windows,
            length,
        }
    }

    /// The level of the noise around a bin.
    fn level(&self, bin: usize) -> f64 {
        let rows = bin.saturating_sub(SIDE).max(3)..(bin + SIDE + 1).min(self.power.len());
        let mut around: Vec<f64> = rows.map(|k| self.power[k]).collect();
        let n = self.windows as f64;
        // The median of chi-squared with 2 n degrees of freedom over its mean.
        super::channels::median(&mut around) / (1.0 - 1.0 / (9.0 * n)).powi(3)
    }

    /// Amplitude of a line at a bin: Hann spreads it over three.
    fn amplitude(&self, bin: usize) -> f64 {
        let level = self.level(bin);
        let excess: f64 = (bin - 1..=bin + 1).map(|k| self.power[k] - level).sum();
        // The sum of squares of the taper is 3/8 of its length.
        (4.0 * excess.max(0.0) / (0.375 * (self.length * self.length) as f64)).sqrt()
    }

    /// Whether a bin is a line: a peak beyond what noise gives.
    fn is_line(&self, bin: usize) -> bool {
        let n = self.windows as f64;
        let limit = (1.0 - 1.0 / (9.0 * n) + LINE_MIN / (3.0 * n.sqrt())).powi(3);
        let peak = self.power[bin - 1] <= self.power[bin] && self.power[bin] > self.power[bin + 1];
        peak && self.power[bin] > limit * self.level(bin)
    }

    fn frequency_hz(&self, bin: usize, period_s: f64) -> f64 {
        let level = self.level(bin);
        let (mut sum, mut weighted) = (0.0, 0.0);
        for k in bin - 1..=bin + 1 {
            let excess = (self.power[k] - level).max(0.0).sqrt();
            sum += excess;
            weighted += excess * k as f64;
        }
        weighted / sum / (self.length as f64 * period_s)
    }
}

/// Names the lines above the motion, by channel.
pub(super) fn hum(log: &LogSignals, residuals: &Residuals) -> Vec<Finding> {
    let longest = log.segments.iter().map(|s| s.len()).max().unwrap_or(0);
    let length = log.rows_in(WINDOW_S).min(longest);
    if length < ROWS_MIN {
        return Vec::new();
    }
    let raw: Vec<Spectrum> = (log.channels.iter())
        .map(|channel| Spectrum::new(&log.segments, &channel.values, length))
        .collect();
    let left: Vec<Spectrum> = (residuals.values.iter())
        .map(|values| Spectrum::new(&log.segments, values, length))
        .collect();
    let resolution_hz = 1.0 / (length as f64 * log.period_s);
    let lowest_hz = (OF_MOTION * motion_bin(&raw) as f64 * resolution_hz).max(LOWEST_HZ);
    let lowest = ((lowest_hz / resolution_hz) as usize).max(4);
    let mut lines: Vec<(usize, usize, f64)> = (lowest..(length / 2).saturating_sub(2))
        .flat_map(|bin| [0, 1, 2].map(|probe| (bin, probe)))
        .filter(|&(bin, probe)| left[probe].is_line(bin))
        .map(|(bin, probe)| (bin, probe, left[probe].amplitude(bin)))
        .collect();
    lines.sort_by(|a, b| b.2.total_cmp(&a.2));
    let mut named: Vec<(&'static str, usize, f64)> = Vec::new();
    let mut findings: Vec<Finding> = Vec::new();
    for (bin, probe, amplitude_m) in lines {
        let (name, size_m) = source(&raw, residuals, probe, bin, amplitude_m);
        // The motion modulates a line: sidebands are no lines of their own.
        let known = (named.iter()).any(|&(other, at, largest_m)| {
            let (apart, sideband) = (at.abs_diff(bin), amplitude_m < SIDEBAND * largest_m);
            (other == name && apart < 3) || (apart < lowest && sideband)
        });
        if known || named.len() == LINES_MAX {
            continue;
        }
        named.push((name, bin, amplitude_m));
        let small = amplitude_m < WARN_MIN * residuals.noise_m[probe];
        let frequency_hz = left[probe].frequency_hz(bin, log.period_s);
        findings.push(finding(log, name, frequency_hz, size_m, small));
    }
    findings
}

fn finding(log: &LogSignals, name: &str, frequency_hz: f64, size_m: f64, small: bool) -> Finding {
    let message = format!(
        "{name} hums at {frequency_hz:.1} Hz with an amplitude of {:.2} um: look for mains (50 or 60 Hz and multiples) in \
         its cable and supply, or for a vibration of that part",
        size_m * 1e6,
    );
    let severity = if small {
        Severity::Note
    } else {
        Severity::Warn
    };
    Finding {
        severity,
        channel: Some(name.to_owned()),
        value: Some(frequency_hz),
        unit: Some("Hz"),
        ..log.warning(Code::Hum, message)
    }
}

/// The highest bin with a considerable part of the motion.
fn motion_bin(raw: &[Spectrum]) -> usize {
    let top = |beam: &Spectrum| {
        let most = beam.power.iter().copied().fold(0.0, f64::max);
        beam.power
            .iter()
            .rposition(|&power| power > 1e-3 * most)
            .unwrap_or(0)
    };
    raw[3..6].iter().map(top).max().unwrap_or(0)
}

/// The channel that a line in the residual of a probe comes from, and its amplitude there, m: a
/// beam that shows it while the probe does not, or else the probe.
fn source(
    raw: &[Spectrum],
    residuals: &Residuals,
    probe: usize,
    bin: usize,
    amplitude_m: f64,
) -> (&'static str, f64) {
    let shown_m = raw[probe].amplitude(bin);
    let beams_m: [f64; 3] = std::array::from_fn(|beam| raw[3 + beam].amplitude(bin));
    let implied = |beam: usize| residuals.gains[probe][beam].abs() * beams_m[beam];
    let beam = (0..3).max_by(|a, b| implied(*a).total_cmp(&implied(*b)));
    match beam {
        Some(beam) if implied(beam) > 0.5 * amplitude_m && shown_m < 0.5 * amplitude_m => {
            (BEAMS[beam], beams_m[beam])
        }
        _ => (HALL[probe], amplitude_m),
    }
}
