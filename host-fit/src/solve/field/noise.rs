//! The noise of a log from the residuals of a fit: white at the probes, a walk of the reference.

use super::blocks::{Block, Rows};
use super::probe::Probe;
use super::terms::{COUNT, PER_PROBE};
use super::whiten::{Noise, UNKNOWNS};
use nalgebra::DMatrix;
use rayon::prelude::*;
use runtime::geometry::inverse_rows;

/// Length over which the reference's walk is averaged, s.
const SPAN_S: f64 = 1.0;
/// A span shorter than this part of [`SPAN_S`] is left out.
const PART_MIN: f64 = 0.5;

/// White noise of the probes A, B, C, mm: from second differences of the residuals, whose
/// variance is six times that of the noise, at least `least_mm` (what rounding to codes leaves).
pub fn white_mm(
    rows: &Rows,
    probes: &[Probe; 3],
    lag_s: f64,
    offsets_mm: &[[f64; 3]],
    least_mm: f64,
) -> [f64; 3] {
    let movements: Vec<_> = rows.movement_rows().zip(offsets_mm).collect();
    let of_movement = |(range, offset): &(std::ops::Range<usize>, &[f64; 3])| {
        let residuals: Vec<[f64; 3]> = rows.rows[range.clone()]
            .iter()
            .map(|row| {
                let planar_mm = row.planar_mm(lag_s, **offset);
                [0, 1, 2].map(|k| row.signal_mm[k] - probes[k].signal_mm(planar_mm, row.vertical))
            })
            .collect();
        let mut squares = [0.0; 3];
        for three in residuals.windows(3) {
            for (k, sum) in squares.iter_mut().enumerate() {
                let second = (three[0][k] - 2.0 * three[1][k]) + three[2][k];
                *sum += second * second;
            }
        }
        (squares, residuals.len().saturating_sub(2))
    };
    let found: Vec<([f64; 3], usize)> = movements.par_iter().map(of_movement).collect();
    let mut squares = [0.0; 3];
    let mut count = 0;
    for (of_movement, rows) in found {
        for (sum, x) in squares.iter_mut().zip(of_movement) {
            *sum += x;
        }
        count += rows;
    }
    squares.map(|sum| (sum / (6.0 * count.max(1) as f64)).sqrt().max(least_mm))
}

/// Means over a span of about [`SPAN_S`], as poses.
struct Span {
    rows: f64,
    time_s: f64,
    /// Error of the reference, mm, mm, mrad.
    error: [f64; 3],
    /// Its variance by white noise of one row.
    white: [f64; 3],
    /// Its change by the unknowns.
    by_unknown: [[f64; UNKNOWNS]; 3],
}

/// The reference's walk in X, Y, Rz, per root of a second (mm, mm, mrad): from differences
/// between means of neighbouring spans of a second, less what white noise makes of them, and with
/// what the fitted parameters took of them (by their `covariance`) put back.
pub fn drift_mm(
    rows: &Rows,
    blocks: &[Block],
    white_mm: [f64; 3],
    covariance: &DMatrix<f64>,
) -> [f64; 3] {
    let mut squares = [0.0; 3];
    let mut expected = 0.0;
    for movement in &rows.movements {
        let spans = spans(&blocks[movement.clone()], white_mm);
        for pair in spans.windows(2) {
            let (a, b) = (&pair[0], &pair[1]);
            // Means over neighbouring spans of a walk differ by 2/3 of what it does from the
            // middle of one to that of the other.
            expected += (b.time_s - a.time_s) * 2.0 / 3.0;
            for (axis, sum) in squares.iter_mut().enumerate() {
                let error = b.error[axis] - a.error[axis];
                let white = a.white[axis] / a.rows + b.white[axis] / b.rows;
                let by: [f64; UNKNOWNS] =
                    std::array::from_fn(|j| b.by_unknown[axis][j] - a.by_unknown[axis][j]);
                *sum += (error * error - white) + quadratic(covariance, &by);
            }
        }
    }
    squares.map(|sum| {
        if expected > 0.0 {
            (sum.max(0.0) / expected).sqrt()
        } else {
            0.0
        }
    })
}

fn quadratic(covariance: &DMatrix<f64>, by: &[f64; UNKNOWNS]) -> f64 {
    let mut sum = 0.0;
    for (column, x) in covariance.column_iter().zip(by) {
        let product: f64 = column.iter().zip(by).map(|(c, y)| c * y).sum();
        sum += x * product;
    }
    sum
}

fn spans(blocks: &[Block], white_mm: [f64; 3]) -> Vec<Span> {
    let start_s = blocks.first().map_or(0.0, |block| block.time_s);
    let number = |block: &Block| ((block.time_s - start_s) / SPAN_S).floor() as i64;
    let mut spans: Vec<Span> = blocks
        .chunk_by(|a, b| number(a) == number(b))
        .filter_map(|blocks| span(blocks, white_mm))
        .collect();
    let most = spans.iter().map(|span| span.rows).fold(0.0, f64::max);
    spans.retain(|span| span.rows >= PART_MIN * most);
    spans
}

fn span(blocks: &[Block], white_mm: [f64; 3]) -> Option<Span> {
    let mut sum = Span {
        rows: 0.0,
        time_s: 0.0,
        error: [0.0; 3],
        white: [0.0; 3],
        by_unknown: [[0.0; UNKNOWNS]; 3],
    };
    for block in blocks {
        let inverse = inverse_rows(&block.by_pose)?;
        sum.rows += block.rows;
        sum.time_s += block.rows * block.time_s;
        for (axis, row) in inverse.iter().enumerate() {
            for (probe, per_mm) in row.iter().enumerate() {
                let weight = per_mm * block.rows;
                let white = per_mm * white_mm[probe];
                sum.error[axis] += weight * block.residual_mm[probe];
                sum.white[axis] += block.rows * white * white;
                let by = &mut sum.by_unknown[axis];
                by[COUNT] += weight * block.by_lag[probe];
                let own = &mut by[probe * PER_PROBE..(probe + 1) * PER_PROBE];
                for (sum, x) in own.iter_mut().zip(&block.by_parameter[probe]) {
                    *sum += weight * x;
                }
            }
        }
    }
    let share = 1.0 / sum.rows;
    sum.time_s *= share;
    for axis in 0..3 {
        sum.error[axis] *= share;
        sum.white[axis] *= share;
        sum.by_unknown[axis].iter_mut().for_each(|x| *x *= share);
    }
    Some(sum)
}

/// The noise of a log before anything is known of the drift.
pub fn white_only(white_mm: [f64; 3]) -> Noise {
    Noise {
        white_mm,
        drift_mm: [0.0; 3],
    }
}
