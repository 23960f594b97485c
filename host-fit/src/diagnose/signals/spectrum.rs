//! Mean power spectra of the signals of a log.

use super::channels::median;
use rustfft::FftPlanner;
use rustfft::num_complex::Complex;
use std::f64::consts::TAU;
use std::ops::Range;

/// Bins on each side that tell the level of the noise.
const SIDE: usize = 20;
/// How far outside the noise a line is, in standard deviations of a normal number.
const LINE_MIN: f64 = 6.5;

/// Pieces of segments of equal length.
pub(crate) fn windows(segments: &[Range<usize>], length: usize) -> Vec<Range<usize>> {
    let of = |segment: &Range<usize>| {
        let starts = segment.clone().step_by(length);
        let end = segment.end;
        starts
            .map(move |start| start..start + length)
            .filter(move |w| w.end <= end)
    };
    segments.iter().flat_map(of).collect()
}

/// Mean power over windows with a Hann taper.
pub(crate) struct Spectrum {
    /// Mean squared magnitude of the transform, by bin; unit that of the values, squared.
    pub(crate) power: Vec<f64>,
    /// Windows that went in.
    pub(crate) windows: usize,
    length: usize,
}

impl Spectrum {
    /// All windows have the same length.
    pub(crate) fn new(values: &[f64], windows: &[Range<usize>]) -> Self {
        let length = windows.first().map_or(2, Range::len);
        let transform = FftPlanner::new().plan_fft_forward(length);
        let taper: Vec<f64> = (0..length)
            .map(|k| 0.5 - 0.5 * libm::cos(TAU * k as f64 / length as f64))
            .collect();
        let mut power = vec![0.0; length / 2];
        for window in windows {
            let rows = &values[window.clone()];
            let mean = rows.iter().sum::<f64>() / length as f64;
            let mut buffer: Vec<Complex<f64>> = (rows.iter().zip(&taper))
                .map(|(value, taper)| Complex::new((value - mean) * taper, 0.0))
                .collect();
            transform.process(&mut buffer);
            (power.iter_mut().zip(&buffer)).for_each(|(sum, bin)| *sum += bin.norm_sqr());
        }
        let count = windows.len().max(1) as f64;
        power.iter_mut().for_each(|sum| *sum /= count);
        Self {
            power,
            windows: windows.len(),
            length,
        }
    }

    /// The level of the noise around a bin.
    fn level(&self, bin: usize) -> f64 {
        let bins = bin.saturating_sub(SIDE).max(3)..(bin + SIDE + 1).min(self.power.len());
        let mut around: Vec<f64> = bins.map(|k| self.power[k]).collect();
        let n = self.windows.max(1) as f64;
        // The median of chi-squared with 2 n degrees of freedom over its mean.
        median(&mut around) / (1.0 - 1.0 / (9.0 * n)).powi(3)
    }

    /// Amplitude of a line at a bin of at least 1: Hann spreads it over three.
    pub(super) fn amplitude(&self, bin: usize) -> f64 {
        let level = self.level(bin);
        let excess: f64 = (bin - 1..=bin + 1).map(|k| self.power[k] - level).sum();
        // The sum of squares of the taper is 3/8 of its length.
        (4.0 * excess.max(0.0) / (0.375 * (self.length * self.length) as f64)).sqrt()
    }

    /// The clearest line from a bin on, and its power in parts of what noise may have; `None` where
    /// noise explains all.
    pub(super) fn clearest_line(&self, lowest: usize) -> Option<(usize, f64)> {
        let n = self.windows.max(1) as f64;
        let limit = (1.0 - 1.0 / (9.0 * n) + LINE_MIN / (3.0 * n.sqrt())).powi(3);
        let peak = |bin: usize| {
            self.power[bin] >= self.power[bin - 1].max(f64::max(self.power[bin + 1], 0.0))
        };
        (lowest.max(1)..self.power.len().saturating_sub(2))
            .filter(|&bin| peak(bin))
            .map(|bin| (bin, self.power[bin] / (limit * self.level(bin))))
            .filter(|(_, clear)| *clear > 1.0)
            .max_by(|a, b| a.1.total_cmp(&b.1))
    }

    /// The highest bin with a considerable part of the power.
    pub(super) fn highest(&self) -> usize {
        let most = self.power.iter().copied().fold(0.0, f64::max);
        self.power
            .iter()
            .rposition(|&power| power > 1e-3 * most)
            .unwrap_or(0)
    }

    /// Cycles per row of a line at a bin: the ratio of two neighbouring bins of a Hann spectrum tells
    /// where between them it is.
    pub(super) fn cycles_per_row(&self, bin: usize) -> f64 {
        let level = self.level(bin);
        let size = |k: usize| (self.power[k] - level).max(0.0).sqrt();
        let (neighbour, side) = if self.power[bin + 1] > self.power[bin - 1] {
            (bin + 1, 1.0)
        } else {
            (bin - 1, -1.0)
        };
        let ratio = size(neighbour) / size(bin).max(f64::MIN_POSITIVE);
        let off = ((2.0 * ratio - 1.0) / (1.0 + ratio)).clamp(0.0, 0.5);
        (bin as f64 + side * off) / self.length as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::random::{Purpose, Stream};

    fn noise(rows: usize, seed: u64) -> Vec<f64> {
        let mut random = Stream::new(seed, Purpose::Sensors, 0);
        (0..rows).map(|_| random.normal(1.0)).collect()
    }

    fn cut(rows: usize, length: usize) -> Vec<Range<usize>> {
        (0..rows / length)
            .map(|k| k * length..(k + 1) * length)
            .collect()
    }

    #[test]
    fn a_line_is_found_at_its_frequency_with_its_amplitude() {
        let windows = cut(8000, 1000);
        let mut values = noise(8000, 1);
        for (k, value) in values.iter_mut().enumerate() {
            *value += 0.8 * libm::sin(TAU * 0.1004 * k as f64 + 0.3);
        }
        let spectrum = Spectrum::new(&values, &windows);
        let (bin, clear) = spectrum.clearest_line(10).expect("a line");
        assert!(clear > 5.0, "{clear}");
        let frequency = spectrum.cycles_per_row(bin);
        assert!((frequency - 0.1004).abs() < 5e-5, "{frequency}");
        let amplitude = spectrum.amplitude(bin);
        assert!((amplitude - 0.8).abs() < 0.06, "{amplitude}");
    }

    #[test]
    fn noise_has_no_lines_however_few_windows_there_are() {
        for (rows, length) in [(1000, 1000), (3000, 1000), (40_000, 500)] {
            for seed in 0..10 {
                let spectrum = Spectrum::new(&noise(rows, seed), &cut(rows, length));
                assert_eq!(spectrum.clearest_line(5), None, "{rows} {length} {seed}");
            }
        }
    }
}
