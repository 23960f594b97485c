//! Spectra of the channels above the motion: low passes, lines, and noise that channels of a kind share.

use super::Line;
use super::signal::Signal;
use crate::statistics::{CLEAR, median};
use nalgebra::Matrix3;
use realfft::RealFftPlanner;
use realfft::num_complex::Complex64;
use std::f64::consts::{LN_2, TAU};
use std::ops::Range;

/// Rows of a window: bins of 2 Hz at 500 rows a second.
const WINDOW: usize = 256;
const BINS: usize = WINDOW / 2 + 1;
/// Bands that show a low pass, Hz: the lowest is above the motion, the highest below half the rate of 500 rows a second.
const BANDS_HZ: [Range<f64>; 3] = [10.0..30.0, 60.0..90.0, 160.0..240.0];
/// Motion, and what a probe makes of it, is below this frequency, Hz.
const FAST_HZ: f64 = 30.0;
/// Least density, in variances of rounding.
const LEAST: f64 = 0.05;
/// A taper with side lobes of -92 dB (Blackman and Harris), and the sum of its squares per row.
const TAPER: [f64; 4] = [0.35875, -0.48829, 0.14128, -0.01168];
const TAPER_POWER: f64 = 0.258;
/// Bins on either side of a line that the taper spreads it over.
const LOBE: usize = 4;
/// Bins on either side that give the level of the noise.
const SIDE: usize = 20;
/// Motion of the stage shows in the other kind of channels with more than this part of the power: an arm makes one of eight of
/// the amplitude.
const MOVES: f64 = 1.0 / 64.0;
/// A bin with this many times the usual power has a line, a window a step.
const STANDS_OUT: f64 = 3.0;
/// Eigenvalues of the covariance of three independent channels differ from one by less than this over the root of the
/// number of values.
const BY_CHANCE: f64 = 9.0;

/// The spectra of the channels of a log, in the unit of the values: white noise has its variance in each bin.
pub(super) struct Spectra {
    by_channel: Vec<Vec<Complex64>>,
    bin_hz: f64,
}

/// The noise of three channels of a kind above the motion, in the unit of the values.
#[derive(Clone, Copy, Default)]
pub(super) struct FastNoise {
    /// The variance of the white noise of each, ...
    pub(super) white: [f64; 3],
    /// ... and of the part of it that is its own.
    pub(super) own: [f64; 3],
    /// The strongest line of each.
    pub(super) lines: [Option<Line>; 3],
    /// Their covariance less the variance of noise of their own.
    pub(super) beyond: [[f64; 3]; 3],
}

/// The sine of half the angle of a bin: twice it is the gain of a difference.
fn sine(bin: usize) -> f64 {
    libm::sin(0.5 * TAU * bin as f64 / WINDOW as f64)
}

impl Spectra {
    pub(super) fn new(signals: &[Signal], period_s: f64) -> Self {
        let transform = RealFftPlanner::<f64>::new().plan_fft_forward(WINDOW);
        let (mut tapered, mut bins) = (transform.make_input_vec(), transform.make_output_vec());
        let wave = |k: usize, n: usize| libm::cos(TAU * (n * k) as f64 / WINDOW as f64);
        let taper = |k: usize| (0..4).map(|n| TAPER[n] * wave(k, n)).sum();
        let taper: Vec<f64> = (0..WINDOW).map(taper).collect();
        // Third differences bring the motion below the noise.
        let gains: Vec<f64> = (0..BINS)
            .map(|bin| (2.0 * sine(bin.max(1))).powi(3) * (TAPER_POWER * WINDOW as f64).sqrt())
            .collect();
        let spectra = signals.iter().map(|signal| {
            let mut spectra = Vec::new();
            for run in signal.runs() {
                let third = |v: &[f64]| (v[3] - v[0]) - 3.0 * (v[2] - v[1]);
                let differences: Vec<f64> = run.windows(4).map(third).collect();
                for window in differences.windows(WINDOW).step_by(WINDOW / 2) {
                    let values = tapered.iter_mut().zip(window).zip(&taper);
                    values.for_each(|((tapered, value), taper)| *tapered = value * taper);
                    // It fails for vectors of another length only.
                    if transform.process(&mut tapered, &mut bins).is_ok() {
                        spectra.extend(bins.iter().zip(&gains).map(|(bin, gain)| bin / gain));
                    }
                }
            }
            spectra
        });
        Self {
            by_channel: spectra.collect(),
            bin_hz: 1.0 / (WINDOW as f64 * period_s),
        }
    }

    fn bins(&self, hz: &Range<f64>) -> Range<usize> {
        let bin = |edge_hz: f64| ((edge_hz / self.bin_hz).ceil() as usize).min(BINS - 1);
        bin(hz.start)..bin(hz.end)
    }

    fn windows(&self, channel: usize) -> impl Iterator<Item = &[Complex64]> {
        self.by_channel[channel].chunks(BINS)
    }

    /// The variance of white noise with the median power of these bins; lines and outliers hardly change it.
    fn density(&self, channel: usize, bins: impl Iterator<Item = usize> + Clone) -> Option<f64> {
        let powers = self.windows(channel);
        let powers = powers.flat_map(|window| bins.clone().map(|bin| window[bin].norm_sqr()));
        // The median of the power of noise is ln 2 of its mean.
        Some(median(&mut powers.collect::<Vec<f64>>())? / LN_2)
    }

    /// The falls of the density from the lowest band to the middle one and from the middle one to the highest, over the
    /// falls of a random walk. Rounding to steps is taken off, because it hides a low pass. `None` where the rows are too
    /// far apart or the runs too short.
    pub(super) fn falls(&self, channel: usize, step: f64) -> Option<[f64; 2]> {
        if BANDS_HZ[2].end > self.bin_hz * (WINDOW / 2) as f64 {
            return None;
        }
        let rounding = step * step / 12.0;
        let walk = BANDS_HZ.map(|band| {
            let part = 0.5 * (band.start + band.end) / (self.bin_hz * WINDOW as f64);
            libm::sin(0.5 * TAU * part)
        });
        let [low, middle, high] = BANDS_HZ.map(|band| self.density(channel, self.bins(&band)));
        let own = [low?, middle?, high?].map(|of| (of - rounding).max(LEAST * rounding));
        let fall = |k: usize| own[k] / own[k + 1] * (walk[k] / walk[k + 1]).powi(2);
        Some([0, 1].map(fall)).filter(|falls| falls.iter().all(|fall| fall.is_finite()))
    }

    /// The mean power by bin; empty without windows.
    fn mean_powers(&self, channel: usize) -> Vec<f64> {
        let share = (BINS as f64) / self.by_channel[channel].len() as f64;
        let mut sums = vec![0.0; if share.is_finite() { BINS } else { 0 }];
        for window in self.windows(channel) {
            let sums = sums.iter_mut().zip(window);
            sums.for_each(|(sum, bin)| *sum += share * bin.norm_sqr());
        }
        sums
    }

    /// The noise of three channels from `first` on, which have these variances by fifth differences. `others` show the
    /// motion: the largest of their powers counts, times `to_own` in the unit of these channels squared.
    pub(super) fn fast_noise(
        &self,
        (first, white): (usize, [f64; 3]),
        others: Range<usize>,
        to_own: f64,
    ) -> Option<FastNoise> {
        let power = [0, 1, 2].map(|k| self.mean_powers(first + k));
        let others: Vec<Vec<f64>> = others.map(|channel| self.mean_powers(channel)).collect();
        let most = |of: &[Vec<f64>], bin: usize| of.iter().map(|of| of[bin]).fold(0.0, f64::max);
        let of_motion = |bin: usize| to_own * most(&others, bin) / MOVES;
        let bins = self.bins(&(FAST_HZ..f64::INFINITY));
        let level = |power: &Vec<f64>| median(&mut power.get(bins.clone())?.to_vec());
        let levels = power.iter().map(level).collect::<Option<Vec<f64>>>()?;
        let level = levels.into_iter().fold(f64::INFINITY, f64::min);
        let is_noise = |bin: &usize| {
            let of_motion = of_motion(*bin);
            of_motion < level || most(&power, *bin) > of_motion + STANDS_OUT * level
        };
        let lines = [0, 1, 2].map(|k| self.line(first + k, &power[k], &of_motion));
        let used: Vec<usize> = bins.clone().filter(is_noise).collect();
        let mut noise = self.split(first, white, &used)?;
        noise.lines = lines;
        Some(noise)
    }

    /// The strongest line of a channel with this mean power that is no motion.
    fn line(
        &self,
        channel: usize,
        power: &[f64],
        of_motion: &dyn Fn(usize) -> f64,
    ) -> Option<Line> {
        let ninth = BINS as f64 / (9.0 * self.by_channel[channel].len() as f64);
        // Power of noise over its mean: a chi-squared with two degrees of freedom for each window (Wilson and Hilferty).
        let limit = (1.0 - ninth + CLEAR * ninth.sqrt()).powi(3);
        let level = |bin: usize| {
            let beside = bin.saturating_sub(SIDE).max(LOBE)..BINS.min(bin + SIDE + 1);
            median(&mut power[beside].to_vec()).unwrap_or(0.0)
        };
        let inner = self.bins(&(FAST_HZ..f64::INFINITY)).start..BINS - LOBE;
        let over = |bin: usize| power[bin] / level(bin);
        let best = inner
            .filter(|bin| power[*bin] >= power[bin - 1].max(power[bin + 1]))
            .filter(|bin| power[*bin] > of_motion(*bin))
            .max_by(|a, b| over(*a).total_cmp(&over(*b)))?;
        let level = level(best);
        let excess: f64 = (best - LOBE..=best + LOBE)
            .map(|bin| power[bin] - level)
            .sum();
        // The shape of a line is that of the taper in third differences.
        let raw = |bin: usize| libm::log(power[bin]) + 6.0 * libm::log(sine(bin));
        let [before, here, after] = [best - 1, best, best + 1].map(raw);
        let off = 0.5 * (before - after) / (before - 2.0 * here + after).min(-1e-9);
        (power[best] > limit * level).then_some(Line {
            frequency_hz: self.bin_hz * (best as f64 + off),
            amplitude_m: (4.0 * excess.max(0.0) / WINDOW as f64).sqrt(),
        })
    }

    /// The noise of three channels in these bins, split into noise of their own and what is beyond it.
    fn split(&self, first: usize, white: [f64; 3], used: &[usize]) -> Option<FastNoise> {
        let of = |k: usize| self.windows(first + k);
        let windows = of(0).zip(of(1)).zip(of(2));
        let windows: Vec<[&[Complex64]; 3]> = windows.map(|((a, b), c)| [a, b, c]).collect();
        let by_chance = BY_CHANCE / ((windows.len() * used.len()) as f64).sqrt();
        let density = [0, 1, 2].map(|k| self.density(first + k, used.iter().copied()));
        let [Some(a), Some(b), Some(c)] = density else {
            return None;
        };
        let density = [a, b, c].map(|variance| variance.max(f64::MIN_POSITIVE));
        // A covariance from medians (Gnanadesikan and Kettenring 1972).
        let power = |i: usize, j: usize, sign: f64| {
            let scale = [density[i].sqrt(), sign * density[j].sqrt()];
            let sum =
                |of: &[&[Complex64]; 3], bin: usize| of[i][bin] / scale[0] + of[j][bin] / scale[1];
            let all = windows
                .iter()
                .flat_map(|of| used.iter().map(|&bin| sum(of, bin).norm_sqr()));
            median(&mut all.collect::<Vec<f64>>()).unwrap_or(0.0)
        };
        let correlation = Matrix3::from_fn(|i, j| match i == j {
            true => 1.0,
            false => (power(i, j, 1.0) - power(i, j, -1.0)) / (4.0 * LN_2),
        });
        let part = correlation.symmetric_eigenvalues().min().max(0.0);
        let part = if part < 1.0 - by_chance { part } else { 1.0 };
        // Fifth differences have no outliers, a density has no lines.
        let without_outliers = |k: usize| match white[k] < (1.0 - by_chance) * density[k] {
            true => white[k],
            false => density[k],
        };
        let white = [0, 1, 2].map(without_outliers);
        let own = [0, 1, 2].map(|k| white[k].min(part * density[k]));
        let mut noise = FastNoise {
            white,
            own,
            ..FastNoise::default()
        };
        // A step is in few windows.
        let size = |of: &[&[Complex64]; 3]| {
            let power = |k: usize| {
                used.iter()
                    .map(move |&bin| of[k][bin].norm_sqr() / density[k])
            };
            (0..3).flat_map(power).sum::<f64>()
        };
        let most = STANDS_OUT * median(&mut windows.iter().map(size).collect::<Vec<f64>>())?;
        let usual: Vec<_> = windows.iter().filter(|of| size(of) <= most).collect();
        let scale = own.map(|own| own.sqrt().max(f64::MIN_POSITIVE));
        let covariance = |&bin: &usize| {
            Matrix3::from_fn(|i, j| {
                let products = usual.iter().map(|of| (of[i][bin] * of[j][bin].conj()).re);
                products.sum::<f64>() / (usual.len() as f64 * scale[i] * scale[j])
            })
        };
        let by_bin: Vec<Matrix3<f64>> = used.iter().map(covariance).collect();
        let most =
            STANDS_OUT * median(&mut by_bin.iter().map(Matrix3::trace).collect::<Vec<f64>>())?;
        let (lines, rest): (Vec<Matrix3<f64>>, Vec<Matrix3<f64>>) =
            by_bin.into_iter().partition(|of| of.trace() > most);
        let even = rest.iter().sum::<Matrix3<f64>>() / rest.len().max(1) as f64;
        let lines: Matrix3<f64> = lines.into_iter().map(|of| of - even).sum();
        let beyond = even + lines * (2.0 / WINDOW as f64) - Matrix3::identity();
        if beyond.symmetric_eigenvalues().max() > by_chance {
            let scaled = |i: usize| [0, 1, 2].map(|j| beyond[(i, j)] * scale[i] * scale[j]);
            noise.beyond = [0, 1, 2].map(scaled);
        }
        Some(noise)
    }
}
