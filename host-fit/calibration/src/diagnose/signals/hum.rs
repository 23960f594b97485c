//! Hum: lines in the spectra of the residuals that one channel has, too.

use super::channels::LogSignals;
use super::residual::{Residuals, is_seen};
use super::spectrum::{Spectrum, windows};
use crate::finding::{Code, Finding, Severity};
use std::collections::BTreeMap;
use std::ops::Range;

/// Longest window, s: its bins tell 50 Hz from 60.
const WINDOW_S: f64 = 2.0;
/// Below this many times the frequency of the motion residuals may hold what the model does not describe.
const OF_MOTION: usize = 8;
/// Amplitude in parts of the noise of a probe from which a line is worth a warning: it makes the noise 2 % more.
const WARN_MIN: f64 = 0.3;

/// Names the channels that hum, each at its strongest line above the motion.
pub(super) fn hum(log: &mut LogSignals, residuals: &Residuals) -> Vec<Finding> {
    let longest = log.segments.iter().map(Range::len).max().unwrap_or(0);
    let length = longest.min((WINDOW_S / log.period_s).round().max(1.0) as usize);
    let mut windows = windows(&log.segments, length.max(1));
    // A mean over windows without residuals would count as if all of them had gone in.
    windows.retain(|window| {
        let used = log.usable[window.clone()].iter().filter(|used| **used);
        2 * used.count() >= window.len()
    });
    let Some(middle) = windows.get(windows.len() / 2) else {
        return Vec::new();
    };
    let slopes = residuals.slopes(log, middle.start);
    let spectrum = |values: &Vec<f64>| Spectrum::new(values, &windows);
    let raw: Vec<Spectrum> = log.channels.iter().map(|c| spectrum(&c.values)).collect();
    let motion = raw[3..6].iter().map(Spectrum::highest).max().unwrap_or(0);
    // By channel: amplitude in parts of the noise of a probe, and in the channel, m; and bin.
    let mut found: BTreeMap<usize, (f64, f64, usize)> = BTreeMap::new();
    for (probe, values) in residuals.values.iter().enumerate() {
        let residual = spectrum(values);
        for bin in residual.lines(OF_MOTION * motion) {
            let shown_m = residual.amplitude(bin);
            let in_probe =
                |channel: usize| slopes[channel][probe].abs() * raw[channel].amplitude(bin);
            let channels = (0..raw.len()).filter(|&channel| is_seen(in_probe(channel), shown_m));
            let best = channels.max_by(|&a, &b| in_probe(a).total_cmp(&in_probe(b)));
            if let Some(channel) = best {
                let noises = shown_m / residuals.noise_m[probe];
                let line = (noises, raw[channel].amplitude(bin), bin);
                let strongest = found.entry(channel).or_insert(line);
                if line.0 > strongest.0 {
                    *strongest = line;
                }
            }
        }
    }
    let finding = |(channel, (noises, size_m, bin)): (usize, (f64, f64, usize))| {
        let name = log.channels[channel].name;
        let frequency_hz = bin as f64 / (length as f64 * log.period_s);
        let message = format!(
            "{name} hums at {frequency_hz:.1} Hz with an amplitude of {:.2} um: look for mains (50 or 60 Hz and multiples) in \
             its cable and supply, or for a vibration of that part",
            size_m * 1e6,
        );
        let severity = match noises < WARN_MIN {
            true => Severity::Note,
            false => Severity::Warn,
        };
        let found = log.warning(Code::Hum, message).severe(severity);
        found.on(name).of(frequency_hz, "Hz")
    };
    found.into_iter().map(finding).collect()
}

#[cfg(test)]
mod tests {
    use super::super::sample_for_tests::{PERIOD_S, codes, only, recording};
    use crate::finding::Code;
    use std::f64::consts::TAU;

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
            assert!(off_hz.abs() < 0.26, "{off_hz} Hz");
        }
    }
}
