//! The noise of a log from the residuals of a fit: white at the probes, a walk of the reference.

use super::blocks::Block;
use super::dynamics::Dynamics;
use super::probe::Probe;
use super::rows::Rows;
use super::whiten::{COLUMNS, Noise, UNKNOWNS, columns};
use crate::estimator::robust::HALF;
use crate::statistics::SecondDifferences;
use hallstage_input::stage::Stage;
use nalgebra::DMatrix;
use runtime::matrix::{from_rows, inverse, to_rows};

/// Length over which the reference's walk is averaged, s.
const SPAN_S: f64 = 1.0;
/// A span shorter than this part of [`SPAN_S`] is left out.
const PART_MIN: f64 = 0.5;

/// White noise of the probes A, B, C, m: from second differences of the residuals, which have six times the
/// variance of the noise. It is at least the rounding of the codes.
/// Rows below half weight are left out.
pub fn white_m(
    rows: &Rows,
    probes: &[Probe; 3],
    dynamics: &Dynamics,
    offsets: &[[f64; 3]],
    stage: &Stage,
) -> [f64; 3] {
    let least_m = stage.hall.m_per_count / 12f64.sqrt();
    let residuals = rows.residuals_m(probes, dynamics, offsets);
    let mut noise = SecondDifferences::default();
    for movement in rows.movement_rows() {
        let triples = residuals[movement.clone()].windows(3);
        for (three, rows) in triples.zip(rows.rows[movement].windows(3)) {
            if rows.iter().all(|row| row.weight >= HALF) {
                noise.add(three[0], three[1], three[2]);
            }
        }
    }
    noise.deviations().map(|white| white.max(least_m))
}

/// Means over a span of about [`SPAN_S`], as poses.
struct Span {
    rows: f64,
    time_s: f64,
    /// Error of the reference, m, m, rad.
    error: [f64; 3],
    /// Its variance by white noise of one row.
    white: [f64; 3],
    /// Its change by the unknowns.
    by_unknown: [[f64; UNKNOWNS]; 3],
}

/// Usual walk of a reference in a second in X, Y, Rz: m, m, rad.
pub const USUAL_DRIFT: [f64; 3] = [1e-7; 3];
/// Standard deviation of the logarithm of a walk, before a log is seen: a factor of two.
pub const DRIFT_SPREAD: f64 = 0.7;

/// The reference's walk in X, Y, Rz, per root of a second (m, m, rad): from differences
/// between means of neighbouring spans of a second, with what the fitted parameters took of them
/// (by their `covariance`) put back.
///
/// A short log has few spans and determines the walk within a factor of two. Standard errors
/// are honest on average with the mean of the walk's variance over all values that the spans
/// allow, not with the most likely one, which is often zero.
pub fn drift(
    rows: &Rows,
    blocks: &[Block],
    white_m: [f64; 3],
    covariance: &DMatrix<f64>,
) -> [f64; 3] {
    let mut differences = [const { Vec::new() }; 3];
    for movement in &rows.movements {
        let spans = spans(&blocks[movement.clone()], white_m);
        for pair in spans.windows(2) {
            let (a, b) = (&pair[0], &pair[1]);
            for (axis, differences) in differences.iter_mut().enumerate() {
                let error = b.error[axis] - a.error[axis];
                let by: [f64; UNKNOWNS] =
                    std::array::from_fn(|j| b.by_unknown[axis][j] - a.by_unknown[axis][j]);
                differences.push(Difference {
                    square: error * error + quadratic(covariance, &by),
                    white: a.white[axis] / a.rows + b.white[axis] / b.rows,
                    // The variance between means over neighbouring spans of a walk is 2/3 of the variance
                    // between their middles.
                    seconds: (b.time_s - a.time_s) * 2.0 / 3.0,
                });
            }
        }
    }
    [0, 1, 2].map(|axis| mean_walk(&differences[axis], USUAL_DRIFT[axis]))
}

/// The difference between two spans.
struct Difference {
    square: f64,
    /// Variance by white noise.
    white: f64,
    /// The variance by the walk over the variance of the walk in a second, s.
    seconds: f64,
}

/// Root of the mean of a walk's variance in a second over its posterior: normal differences, a
/// log-normal prior about the `usual` walk.
fn mean_walk(differences: &[Difference], usual: f64) -> f64 {
    const STEPS: i32 = 40;
    const STEP: f64 = 0.125;
    let at = |step: i32| {
        let place = STEP * f64::from(step);
        let walk = usual * libm::exp(DRIFT_SPREAD * place);
        let mut log = -0.5 * place * place;
        for d in differences {
            let variance = d.white + d.seconds * walk * walk;
            log -= 0.5 * (libm::log(variance) + d.square / variance);
        }
        (log, walk * walk)
    };
    let places: Vec<(f64, f64)> = (-STEPS..=STEPS).map(at).collect();
    let highest = places.iter().map(|p| p.0).fold(f64::NEG_INFINITY, f64::max);
    let (mut sum, mut weights) = (0.0, 0.0);
    for (log, variance) in places {
        let weight = libm::exp(log - highest);
        sum += weight * variance;
        weights += weight;
    }
    (sum / weights).sqrt()
}

fn quadratic(covariance: &DMatrix<f64>, by: &[f64; UNKNOWNS]) -> f64 {
    let mut sum = 0.0;
    for (column, x) in covariance.column_iter().zip(by) {
        let product: f64 = column.iter().zip(by).map(|(c, y)| c * y).sum();
        sum += x * product;
    }
    sum
}

fn spans(blocks: &[Block], white_m: [f64; 3]) -> Vec<Span> {
    let start_s = blocks.first().map_or(0.0, |block| block.time_s);
    let number = |block: &Block| ((block.time_s - start_s) / SPAN_S).floor() as i64;
    let mut spans: Vec<Span> = blocks
        .chunk_by(|a, b| number(a) == number(b))
        .filter_map(|blocks| span(blocks, white_m))
        .collect();
    let most = spans.iter().map(|span| span.rows).fold(0.0, f64::max);
    spans.retain(|span| span.rows >= PART_MIN * most);
    spans
}

fn span(blocks: &[Block], white_m: [f64; 3]) -> Option<Span> {
    let mut sum = Span {
        rows: 0.0,
        time_s: 0.0,
        error: [0.0; 3],
        white: [0.0; 3],
        by_unknown: [[0.0; UNKNOWNS]; 3],
    };
    for block in blocks {
        let by_probe = to_rows(&inverse(&from_rows(&block.by_pose))?);
        let columns: [[f64; COLUMNS]; 3] = columns(block);
        sum.rows += block.rows;
        sum.time_s += block.rows * block.time_s;
        for (axis, row) in by_probe.iter().enumerate() {
            for (probe, by) in row.iter().enumerate() {
                let weight = by * block.rows;
                let white = by * white_m[probe];
                sum.error[axis] += weight * block.residual_m[probe];
                sum.white[axis] += block.rows * white * white;
                for (sum, x) in sum.by_unknown[axis].iter_mut().zip(&columns[probe]) {
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
pub fn white_only(white_m: [f64; 3]) -> Noise {
    Noise {
        white_m,
        drift: [0.0; 3],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Differences as large as a walk of this size makes them on average.
    fn differences(count: usize, walk: f64) -> Vec<Difference> {
        let white = 2e-15;
        let one = |_| Difference {
            square: white + walk * walk / 1.5,
            white,
            seconds: 1.0 / 1.5,
        };
        (0..count).map(one).collect()
    }

    #[test]
    fn many_spans_give_the_walk_and_few_an_allowance_for_what_they_leave_open() {
        for walk in [3e-8, 1e-7, 1e-6] {
            let found = |count| mean_walk(&differences(count, walk), 1e-7) / walk;
            let (many, few) = (found(2000), found(7));
            assert!((0.95..1.05).contains(&many), "{walk}: {many}");
            // Towards the usual walk.
            assert!((0.8..2.2).contains(&few), "{walk}: {few}");
        }
        // Spans that show no walk don't show that there is none.
        let still = mean_walk(&differences(7, 0.0), 1e-7);
        assert!((2e-8..1e-7).contains(&still), "{still}");
        assert!(mean_walk(&[], 1e-7) > 1e-7);
    }
}
