//! Hum: lines in the spectra of the residuals, the channel that each comes from, and its size
//! there. A line is taken out before the next is looked for: the motion modulates what an error of
//! a beam shows at the probes, which else would look like further lines.

use super::channels::LogSignals;
use super::residual::{Error, Residuals, blamed};
use super::spectrum::{Spectrum, smooth, windows};
use crate::finding::{Code, Finding, Severity};
use nalgebra::{Matrix2, Vector2, Vector3};
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
/// At most this many lines are reported.
const LINES_MAX: usize = 5;

/// Names the lines above the motion, the clearest first.
pub(super) fn hum(log: &mut LogSignals, residuals: &Residuals) -> Vec<Finding> {
    let longest = log.segments.iter().map(Range::len).max().unwrap_or(0);
    let length = smooth(log.rows_in(WINDOW_S).min(longest));
    let mut windows = windows(&log.segments, length);
    // A mean over windows without residuals would count as if all of them had gone in.
    windows.retain(|window| log.is_mostly_used(window));
    if length < ROWS_MIN || windows.is_empty() {
        return Vec::new();
    }
    let spectrum = |values: &Vec<f64>| Spectrum::new(values, &windows);
    let raw: Vec<Spectrum> = log.channels.iter().map(|c| spectrum(&c.values)).collect();
    let bins_in_hz = length as f64 * log.period_s;
    let motion = raw[3..6].iter().map(Spectrum::highest).max().unwrap_or(0);
    let lowest = (OF_MOTION * motion as f64).max(LOWEST_HZ * bins_in_hz) as usize;

    let mut left = residuals.values.clone();
    let mut findings = Vec::new();
    while findings.len() < LINES_MAX {
        let spectra = left.each_ref().map(spectrum);
        let lines = (0..3).filter_map(|k| Some((k, spectra[k].clearest_line(lowest)?)));
        let Some((probe, (bin, _))) = lines.max_by(|a, b| a.1.1.total_cmp(&b.1.1)) else {
            break;
        };
        let shown_m = spectra[probe].amplitude(bin);
        let cycles_per_row = spectra[probe].cycles_per_row(bin);
        let lines = Lines::new(log, residuals, &left, &windows, cycles_per_row);
        let Some(line) = blamed(&lines.errors(), |channel| raw[channel].amplitude(bin)) else {
            break;
        };
        lines.take_out(log, residuals, &mut left, line.channel);
        let name = log.channels[line.channel].name;
        let frequency_hz = cycles_per_row / log.period_s;
        let message = format!(
            "{name} hums at {frequency_hz:.1} Hz with an amplitude of {:.2} um: look for mains (50 or 60 Hz and multiples) in \
             its cable and supply, or for a vibration of that part",
            line.size_m * 1e6,
        );
        let severity = match shown_m < WARN_MIN * residuals.noise_m[probe] {
            true => Severity::Note,
            false => Severity::Warn,
        };
        let found = log.warning(Code::Hum, message).severe(severity);
        findings.push(found.on(name).of(frequency_hz, "Hz"));
    }
    findings
}

/// The lines of one frequency, one of each channel, that explain most of the residuals by themselves.
struct Lines<'a> {
    windows: &'a [Range<usize>],
    cycles_per_row: f64,
    /// By channel and window: amplitudes of cosine and sine, m, and what they explain.
    waves_m: Vec<Vec<(Vector2<f64>, f64)>>,
}

impl<'a> Lines<'a> {
    /// Least squares, by window.
    fn new(
        log: &LogSignals,
        residuals: &Residuals,
        left: &[Vec<f64>; 3],
        windows: &'a [Range<usize>],
        cycles_per_row: f64,
    ) -> Self {
        let mut lines = Self {
            windows,
            cycles_per_row,
            waves_m: vec![Vec::new(); log.channels.len()],
        };
        for window in windows {
            let mut sums = vec![(Matrix2::zeros(), Vector2::zeros()); log.channels.len()];
            for row in window.clone().filter(|&row| log.usable[row]) {
                let wave = lines.wave(row);
                let left = residuals.over_noise(left.each_ref().map(|left| left[row]));
                for (sums, slopes) in sums.iter_mut().zip(residuals.of_errors(log, row)) {
                    sums.0 += wave * wave.transpose() * slopes.norm_squared();
                    sums.1 += wave * slopes.dot(&left);
                }
            }
            for (waves_m, (squares, products)) in lines.waves_m.iter_mut().zip(sums) {
                let wave_m = squares.try_inverse().unwrap_or_default() * products;
                waves_m.push((wave_m, wave_m.dot(&products)));
            }
        }
        lines
    }

    /// Cosine and sine at a row.
    fn wave(&self, row: usize) -> Vector2<f64> {
        let (sin, cos) = libm::sincos(TAU * (self.cycles_per_row * row as f64).fract());
        Vector2::new(cos, sin)
    }

    /// The line of each channel, its size as root mean square of the amplitudes over the windows.
    fn errors(&self) -> Vec<Error> {
        let of_channel = |(channel, waves): (usize, &Vec<(Vector2<f64>, f64)>)| {
            let squares: f64 = waves.iter().map(|(wave_m, _)| wave_m.norm_squared()).sum();
            Error {
                channel,
                size_m: (squares / waves.len() as f64).sqrt(),
                explained: waves.iter().map(|(_, explained)| explained).sum(),
            }
        };
        self.waves_m.iter().enumerate().map(of_channel).collect()
    }

    fn take_out(
        &self,
        log: &LogSignals,
        residuals: &Residuals,
        left: &mut [Vec<f64>; 3],
        channel: usize,
    ) {
        for (window, (wave_m, _)) in self.windows.iter().zip(&self.waves_m[channel]) {
            for row in window.clone().filter(|&row| log.usable[row]) {
                let error_m = wave_m.dot(&self.wave(row));
                let shown: Vector3<f64> = residuals.of_errors(log, row)[channel] * error_m;
                (0..3).for_each(|k| left[k][row] -= shown[k] * residuals.noise_m[k]);
            }
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
