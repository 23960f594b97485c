//! Rows without a new measurement: values that are held or interpolated, and straight runs.

use super::signal::Signal;
use std::ops::Range;

/// Longest time between new values that is looked for, rows.
const EVERY_MAX: usize = 40;
/// The primes up to it.
const PRIMES: [usize; 12] = [2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37];
/// Rows of a block: new values keep their phase for so long.
const BLOCK: usize = 2000;
/// A pattern is there if its power is this many standard deviations above chance.
const PATTERN: f64 = 15.0;
/// Least share of rows that repeat the value, or continue the line, of the rows before. A line in the spectrum makes a
/// pattern, too, but no rows like these.
const SHARE: f64 = 0.45;
/// A straight run is this many times as long as the longest that chance makes in 10,000 logs.
const STRAIGHT: f64 = 2.5;

/// A run within this many steps is level: a saturated or frozen channel.
const LEVEL: f64 = 4.0;

/// New values come every few rows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SlowRate {
    /// Rows from one new value to the next.
    pub every: usize,
    /// Whether values are held in between; else they are interpolated.
    pub is_held: bool,
}

/// The rate of new values where there is not one in each row.
pub(super) fn slow(signal: &Signal, step: f64) -> Option<SlowRate> {
    let threes = || signal.runs().flat_map(|run| run.windows(3));
    let share = |is: &dyn Fn(&[f64]) -> bool| {
        let count = threes().filter(|three| is(three)).count();
        count as f64 / threes().count().max(1) as f64
    };
    let held = share(&|three| three[0] == three[1]);
    let straight = share(&|three| is_straight(three, step));
    if held.max(straight) < SHARE {
        return None;
    }
    let is_held = held >= straight;
    let blocks = match is_held {
        true => sizes(signal, step, 1, |v| v[1] - v[0]),
        false => sizes(signal, step, 2, |v| second([v[0], v[1], v[2]])),
    };
    // A pattern of n rows is one of each divisor of n, too.
    if !PRIMES.iter().any(|&every| power(&blocks, every) > PATTERN) {
        return None;
    }
    let powers = (2..=EVERY_MAX).map(|every| (every, power(&blocks, every)));
    let (every, most) = powers.max_by(|a, b| a.1.total_cmp(&b.1))?;
    (most > PATTERN).then_some(SlowRate { every, is_held })
}

/// The longest run of rows on a straight line that is not level, where chance does not make it. The noise is larger than
/// the step.
pub(super) fn straight(signal: &Signal, step: f64) -> Option<Range<usize>> {
    let (mut longest, mut lines, mut count) = (0..0, 0usize, 0usize);
    for run in signal.runs {
        let mut start = run.start;
        for (row, three) in run.clone().zip(signal.values[run.clone()].windows(3)) {
            count += 1;
            match is_straight(three, step) {
                true => lines += 1,
                false => start = row + 1,
            }
            let is_level = (signal.values[start] - three[2]).abs() <= LEVEL * step;
            if row + 3 - start > longest.len() && !is_level {
                longest = start..row + 3;
            }
        }
    }
    let share = (lines + 1) as f64 / (count + 1) as f64;
    let by_chance = libm::log(1e4 * count as f64) / -libm::log(share);
    (longest.len() as f64 > STRAIGHT * by_chance).then_some(longest)
}

fn second(three: [f64; 3]) -> f64 {
    (three[2] - three[1]) - (three[1] - three[0])
}

fn is_straight(three: &[f64], step: f64) -> bool {
    second([three[0], three[1], three[2]]).abs() <= step
}

/// The logarithms of the differences of this order, in blocks of consecutive rows.
fn sizes(signal: &Signal, step: f64, order: usize, difference: fn(&[f64]) -> f64) -> Vec<Vec<f64>> {
    let size = |rows: &[f64]| libm::log2(difference(rows).abs().max(0.5 * step));
    let blocks = signal.runs().flat_map(|run| run.chunks(BLOCK));
    blocks
        .map(|block| block.windows(order + 1).map(size).collect())
        .collect()
}

/// The power between the rows modulo `every`, in standard deviations above its mean by chance.
fn power(blocks: &[Vec<f64>], every: usize) -> f64 {
    let (mut power, mut freedom) = (0.0, 0.0);
    for block in blocks.iter().filter(|block| block.len() >= 4 * every) {
        let count = block.len() as f64;
        let mean = block.iter().sum::<f64>() / count;
        let variance = block.iter().map(|size| (size - mean).powi(2)).sum::<f64>() / count;
        if variance == 0.0 {
            continue;
        }
        let between = (0..every).map(|phase| {
            let own = || block[phase..].iter().step_by(every);
            let count = own().count() as f64;
            count * (own().sum::<f64>() / count - mean).powi(2)
        });
        power += between.sum::<f64>() / variance;
        freedom += every as f64 - 1.0;
    }
    (power - freedom) / (2.0 * f64::max(freedom, 1.0)).sqrt()
}
