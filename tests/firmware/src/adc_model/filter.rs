//! The digital filter of the ADS131M08: sinc3.

use super::{Input, Row};
use std::sync::OnceLock;

/// Period of the modulators, ns.
pub const T_MOD_NS: u64 = 250;

/// A conversion: when it ended, and what its filter saw.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Conversion {
    /// When it ended, ns.
    pub end_ns: u64,
    /// The filter has no data from before, ns.
    pub from_ns: u64,
    /// Oversampling.
    pub osr: u64,
}

/// Weights of a sinc3 filter, the newest sample first: three boxes convolved.
fn sinc3(osr: u64) -> Vec<f64> {
    let n = osr as usize;
    let convolve = |a: &[f64]| -> Vec<f64> {
        let at = |k: usize| a.get(k).copied().unwrap_or(0.0);
        (0..a.len() + n - 1)
            .map(|k| (k.saturating_sub(n - 1)..=k).map(at).sum::<f64>() / n as f64)
            .collect()
    };
    convolve(&convolve(&vec![1.0 / n as f64; n]))
}

/// Weights of a filter, the newest sample first, and the sum of those before each of them.
struct Weights {
    of: Vec<f64>,
    sums: Vec<f64>,
}

impl Weights {
    fn new(of: Vec<f64>) -> Self {
        let mut sums = vec![0.0];
        for weight in &of {
            sums.push(sums[sums.len() - 1] + weight);
        }
        Self { of, sums }
    }
}

/// The weights by oversampling 128 to 1024, made once.
fn weights(osr: u64) -> &'static Weights {
    static ALL: [OnceLock<Weights>; 4] = [const { OnceLock::new() }; 4];
    ALL[(osr / 128).ilog2() as usize].get_or_init(|| Weights::new(sinc3(osr)))
}

/// The codes of a conversion: the mean over the window of its filter, with zeros for samples
/// from before the filter took data.
pub fn codes(conversion: Conversion, input: &Input) -> Row {
    let Conversion {
        end_ns,
        from_ns,
        osr,
    } = conversion;
    let weights = weights(osr);
    let samples = weights
        .of
        .len()
        .min(((end_ns - from_ns) / T_MOD_NS) as usize);
    let first_ns = end_ns - samples as u64 * T_MOD_NS;
    let sum = match input.constant(first_ns, end_ns - 1) {
        Some(row) if samples == weights.of.len() => return row,
        Some(row) => row.map(|code| f64::from(code) * weights.sums[samples]),
        None => {
            let mut sum = [0.0; 6];
            for (k, weight) in (1u64..).zip(&weights.of[..samples]) {
                for (sum, code) in sum.iter_mut().zip(input.at(end_ns - k * T_MOD_NS)) {
                    *sum += weight * code;
                }
            }
            sum
        }
    };
    sum.map(|code| (code.round() as i32).clamp(-0x80_0000, 0x7f_ffff))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Equation 6: a straight motion is delayed by half the filter's length.
    #[test]
    fn a_motion_is_seen_as_it_was_48_us_before_the_conversion_ended() {
        let mut input = Input::moving(vec![[0; 6], [2_000_000; 6]], 2000, 0);
        input.start_ns = Some(0);
        let conversion = Conversion {
            end_ns: 1_000_000,
            from_ns: 0,
            osr: 128,
        };
        let late_ns = 1_000_000 - codes(conversion, &input)[0];
        // 382 samples of 250 ns, the newest one 250 ns old: 47.875 us.
        assert_eq!(late_ns, 47_875);
        // A whole period of the data rate is a notch.
        let weights = sinc3(128);
        let wave = |k: usize| (k as f64 * std::f64::consts::TAU / 128.0).cos();
        let gain: f64 = weights.iter().enumerate().map(|(k, w)| w * wave(k)).sum();
        assert!(gain.abs() < 1e-12 && (weights.iter().sum::<f64>() - 1.0).abs() < 1e-12);
    }
}
