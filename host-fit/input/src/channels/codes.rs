//! The codes of a channel: their step, bits that never change, and jumps where a counter overflows.

use super::signal::Signal;
use crate::stage::Range;
use crate::statistics::quantile;

/// A bit is stuck if it is set, or clear, in this share of the rows or more.
const STUCK: f64 = 0.99;
/// The span of the values is at least this many times the period of a bit that is judged.
const PERIODS: f64 = 2.0;
/// Share of the rows on either side that are not in the span: outliers, and the turning points of motion.
const ENDS: f64 = 0.02;
/// Rows that give the span, at most.
const SOME: usize = 2000;
/// A counter has at least this many bits.
const COUNTER_BITS: f64 = 10.0;
/// Values that overflow span this share of their range, and jump by it.
const FULL: f64 = 0.98;

/// The greatest common divisor of all differences of the values; 0 if all values are the same.
pub(super) fn step(signal: &Signal) -> f64 {
    let values = &signal.values;
    let differences = values.iter().map(|value| (value - values[0]).abs() as u64);
    differences.fold(0, |step, difference| gcd(difference, step)) as f64
}

const fn gcd(mut a: u64, mut b: u64) -> u64 {
    while b != 0 {
        (a, b) = (b, a % b);
    }
    a
}

/// The bits above the step of the codes that never change, though the values span their period.
pub(super) fn stuck_bits(signal: &Signal, step: f64) -> Vec<u32> {
    let values = &signal.values;
    let mut some: Vec<f64> = values
        .iter()
        .step_by(values.len().div_ceil(SOME).max(1))
        .copied()
        .collect();
    let mut end = |share| quantile(&mut some, share).unwrap_or(0.0);
    let span = end(1.0 - ENDS) - end(ENDS);
    let is_stuck = |bit: &u32| {
        let ones = signal
            .values
            .iter()
            .filter(|value| (**value as i64 >> bit) & 1 == 1);
        let share = ones.count() as f64 / signal.values.len() as f64;
        share.max(1.0 - share) >= STUCK
    };
    let size = |bit: &u32| (1u64 << bit) as f64;
    let bits = (0..32).skip_while(|bit| size(bit) < step);
    bits.take_while(|bit| 2.0 * PERIODS * size(bit) <= span)
        .filter(is_stuck)
        .collect()
}

/// The bits of a counter that overflows, and how often: changes as large as the span of the values, which is its range.
pub(super) fn overflows(signal: &Signal) -> Option<(u32, usize)> {
    let span = Range::around(signal.values.iter().copied()).width();
    let bits = (span + 1.0).log2().round();
    let pairs = signal.runs().flat_map(|run| run.windows(2));
    let is_overflow = |pair: &&[f64]| (pair[1] - pair[0]).abs() > FULL * bits.exp2();
    let is_full = (FULL * bits.exp2()..=bits.exp2()).contains(&span) && bits >= COUNTER_BITS;
    let count = pairs.filter(is_overflow).count();
    (is_full && count > 1).then_some((bits as u32, count))
}
