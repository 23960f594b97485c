//! Mean power spectra of signals and errors, and their lines.

use super::predicted::quantile;
use hallstage_input::statistics::median;
use realfft::RealFftPlanner;
use std::f64::consts::TAU;
use std::ops::Range;

/// Bins on each side that give the level of the noise.
const SIDE: usize = 20;

/// Pieces of segments of equal length.
pub fn windows(segments: &[Range<usize>], length: usize) -> Vec<Range<usize>> {
    let of = |segment: &Range<usize>| {
        let (start, count) = (segment.start, segment.len() / length);
        (0..count).map(move |k| start + k * length..start + (k + 1) * length)
    };
    segments.iter().flat_map(of).collect()
}

/// Mean power over windows with a Hann taper.
pub struct Spectrum {
    /// Mean squared magnitude of the transform, by bin; the unit of the values, squared.
    pub power: Vec<f64>,
    windows: usize,
    length: usize,
}

impl Spectrum {
    /// All windows have the same length.
    pub fn new(values: &[f64], windows: &[Range<usize>]) -> Self {
        let length = windows.first().map_or(2, Range::len);
        let transform = RealFftPlanner::<f64>::new().plan_fft_forward(length);
        let (mut tapered, mut bins) = (transform.make_input_vec(), transform.make_output_vec());
        let mut power = vec![0.0; length / 2];
        let share = 1.0 / windows.len().max(1) as f64;
        for window in windows {
            let rows = &values[window.clone()];
            let mean = rows.iter().sum::<f64>() / length as f64;
            for (k, (tapered, value)) in tapered.iter_mut().zip(rows).enumerate() {
                let taper = 0.5 - 0.5 * libm::cos(TAU * k as f64 / length as f64);
                *tapered = (value - mean) * taper;
            }
            // It fails for vectors of another length only.
            if transform.process(&mut tapered, &mut bins).is_ok() {
                let powers = power.iter_mut().zip(&bins);
                powers.for_each(|(power, bin)| *power += share * bin.norm_sqr());
            }
        }
        Self {
            power,
            windows: windows.len(),
            length,
        }
    }

    /// Power of noise over its mean, this many standard deviations from the middle: a chi-squared with two
    /// degrees of freedom for each window.
    fn noise(&self, deviations: f64) -> f64 {
        quantile(1.0, 1.0 / self.windows.max(1) as f64, deviations)
    }

    /// The level of the noise around a bin.
    fn level(&self, bin: usize) -> f64 {
        let bins = bin.saturating_sub(SIDE).max(3)..self.power.len().min(bin + SIDE + 1);
        let mut powers: Vec<f64> = bins.map(|k| self.power[k]).collect();
        median(&mut powers).unwrap_or(0.0) / self.noise(0.0)
    }

    /// Amplitude of a line at a bin of at least 1: Hann spreads it over three.
    pub fn amplitude(&self, bin: usize) -> f64 {
        let level = self.level(bin);
        let excess: f64 = (bin - 1..=bin + 1).map(|k| self.power[k] - level).sum();
        // The sum of squares of the taper is 3/8 of its length.
        (4.0 * excess.max(0.0) / (0.375 * (self.length * self.length) as f64)).sqrt()
    }

    /// The lines from a bin on: bins with a power this number of standard deviations above the noise.
    pub fn lines(&self, lowest: usize, deviations: f64) -> impl Iterator<Item = usize> {
        let limit = self.noise(deviations);
        let is_line = move |bin: &usize| {
            let highest = self.power[bin - 1].max(self.power[bin + 1]);
            self.power[*bin] >= highest && self.power[*bin] > limit * self.level(*bin)
        };
        (lowest.max(1)..self.power.len().saturating_sub(2)).filter(is_line)
    }

    /// The highest bin with a considerable part of the power.
    pub fn highest(&self) -> usize {
        let most = self.power.iter().copied().fold(0.0, f64::max);
        let considerable = self.power.iter().rposition(|&power| power > 1e-3 * most);
        considerable.unwrap_or(0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hallstage_simulate::random::{Purpose, Stream};

    fn noise(rows: usize, seed: u64) -> Vec<f64> {
        let mut random = Stream::new(seed, Purpose::Sensors, 0);
        (0..rows).map(|_| random.normal(1.0)).collect()
    }

    #[test]
    fn a_line_is_found_at_its_bin_with_its_amplitude() {
        let mut values = noise(8000, 1);
        for (k, value) in values.iter_mut().enumerate() {
            *value += 0.8 * libm::sin(TAU * 0.1004 * k as f64 + 0.3);
        }
        let spectrum = Spectrum::new(&values, &windows(std::slice::from_ref(&(0..8000)), 1000));
        assert!(spectrum.lines(10, 6.5).eq([100]));
        let amplitude = spectrum.amplitude(100);
        assert!((amplitude - 0.8).abs() < 0.06, "{amplitude}");
    }

    /// Noise of variance 1 has the sum of the squared tapers as mean power.
    #[test]
    fn power_is_a_mean_over_windows_of_any_length() {
        for length in [250, 997] {
            let values = noise(100 * length, 5);
            let power = Spectrum::new(
                &values,
                &windows(std::slice::from_ref(&(0..values.len())), length),
            )
            .power;
            let mean = power[3..].iter().sum::<f64>() / (power.len() - 3) as f64;
            assert!(
                (mean / (0.375 * length as f64) - 1.0).abs() < 0.02,
                "{mean}"
            );
        }
    }

    #[test]
    fn noise_has_no_lines_however_few_windows_there_are() {
        for (rows, length) in [(1000, 1000), (3000, 1000), (40_000, 500)] {
            for seed in 0..10 {
                let spectrum = Spectrum::new(
                    &noise(rows, seed),
                    &windows(std::slice::from_ref(&(0..rows)), length),
                );
                assert_eq!(
                    spectrum.lines(5, 6.5).next(),
                    None,
                    "{rows} {length} {seed}"
                );
            }
        }
    }
}
