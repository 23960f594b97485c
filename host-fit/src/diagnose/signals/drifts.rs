//! Drift of a probe and of its gain, beyond the walk of the interferometers.

use super::channels::{BEAMS, HALL, LogSignals};
use super::residual::Residuals;
use crate::diagnose::finding::{Code, Finding};
use std::ops::Range;

/// Slope in standard errors that is no chance; more where few blocks tell the walk.
const ERRORS_MIN: f64 = 4.5;
/// Drift over a movement or the log, whichever is longer, that is worth a warning, m.
const DRIFT_MIN_M: f64 = 0.3e-6;
/// Change of a gain over the log that is.
const GAIN_MIN: f64 = 0.002;
/// Blocks that tell the walk of the reference, s.
const BLOCK_S: f64 = 1.0;
/// Fewest blocks.
const BLOCKS_MIN: usize = 5;
/// How much of a drift may be left over where one channel explains it.
const LEFT_SHARE: f64 = 0.3;

/// A slope and its standard error.
#[derive(Clone, Copy)]
struct Slope {
    value: f64,
    error: f64,
}

/// Names probes that drift, beams that do, and probes whose gain does.
pub(super) fn findings(log: &LogSignals, residuals: &Residuals) -> Vec<Finding> {
    let blocks = blocks(log);
    if blocks.len() < BLOCKS_MIN {
        return Vec::new();
    }
    let limit = ERRORS_MIN * (1.0 + 5.0 / blocks.len() as f64);
    let length_s = log.time_s.last().copied().unwrap_or(0.0);
    let time = residuals.unexplained(log, &log.time_s);
    let mut findings = Vec::new();
    let drifts: [Slope; 3] = std::array::from_fn(|probe| {
        let signal = log.channels[probe].values.iter().zip(&log.time_s);
        let growing: Vec<f64> = signal.map(|(s, t)| s * (t / length_s - 0.5)).collect();
        let growing = residuals.unexplained(log, &growing);
        let noise = Noise::new(log, residuals, probe, &blocks);
        let gain = noise.slope(
            log,
            &residuals.values[probe],
            &less(&growing, &time),
            &blocks,
        );
        if gain.value.abs() > GAIN_MIN.max(limit * gain.error) {
            findings.push(of_gain(log, probe, gain.value));
        }
        noise.slope(
            log,
            &residuals.values[probe],
            &less(&time, &growing),
            &blocks,
        )
    });
    findings.extend(of_drifts(log, residuals, &drifts, limit));
    findings
}

fn product(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// A regressor less what the other explains of it.
fn less(regressor: &[f64], other: &[f64]) -> Vec<f64> {
    let share = product(regressor, other) / product(other, other).max(f64::MIN_POSITIVE);
    (regressor.iter().zip(other))
        .map(|(r, o)| r - share * o)
        .collect()
}

fn blocks(log: &LogSignals) -> Vec<Range<usize>> {
    let length = log.rows_in(BLOCK_S);
    let in_segment = |segment: &Range<usize>| {
        let (start, count) = (segment.start, segment.len() / length);
        (0..count).map(move |k| start + k * length..start + (k + 1) * length)
    };
    log.segments.iter().flat_map(in_segment).collect()
}

/// White noise and the walk of the reference, as a probe sees them.
struct Noise {
    white_m: f64,
    walk_m2_per_s: f64,
}

impl Noise {
    /// The walk from the differences of neighbouring blocks, less their mean, which is drift.
    fn new(log: &LogSignals, residuals: &Residuals, probe: usize, blocks: &[Range<usize>]) -> Self {
        let values = &residuals.values[probe];
        let white_m = residuals.noise_m[probe];
        let mean =
            |block: &Range<usize>| values[block.clone()].iter().sum::<f64>() / block.len() as f64;
        let neighbours = blocks.windows(2).filter(|pair| {
            let split = log
                .segments
                .iter()
                .any(|segment| segment.start == pair[1].start);
            pair[0].end == pair[1].start && !split
        });
        let steps: Vec<f64> = neighbours
            .map(|pair| mean(&pair[1]) - mean(&pair[0]))
            .collect();
        let count = steps.len().max(1) as f64;
        let drift = steps.iter().sum::<f64>() / count;
        let squares: f64 = steps.iter().map(|step| (step - drift).powi(2)).sum();
        let of_white = 2.0 * white_m * white_m / log.rows_in(BLOCK_S) as f64;
        let variance = squares / (count - 1.0).max(1.0);
        // Noise that is not white leaves less in the means than white noise of its size.
        let variance_m2 = (variance - of_white).max(0.5 * variance);
        // Means over neighbouring blocks of a walk differ by two thirds of its variance.
        Self {
            white_m,
            walk_m2_per_s: variance_m2 / (2.0 / 3.0 * BLOCK_S),
        }
    }

    /// The slope of a residual over a regressor; its error is that of noise and walk, or what
    /// the blocks show, whichever is larger.
    fn slope(
        &self,
        log: &LogSignals,
        values: &[f64],
        over: &[f64],
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
        let shown: f64 = (blocks.iter())
            .map(|block| {
                let left = block
                    .clone()
                    .map(|row| (values[row] - value * over[row]) * over[row]);
                left.sum::<f64>().powi(2)
            })
            .sum();
        Slope {
            value,
            error: noise.max(shown).sqrt() / length,
        }
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

/// Probes that drift; where one beam explains it better than the probes, that beam.
fn of_drifts(
    log: &LogSignals,
    residuals: &Residuals,
    drifts: &[Slope; 3],
    limit: f64,
) -> Vec<Finding> {
    let longest_s = (log.segments.iter())
        .map(|segment| log.time_s[segment.end - 1] - log.time_s[segment.start])
        .fold(log.time_s.last().copied().unwrap_or(0.0), f64::max);
    let least = DRIFT_MIN_M / longest_s.max(f64::MIN_POSITIVE);
    let drifting: Vec<usize> = (0..3)
        .filter(|&i| drifts[i].value.abs() > least.max(limit * drifts[i].error))
        .collect();
    if drifting.len() > 1 {
        // A Y beam shows in all probes, in a ratio that only it has.
        let size: f64 = drifts.iter().map(|drift| drift.value * drift.value).sum();
        let mut best = (LEFT_SHARE * LEFT_SHARE * size, None);
        for (beam, name) in BEAMS.into_iter().enumerate() {
            let shape: [f64; 3] = std::array::from_fn(|i| residuals.slope(i, 3 + beam));
            let norm: f64 = shape.iter().map(|s| s * s).sum();
            let along = (0..3).map(|i| shape[i] * drifts[i].value).sum::<f64>() / norm;
            let left: f64 = (0..3)
                .map(|i| (drifts[i].value - along * shape[i]).powi(2))
                .sum();
            if left < best.0 {
                best = (left, Some(of_drift(log, name, along, "")));
            }
        }
        if let Some(beam) = best.1 {
            return vec![beam];
        }
    }
    let beam = |i: usize| {
        if i == 2 {
            " (a drift of ifm_x looks the same)"
        } else {
            ""
        }
    };
    (drifting.into_iter())
        .map(|i| of_drift(log, HALL[i], drifts[i].value, beam(i)))
        .collect()
}

fn of_drift(log: &LogSignals, name: &str, m_per_s: f64, or: &str) -> Finding {
    let message = format!(
        "{name} drifts by {:+.3} um/s within the movements{or}: let it warm up, and record the log again",
        m_per_s * 1e6,
    );
    Finding {
        channel: Some(name.to_owned()),
        value: Some(m_per_s * 1e6),
        unit: Some("um/s"),
        ..log.warning(Code::Drift, message)
    }
}
