//! One trace of a scope: the codes of a sensor, and their properties without a model.

use hallstage_input::channels::{NOISY, white_noise};
use hallstage_input::statistics::median;
use realfft::RealFftPlanner;
use runtime::frame::CodeWindow;
use std::f64::consts::TAU;

/// Most values of a noise or a spectrum: the last of the window.
pub(super) const RECENT: usize = 1024;

/// A sensor that repeats its code for this long stands still, s. Sound noise changes the code in nearly each row.
const STILL_S: f64 = 0.1;

/// The scale of a sensor.
#[derive(Clone, Copy, Debug)]
pub struct Scale {
    /// The name of the sensor.
    pub name: &'static str,
    /// What a code stands for, in `unit`.
    pub per_code: f64,
    /// The unit of the display.
    pub unit: &'static str,
    /// Codes between the rails of the converter.
    pub window: CodeWindow,
}

/// The names of the six sensors.
const NAMES: [&str; 6] = ["Hall A", "Hall B", "Hall C", "Gap 1", "Gap 2", "Gap 3"];

impl Scale {
    /// Of the Hall probes and of the gaps: in `unit`, per code of each, with the codes of their converters.
    pub fn six(unit: &'static str, [hall, gaps]: [(f64, CodeWindow); 2]) -> [Self; 6] {
        [0, 1, 2, 3, 4, 5].map(|sensor| {
            let (per_code, window) = if sensor < 3 { hall } else { gaps };
            Self {
                name: NAMES[sensor],
                per_code,
                unit,
                window,
            }
        })
    }
}

/// What the codes of a window show, in the unit of their scale.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Facts {
    /// Smallest and largest value.
    pub(super) range: [f64; 2],
    /// White noise; `None` for few rows.
    pub(super) noise: Option<f64>,
    /// The noise over the median noise of the kind.
    pub(super) to_siblings: f64,
    /// Rows at a rail of the converter.
    pub(super) at_rail: usize,
    /// Rows without a code.
    pub(super) missing: usize,
    /// For how long the last code has repeated, s.
    pub(super) still_s: f64,
}

impl Facts {
    /// Of the codes of one sensor in a window of `rows`.
    pub(super) fn new(codes: &[i32], rows: usize, scale: &Scale, period_s: f64) -> Self {
        let value = |code: &i32| f64::from(*code) * scale.per_code;
        let ends = [codes.iter().min(), codes.iter().max()];
        let recent: Vec<f64> = recent(codes).iter().map(value).collect();
        let last = codes.last();
        let still = codes.iter().rev().take_while(|code| Some(*code) == last);
        Self {
            range: ends.map(|code| code.map_or(0.0, value)),
            noise: white_noise(&recent),
            to_siblings: 1.0,
            at_rail: codes
                .iter()
                .filter(|code| !scale.window.contains(**code))
                .count(),
            missing: rows.saturating_sub(codes.len()),
            still_s: still.count() as f64 * period_s,
        }
    }

    /// What is wrong, in words; empty if nothing is.
    pub(super) fn warning(&self) -> String {
        if self.missing > 0 {
            return format!("NO CODE in {} rows", self.missing);
        }
        if self.at_rail > 0 {
            return format!("AT A RAIL in {} rows", self.at_rail);
        }
        if self.still_s > STILL_S {
            return format!("STANDS STILL for {:.1} s", self.still_s);
        }
        match self.to_siblings > NOISY {
            true => format!("NOISY: {:.1} times its kind", self.to_siblings),
            false => String::new(),
        }
    }
}

/// Compares the noise of the three sensors of a kind.
pub(super) fn compare(kind: &mut [Facts]) {
    let mut noise: Vec<f64> = kind.iter().filter_map(|facts| facts.noise).collect();
    let usual = median(&mut noise).filter(|noise| *noise > 0.0);
    for facts in kind {
        let ratio = facts.noise.zip(usual).map(|(own, usual)| own / usual);
        facts.to_siblings = ratio.unwrap_or(1.0);
    }
}

fn recent(codes: &[i32]) -> &[i32] {
    codes
        .get(codes.len().saturating_sub(RECENT)..)
        .unwrap_or_default()
}

/// The amplitude spectrum of the last codes: frequency in Hz and logarithm (base 10) of the amplitude.
pub(super) fn spectrum(codes: &[i32], scale: &Scale, period_s: f64) -> Vec<(f64, f64)> {
    let codes = recent(codes);
    let rows = codes.len() / 2 * 2;
    if rows < 4 {
        return Vec::new();
    }
    let mean = codes.iter().map(|code| f64::from(*code)).sum::<f64>() / codes.len() as f64;
    // Hann's taper, which halves an amplitude.
    let taper = |row: usize| 0.5 - 0.5 * (TAU * row as f64 / rows as f64).cos();
    let tapered = codes.iter().take(rows).enumerate();
    let mut values: Vec<f64> = tapered
        .map(|(row, code)| taper(row) * (f64::from(*code) - mean))
        .collect();
    let transform = RealFftPlanner::new().plan_fft_forward(rows);
    let mut bins = transform.make_output_vec();
    if transform.process(&mut values, &mut bins).is_err() {
        return Vec::new();
    }
    let to_unit = 4.0 * scale.per_code / rows as f64;
    let place = |(bin, value): (usize, &realfft::num_complex::Complex64)| {
        let frequency_hz = bin as f64 / (rows as f64 * period_s);
        (frequency_hz, (value.norm() * to_unit).max(1e-9).log10())
    };
    bins.iter().enumerate().skip(2).map(place).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const SCALE: Scale = Scale {
        name: "Hall A",
        per_code: 0.1,
        unit: "um",
        window: CodeWindow {
            low: -999,
            high: 999,
        },
    };

    /// A sine of 300 codes, with noise of about `noise` codes.
    fn codes_at(frequency_hz: f64, noise: f64) -> Vec<i32> {
        let code = |k: u32| {
            let hash = f64::from(k.wrapping_mul(2_654_435_761) >> 16) / 65_536.0 - 0.5;
            (300.0 * (TAU * frequency_hz * 0.002 * f64::from(k)).sin() + 3.46 * noise * hash) as i32
        };
        (0..1500).map(code).collect()
    }

    fn codes(noise: f64) -> Vec<i32> {
        codes_at(1.0, noise)
    }

    #[test]
    fn a_line_stands_in_the_spectrum_at_its_frequency_with_its_amplitude() {
        let lines = spectrum(&codes_at(50.0, 2.0), &SCALE, 0.002);
        let top = lines.into_iter().max_by(|a, b| a.1.total_cmp(&b.1));
        let (frequency_hz, amplitude) = top.expect("a line");
        assert!((frequency_hz - 50.0).abs() < 0.5, "{frequency_hz}");
        assert!((10f64.powf(amplitude) - 30.0).abs() < 5.0, "{amplitude}");
    }

    #[test]
    fn rails_still_codes_and_noise_are_named_and_a_sound_sensor_is_not() {
        let facts = |codes: &[i32]| Facts::new(codes, codes.len(), &SCALE, 0.002);
        let mut kind = [2.0, 2.1, 16.0].map(|noise| facts(&codes(noise)));
        compare(&mut kind);
        let said = kind.each_ref().map(Facts::warning);
        assert_eq!((said[0].as_str(), said[1].as_str()), ("", ""));
        assert!(said[2].contains("NOISY"), "{said:?}");
        let still = [codes(2.0), vec![7; 100]].concat();
        assert!(facts(&still).warning().contains("0.2 s"));
        let rail: Vec<i32> = codes(2.0).iter().map(|code| (4 * code).min(1000)).collect();
        assert!(facts(&rail).warning().contains("RAIL"));
        assert_eq!(facts(&[]).warning(), "");
        let lost = Facts::new(&codes(2.0), 1_510, &SCALE, 0.002);
        assert!(lost.warning().contains("NO CODE in 10"));
    }
}
