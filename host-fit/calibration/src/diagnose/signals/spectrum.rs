//! Mean power spectra of the signals of a log.

use super::channels::median;
use nalgebra::Complex;
use std::f64::consts::TAU;
use std::ops::Range;

/// Bins on each side that give the level of the noise.
const SIDE: usize = 20;
/// How far outside the noise a line is, in standard deviations of a normal number.
const LINE_MIN: f64 = 6.5;

/// The longest window of at most so many rows without prime factors above 5: others take long to
/// transform.
pub(super) fn smooth(rows: usize) -> usize {
    let left = |n: usize| {
        let without = |n: usize, factor: usize| {
            core::iter::successors(Some(n), |n| n.is_multiple_of(factor).then(|| n / factor)).last()
        };
        [2, 3, 5].into_iter().try_fold(n, without)
    };
    (1..=rows).rfind(|&n| left(n) == Some(1)).unwrap_or(rows)
}

/// Pieces of segments of equal length.
pub fn windows(segments: &[Range<usize>], length: usize) -> Vec<Range<usize>> {
    let of = |segment: &Range<usize>| {
        let starts = segment.clone().step_by(length);
        let end = segment.end;
        starts
            .map(move |start| start..start + length)
            .filter(move |w| w.end <= end)
    };
    segments.iter().flat_map(of).collect()
}

/// The discrete Fourier transform of one length.
struct Transform {
    /// exp(-2 pi i k / length).
    roots: Vec<Complex<f64>>,
}

impl Transform {
    fn new(length: usize) -> Self {
        let root = |k| {
            let (sin, cos) = libm::sincos(TAU * k as f64 / length as f64);
            Complex::new(cos, -sin)
        };
        Self {
            roots: (0..length).map(root).collect(),
        }
    }

    /// Of every so many values, by decimation in time: the cost is the length times the sum of its
    /// prime factors.
    fn of(&self, values: &[Complex<f64>], every: usize, bins: &mut [Complex<f64>]) {
        let length = bins.len();
        let Some(parts) = (2..=length).find(|factor| length.is_multiple_of(*factor)) else {
            bins.copy_from_slice(&values[..length]);
            return;
        };
        let part = length / parts;
        for (first, bins) in bins.chunks_mut(part).enumerate() {
            self.of(&values[first * every..], every * parts, bins);
        }
        let mut own = vec![Complex::ZERO; parts];
        for k in 0..part {
            (own.iter_mut().zip(0..)).for_each(|(own, p): (_, usize)| *own = bins[p * part + k]);
            for bin in (k..length).step_by(part) {
                bins[bin] = (own.iter().zip(0..))
                    .map(|(own, p): (_, usize)| own * self.roots[p * bin % length * every])
                    .sum();
            }
        }
    }
}

/// Mean power over windows with a Hann taper.
pub struct Spectrum {
    /// Mean squared magnitude of the transform, by bin; unit that of the values, squared.
    pub power: Vec<f64>,
    /// Windows that went in.
    pub windows: usize,
    length: usize,
}

impl Spectrum {
    /// All windows have the same length.
    pub fn new(values: &[f64], windows: &[Range<usize>]) -> Self {
        let length = windows.first().map_or(2, Range::len);
        let transform = Transform::new(length);
        let taper: Vec<f64> = (0..length)
            .map(|k| 0.5 - 0.5 * libm::cos(TAU * k as f64 / length as f64))
            .collect();
        let mut power = vec![0.0; length / 2];
        let tapered = |window: &Range<usize>| -> Vec<f64> {
            let rows = &values[window.clone()];
            let mean = rows.iter().sum::<f64>() / length as f64;
            (rows.iter().zip(&taper))
                .map(|(value, taper)| (value - mean) * taper)
                .collect()
        };
        let mut bins = vec![Complex::ZERO; length];
        // One transform of two real windows: their powers are those of a bin and its mirror.
        for pair in windows.chunks(2) {
            let real = tapered(&pair[0]);
            let imaginary = pair.get(1).map_or_else(|| vec![0.0; length], tapered);
            let both: Vec<_> = (real.into_iter().zip(imaginary))
                .map(|(re, im)| Complex::new(re, im))
                .collect();
            transform.of(&both, 1, &mut bins);
            for (k, sum) in power.iter_mut().enumerate() {
                let mirrored = bins[(length - k) % length];
                *sum += 0.5 * (bins[k].norm_sqr() + mirrored.norm_sqr());
            }
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

    /// Cycles per row of a line at a bin: the ratio of two neighbouring bins of a Hann spectrum gives
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
    fn power_is_that_of_the_sum_over_the_rows() {
        for length in [1, 2, 12, 30, 49] {
            let windows = cut(3 * length, length);
            let values = noise(3 * length, 5);
            let spectrum = Spectrum::new(&values, &windows);
            for (bin, power) in spectrum.power.iter().enumerate() {
                let of = |window: &Range<usize>| {
                    let rows = &values[window.clone()];
                    let mean = rows.iter().sum::<f64>() / length as f64;
                    let (mut re, mut im) = (0.0, 0.0);
                    for (k, value) in rows.iter().enumerate() {
                        let turn = k as f64 / length as f64;
                        let tapered = (value - mean) * (0.5 - 0.5 * libm::cos(TAU * turn));
                        re += tapered * libm::cos(TAU * bin as f64 * turn);
                        im += tapered * libm::sin(TAU * bin as f64 * turn);
                    }
                    re * re + im * im
                };
                let expected = windows.iter().map(of).sum::<f64>() / 3.0;
                assert!((power - expected).abs() < 1e-9, "{length} {bin}");
            }
        }
    }

    #[test]
    fn a_window_has_no_large_prime_factor_and_is_hardly_shorter() {
        for (rows, length) in [(1, 1), (1000, 1000), (997, 972), (500, 500), (7, 6)] {
            assert_eq!(smooth(rows), length);
        }
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
