//! Spectral density of a channel in bands above the motion.

use super::signal::Signal;
use crate::statistics::median;
use realfft::RealFftPlanner;
use std::f64::consts::{LN_2, TAU};
use std::ops::Range;

/// Rows of a window: bins of 2 Hz at 500 rows a second.
const WINDOW: usize = 256;
/// The bands, Hz: the lowest is above the motion, the highest below half the rate of 500 rows a second.
const BANDS_HZ: [Range<f64>; 3] = [10.0..30.0, 60.0..90.0, 160.0..240.0];
/// Least density, in variances of rounding.
const LEAST: f64 = 0.05;
/// A taper with side lobes of -92 dB (Blackman and Harris), and the sum of its squares per row.
const TAPER: [f64; 4] = [0.35875, -0.48829, 0.14128, -0.01168];
const TAPER_POWER: f64 = 0.258;

/// The falls of the density from the lowest band to the middle one and from the middle one to the highest, over the
/// falls of a random walk. Rounding to steps is taken off, because it hides a low pass.
pub(super) fn falls(signal: &Signal, step: f64, period_s: f64) -> Option<[f64; 2]> {
    let rounding = step * step / 12.0;
    let own = |density: f64| (density - rounding).max(LEAST * rounding);
    let densities = densities(signal, period_s)?.map(own);
    let walk = BANDS_HZ.map(|band| libm::sin(0.25 * TAU * (band.start + band.end) * period_s));
    let fall = |k: usize| densities[k] / densities[k + 1] * (walk[k] / walk[k + 1]).powi(2);
    Some([0, 1].map(fall)).filter(|falls| falls.iter().all(|fall| fall.is_finite()))
}

/// The variance per row of the white noise with the density of each band, in squared units of the values; `None` where
/// the rows are too far apart or the runs too short.
fn densities(signal: &Signal, period_s: f64) -> Option<[f64; 3]> {
    if 2.0 * BANDS_HZ[2].end * period_s > 1.0 {
        return None;
    }
    let transform = RealFftPlanner::<f64>::new().plan_fft_forward(WINDOW);
    let (mut tapered, mut bins) = (transform.make_input_vec(), transform.make_output_vec());
    let wave = |k: usize, n: usize| libm::cos(TAU * (n * k) as f64 / WINDOW as f64);
    let taper = |k: usize| (0..4).map(|n| TAPER[n] * wave(k, n)).sum();
    let taper: Vec<f64> = (0..WINDOW).map(taper).collect();
    let by_bin = |edge_hz: f64| (edge_hz * period_s * WINDOW as f64).ceil() as usize;
    let bands = BANDS_HZ.map(|band| by_bin(band.start)..by_bin(band.end));
    // The power of third differences, which bring the motion below the noise.
    let gain = |bin: usize| (2.0 * libm::sin(0.5 * TAU * bin as f64 / WINDOW as f64)).powi(6);
    let gains: Vec<f64> = (0..=WINDOW / 2).map(gain).collect();
    let mut powers = [const { Vec::new() }; 3];
    for run in signal.runs() {
        let differences: Vec<f64> = run
            .windows(4)
            .map(|v| (v[3] - v[0]) - 3.0 * (v[2] - v[1]))
            .collect();
        for window in differences.windows(WINDOW).step_by(WINDOW / 2) {
            let values = tapered.iter_mut().zip(window).zip(&taper);
            values.for_each(|((tapered, value), taper)| *tapered = value * taper);
            // It fails for vectors of another length only.
            if transform.process(&mut tapered, &mut bins).is_err() {
                return None;
            }
            for (powers, band) in powers.iter_mut().zip(&bands) {
                powers.extend(band.clone().map(|bin| bins[bin].norm_sqr() / gains[bin]));
            }
        }
    }
    let [low, middle, high] = &mut powers;
    // The median of the power of noise is ln 2 of its mean.
    let density =
        |powers: &mut Vec<f64>| Some(median(powers)? / (LN_2 * TAPER_POWER * WINDOW as f64));
    Some([density(low)?, density(middle)?, density(high)?])
}
