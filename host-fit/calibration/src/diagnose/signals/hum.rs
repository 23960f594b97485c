//! Hum: lines in the spectra of the residuals that a channel shares.

use super::channels::LogSignals;
use super::residual::{Residuals, is_seen};
use crate::diagnose::limits::CLEAR;
use crate::diagnose::limits::severity_of_share;
use crate::judge::spectrum::{Spectrum, windows};
use hallstage_input::channel::Channel;
use hallstage_input::finding::{Finding, Kind, Severity};
use std::ops::Range;

/// Longest window, s: its bins separate 50 Hz from 60 Hz.
const WINDOW_S: f64 = 2.0;
/// Lines below this many times the frequency of the motion may be terms that the model lacks.
const OF_MOTION: usize = 8;

/// The channels that hum, each at its strongest line above the motion.
pub(super) fn hum(log: &mut LogSignals, residuals: &Residuals) -> Vec<Finding> {
    let longest = log.segments.iter().map(Range::len).max().unwrap_or(0);
    let length = longest
        .min((WINDOW_S / log.period_s).round() as usize)
        .max(1);
    let mut windows = windows(&log.segments, length);
    // Windows with few residuals would lower the mean.
    windows.retain(|window| {
        let used = log.usable[window.clone()].iter().filter(|used| **used);
        2 * used.count() >= length
    });
    let Some(middle) = windows.get(windows.len() / 2) else {
        return Vec::new();
    };
    let slopes = residuals.slopes(log, middle.start);
    let spectrum = |values: &Vec<f64>| Spectrum::new(values, &windows);
    let raw: Vec<Spectrum> = log.channels.iter().map(spectrum).collect();
    let motion = raw[3..6].iter().map(Spectrum::highest).max().unwrap_or(0);
    // Channel, amplitude over the noise of the probe, bin.
    let mut lines: Vec<(usize, f64, usize)> = Vec::new();
    for (probe, values) in residuals.values.iter().enumerate() {
        let residual = spectrum(values);
        for bin in residual.lines(OF_MOTION * motion, CLEAR) {
            let shown_m = residual.amplitude(bin);
            let in_probe = |k: usize| slopes[k][probe].abs() * raw[k].amplitude(bin);
            let seen = (0..raw.len()).filter(|&k| is_seen(in_probe(k), shown_m));
            let best = seen.max_by(|&a, &b| in_probe(a).total_cmp(&in_probe(b)));
            lines.extend(best.map(|channel| (channel, shown_m / residuals.noise_m[probe], bin)));
        }
    }
    let finding = |channel: usize| {
        let own = lines.iter().filter(|line| line.0 == channel);
        let &(_, noises, bin) = own.max_by(|a, b| a.1.total_cmp(&b.1))?;
        let kind = Kind::Hum {
            frequency_hz: bin as f64 / (length as f64 * log.period_s),
            amplitude_um: 1e6 * raw[channel].amplitude(bin),
        };
        // The increase of the noise.
        let share = (1.0 + 0.5 * noises * noises).sqrt() - 1.0;
        let found = Finding::new(kind).with_severity(severity_of_share(share).min(Severity::Warn));
        Some(found.with_channel(Channel::SINGLE[channel]))
    };
    (0..raw.len()).filter_map(finding).collect()
}

#[cfg(test)]
mod tests {
    use super::super::sample_for_tests::{PERIOD_S, codes, only, recording};
    use hallstage_input::channel::Channel;
    use hallstage_input::finding::Code;
    use std::f64::consts::TAU;

    #[test]
    fn hum_is_named_once_with_its_frequency_and_channel() {
        let sound = recording();
        for (channel, name, frequency_hz) in [
            (2, Channel::HallC, 50.0),
            (3, Channel::BeamX, 61.3),
            (4, Channel::BeamY1, 50.0),
        ] {
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
            let off_hz = found.value().expect("a frequency") - frequency_hz;
            assert!(off_hz.abs() < 0.26, "{off_hz} Hz");
        }
    }
}
