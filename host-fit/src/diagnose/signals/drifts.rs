//! Drift of a channel and of the gain of a probe, beyond the walk of the interferometers.

use super::channels::{BEAMS, HALL, LogSignals};
use super::residual::Residuals;
use crate::diagnose::finding::{Code, Finding};
use rayon::prelude::*;
use std::ops::Range;

/// Slope in standard errors that is no chance.
const ERRORS_MIN: f64 = 5.0;
/// A standard error from the scatter of few values is larger by this over their number.
const FEW: f64 = 3.0;
/// Drift over the log that is worth a warning, m.
const DRIFT_MIN_M: f64 = 2e-6;
/// Change of a gain over the log that is.
const GAIN_MIN: f64 = 0.003;
/// Blocks that tell the walk of the reference, s, and how many at least.
const BLOCK_S: f64 = 1.0;
const BLOCKS_MIN: usize = 5;
/// Movements whose offsets show a trend.
const TREND_MIN: usize = 12;
/// Ratio of von Neumann below which the offsets are no resets of their own but a walk.
const WHITE_MIN: f64 = 1.2;
/// By how much more, in squares of standard errors, a beam explains drifts than one probe.
const BEAM_MIN: f64 = 9.0;
/// What is left unexplained by one channel where several drift, in parts of all.
const LEFT_MAX: f64 = 0.1;

/// A slope and its standard error.
#[derive(Clone, Copy)]
struct Slope {
    value: f64,
    error: f64,
}

impl Slope {
    fn in_errors(self) -> f64 {
        self.value / self.error.max(f64::MIN_POSITIVE)
    }

    fn is_clear(self, least: f64) -> bool {
        self.value.abs() > least.max(ERRORS_MIN * self.error)
    }
}

/// Names channels that drift, and probes whose gain does. And what is left of the probes without
/// their drift, m: of a log long enough to tell one.
pub(super) fn findings(
    log: &LogSignals,
    residuals: &Residuals,
) -> (Vec<Finding>, Option<[Vec<f64>; 3]>) {
    let blocks = blocks(log);
    if blocks.len() < BLOCKS_MIN {
        return (Vec::new(), None);
    }
    let (start_s, end_s) = (
        log.time_s[blocks[0].start],
        log.time_s[blocks[blocks.len() - 1].end - 1],
    );
    let length_s = end_s - start_s;
    let slopes = |k: usize| {
        let signal = log.channels[k].values.iter().zip(&log.time_s);
        let growing: Vec<f64> = signal
            .map(|(s, t)| s * ((t - start_s) / length_s - 0.5))
            .collect();
        // The values by least squares, so that what is left without the drifts is the noise.
        let [time, growing, values] =
            residuals.unexplained(log, k, [&log.time_s, &growing, &residuals.values[k]]);
        let (of_time, of_growing) = (less(&time, &growing), less(&growing, &time));
        let without_drift = less(&values, &of_time);
        let left = less(&without_drift, &growing);
        let slope = |over: &[f64]| {
            let noise = Noise::new(log, &left, over, residuals.noise_m[k], &blocks);
            noise.slope(log, &values, over, &left, &blocks)
        };
        ((slope(&of_growing), slope(&of_time)), without_drift)
    };
    let (found, without_drift): (Vec<(Slope, Slope)>, Vec<Vec<f64>>) =
        (0..3).into_par_iter().map(slopes).unzip();
    let (gains, drifts): (Vec<Slope>, Vec<Slope>) = found.into_iter().unzip();
    let clear = gains
        .iter()
        .enumerate()
        .filter(|(_, gain)| gain.is_clear(GAIN_MIN));
    let mut findings: Vec<Finding> = clear.map(|(k, gain)| of_gain(log, k, gain.value)).collect();
    let least = DRIFT_MIN_M / length_s;
    let trends = (0..3).map(|k| trend(log, residuals, k)).collect();
    for slopes in [Some(drifts), trends].into_iter().flatten() {
        let of = drifting(log, residuals, &slopes, least);
        if !of.is_empty() {
            findings.extend(of);
            break;
        }
    }
    (findings, without_drift.try_into().ok())
}

fn product(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// What the rows of a block tell of the slope over a regressor.
fn told(over: &[f64], block: &Range<usize>) -> f64 {
    product(&over[block.clone()], &over[block.clone()])
}

/// A regressor less what the other explains of it.
fn less(regressor: &[f64], other: &[f64]) -> Vec<f64> {
    let share = product(regressor, other) / product(other, other).max(f64::MIN_POSITIVE);
    (regressor.iter().zip(other))
        .map(|(r, o)| r - share * o)
        .collect()
}

/// Those of which at least half of the rows are used.
fn blocks(log: &LogSignals) -> Vec<Range<usize>> {
    let length = log.rows_in(BLOCK_S);
    let in_segment = |segment: &Range<usize>| {
        let (start, count) = (segment.start, segment.len() / length);
        (0..count).map(move |k| start + k * length..start + (k + 1) * length)
    };
    let blocks = log.segments.iter().flat_map(in_segment);
    blocks.filter(|block| log.is_mostly_used(block)).collect()
}

/// White noise and the walk of the reference, as a probe sees them.
struct Noise {
    white_m: f64,
    walk_m2_per_s: f64,
}

impl Noise {
    /// The walk from the differences of neighbouring blocks of residuals without drift, each counted
    /// by what its blocks tell of the slope over `over`: while the stage rests they tell nothing of a
    /// gain, nor of what the model leaves unexplained when it moves.
    fn new(
        log: &LogSignals,
        values: &[f64],
        over: &[f64],
        white_m: f64,
        blocks: &[Range<usize>],
    ) -> Self {
        let mean =
            |block: &Range<usize>| values[block.clone()].iter().sum::<f64>() / block.len() as f64;
        let starts = |row: usize| log.segments.iter().any(|segment| segment.start == row);
        let (mut squares, mut weights) = (0.0, f64::MIN_POSITIVE);
        for pair in blocks.windows(2) {
            if pair[0].end == pair[1].start && !starts(pair[1].start) {
                let weight = told(over, &pair[0]) + told(over, &pair[1]);
                squares += weight * (mean(&pair[1]) - mean(&pair[0])).powi(2);
                weights += weight;
            }
        }
        let of_white = 2.0 * white_m * white_m / log.rows_in(BLOCK_S) as f64;
        let variance = squares / weights;
        // Noise that is not white leaves less in the means than white noise of its size.
        let variance_m2 = (variance - of_white).max(0.5 * variance);
        // Means over neighbouring blocks of a walk differ by two thirds of its variance.
        Self {
            white_m,
            walk_m2_per_s: variance_m2 / (2.0 / 3.0 * BLOCK_S),
        }
    }

    /// The slope of a residual over a regressor; its error is that of noise and walk, or what
    /// the blocks show of the residual without drift, whichever is larger.
    fn slope(
        &self,
        log: &LogSignals,
        values: &[f64],
        over: &[f64],
        left: &[f64],
        blocks: &[Range<usize>],
    ) -> Slope {
        let length = product(over, over).max(f64::MIN_POSITIVE);
        let value = product(values, over) / length;
        let mut of_walk = 0.0;
        for segment in &log.segments {
            let mut rest = 0.0;
            for row in segment.clone().rev() {
                rest += over[row];
                of_walk += rest * rest;
            }
        }
        let noise =
            self.white_m * self.white_m * length + self.walk_m2_per_s * log.period_s * of_walk;
        let shown = |block: &Range<usize>| {
            let sum = product(&left[block.clone()], &over[block.clone()]);
            sum * sum
        };
        let shown: f64 = blocks.iter().map(shown).sum();
        let told: Vec<f64> = blocks.iter().map(|block| told(over, block)).collect();
        // Blocks that count alike, as many as tell as much.
        let sum: f64 = told.iter().sum();
        let count = (sum * sum / product(&told, &told).max(f64::MIN_POSITIVE)).max(1.0);
        Slope {
            value,
            error: (1.0 + FEW / count) * noise.max(shown).sqrt() / length,
        }
    }
}

/// The trend of the offsets of a probe from segment to segment, m/s; `None` where they do not
/// scatter by themselves.
fn trend(log: &LogSignals, residuals: &Residuals, probe: usize) -> Option<Slope> {
    let offsets: Vec<(f64, f64)> = (log.segments.iter())
        .zip(residuals.offsets_m(probe))
        .filter(|(segment, _)| log.usable[(*segment).clone()].contains(&true))
        .map(|(segment, offset_m)| {
            let ends = log.time_s[segment.start] + log.time_s[segment.end - 1];
            (0.5 * ends, offset_m)
        })
        .collect();
    let n = offsets.len() as f64;
    if offsets.len() < TREND_MIN {
        return None;
    }
    let mean = |of: fn(&(f64, f64)) -> f64| offsets.iter().map(of).sum::<f64>() / n;
    let (mean_s, mean_m) = (mean(|o| o.0), mean(|o| o.1));
    let (mut tt, mut tm) = (0.0, 0.0);
    for (t, m) in &offsets {
        tt += (t - mean_s) * (t - mean_s);
        tm += (t - mean_s) * (m - mean_m);
    }
    let value = tm / tt;
    let left: Vec<f64> = (offsets.iter())
        .map(|(t, m)| m - mean_m - value * (t - mean_s))
        .collect();
    let squares = product(&left, &left);
    let steps: f64 = (left.windows(2))
        .map(|pair| (pair[1] - pair[0]).powi(2))
        .sum();
    (steps > WHITE_MIN * squares).then(|| Slope {
        value,
        error: (1.0 + FEW / n) * (squares / (n - 2.0) / tt).sqrt(),
    })
}

/// The channels whose drift explains the slopes (m/s) of the probes: one beam, or else probes.
fn drifting(log: &LogSignals, residuals: &Residuals, slopes: &[Slope], least: f64) -> Vec<Finding> {
    if !slopes.iter().any(|slope| slope.is_clear(least)) {
        return Vec::new();
    }
    let all: f64 = slopes.iter().map(|slope| slope.in_errors().powi(2)).sum();
    let most = slopes
        .iter()
        .map(|slope| slope.in_errors().powi(2))
        .fold(0.0, f64::max);
    let mean = residuals.mean_of_errors(log);
    let mut best = (most + BEAM_MIN, None);
    for (beam, name) in BEAMS.into_iter().enumerate() {
        let shape = mean[3 + beam];
        let (mut with, mut by) = (0.0, 0.0);
        for (slope, shape) in slopes.iter().zip(shape) {
            with += shape * slope.value / (slope.error * slope.error);
            by += shape * shape / (slope.error * slope.error);
        }
        let explained = with * with / by;
        if explained > best.0 {
            best = (explained, Some((name, with / by)));
        }
    }
    match best {
        (explained, Some((name, m_per_s))) if all - explained < (LEFT_MAX * all).max(BEAM_MIN) => {
            vec![of_drift(log, name, m_per_s, "")]
        }
        _ => (0..3)
            .filter(|&k| {
                slopes[k].is_clear(least) && slopes[k].in_errors().powi(2) > LEFT_MAX * most
            })
            .map(|k| {
                let same = " (a drift of ifm_x looks the same)";
                of_drift(
                    log,
                    HALL[k],
                    slopes[k].value,
                    if k == 2 { same } else { "" },
                )
            })
            .collect(),
    }
}

fn of_gain(log: &LogSignals, probe: usize, change: f64) -> Finding {
    let name = HALL[probe];
    let message = format!(
        "the gain of {name} changes by {:+.2} % over the log: let the stage warm up, check the supply of this probe, and \
         record the log again",
        change * 100.0,
    );
    Finding {
        channel: Some(name.to_owned()),
        value: Some(change * 100.0),
        unit: Some("%"),
        ..log.warning(Code::GainDrift, message)
    }
}

fn of_drift(log: &LogSignals, name: &str, m_per_s: f64, or: &str) -> Finding {
    let message = format!(
        "{name} drifts by {:+.3} um/s{or}: let it warm up, and record the log again",
        m_per_s * 1e6,
    );
    Finding {
        channel: Some(name.to_owned()),
        value: Some(m_per_s * 1e6),
        unit: Some("um/s"),
        ..log.warning(Code::Drift, message)
    }
}

#[cfg(test)]
mod tests {
    use super::super::sample::{PERIOD_S, codes, only, recording};
    use super::*;

    #[test]
    fn drift_within_movements_is_named_with_its_speed() {
        let sound = recording();
        for (channel, name) in [(1, "hall_b"), (4, "ifm_y1")] {
            let mut recording = sound.clone();
            for samples in &mut recording.movements {
                for (k, sample) in samples.iter_mut().enumerate() {
                    let error_m = 0.5e-6 * k as f64 * PERIOD_S;
                    match channel {
                        0..3 => sample.hall[channel] += codes(error_m),
                        _ => sample.beams_nm[channel - 3] += (error_m * 1e9) as i64,
                    }
                }
            }
            let found = only(&recording, Code::Drift, Some(name));
            let off = found.value.expect("a speed") - 0.5;
            assert!(off.abs() < 0.12, "{off} um/s");
        }
    }

    #[test]
    fn a_gain_that_falls_is_named_in_percent() {
        let mut recording = recording();
        let rows = recording.rows() as f64;
        for (k, sample) in recording.movements.iter_mut().flatten().enumerate() {
            let gain = 1.0 - 0.03 * k as f64 / rows;
            sample.hall[0] = (f64::from(sample.hall[0]) * gain).round() as i32;
        }
        let found = only(&recording, Code::GainDrift, Some("hall_a"));
        let off = found.value.expect("a change") + 3.0;
        assert!(off.abs() < 0.3, "{off} %");
    }
}
