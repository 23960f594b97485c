//! Robust losses by weights: rows that the fitted model cannot explain count less.
//!
//! A row's residuals, each less the median of its movement, are measured in a robust scale of their
//! channel, 1.4826 times the median magnitude over the log: the standard deviation if they are
//! normal. Residuals of exactly zero are no noise and do not count for the scale: they come from rows
//! that the recorder repeated. With r the largest of the three and k = 6 the row's weight is 1 up to k, then k / r (Huber)
//! or (k / r)^2 (the tail of Cauchy's loss). Weights and fit in turn until both settle: iteratively
//! reweighted least squares.
//!
//! Noise alone does not come near k, so every row of a clean log has the weight 1, and the result is that of plain
//! least squares, bit for bit.

use super::least_squares::solve;
use super::pose::Decoder;
use crate::estimator::paper::Parameters;
use crate::estimator::problem::Problem;
use crate::solve::{Solution, SolveError};
use hallstage_input::statistics::median;
use std::ops::Range;
use std::sync::Arc;

/// From how many robust standard deviations on a row counts less.
const THRESHOLD: f64 = 6.0;
/// Smallest Huber weight. Every row keeps a weight above 0 until [`Loss::last`], so that no movement is
/// lost while the weights settle.
const SHARE_MIN: f64 = 1e-9;
/// Below this weight a row is an outlier.
pub const HALF: f64 = 0.5;
/// The standard deviation of normal numbers over the median of their magnitudes.
const PER_MEDIAN: f64 = 1.482_602_218_505_602;

/// How much a row counts that the model does not explain.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Loss {
    /// As much as any other: plain least squares.
    None,
    /// As if its residual were at the threshold.
    Huber,
    /// Less the farther it is off; an outlier not at all.
    Cauchy,
}

impl Loss {
    /// All of them, the default first.
    pub const ALL: [Self; 3] = [Self::Cauchy, Self::Huber, Self::None];

    /// The weights of rows with these residuals in three channels, whatever their unit, by movement:
    /// above 0, at most 1.
    pub fn weights(
        self,
        residuals: Vec<[f64; 3]>,
        movements: impl Iterator<Item = Range<usize>>,
    ) -> Vec<f64> {
        let weight = |share: f64| match self {
            Self::None => 1.0,
            Self::Huber => share,
            Self::Cauchy => share * share,
        };
        let share = |r: f64| (THRESHOLD / r).clamp(SHARE_MIN, 1.0);
        let weight = |r| weight(if r > THRESHOLD { share(r) } else { 1.0 });
        deviations(residuals, movements).map(weight).collect()
    }

    /// The weights that a fit ends with: Cauchy's outliers are left out, and also rows among
    /// outliers: while a stage is stuck, some poses are right by chance.
    pub fn last(self, weights: Vec<f64>) -> Vec<f64> {
        const BESIDE: usize = 5;
        let light = |weights: &[f64]| weights.iter().filter(|w| **w < HALF).count();
        let last = |row: usize| {
            let beside = row.saturating_sub(BESIDE)..(row + BESIDE + 1).min(weights.len());
            let among_outliers = light(&weights[beside]) > BESIDE;
            let left_out = self == Self::Cauchy && (weights[row] < HALF || among_outliers);
            if left_out { 0.0 } else { weights[row] }
        };
        (0..weights.len()).map(last).collect()
    }
}

/// The weights of a fit of least magnitudes: a row pulls as much as any other, however large its
/// residuals. A stuck movement, which bends a fit of least squares everywhere and so hides, shows
/// after such a fit.
fn least_magnitudes(
    residuals: Vec<[f64; 3]>,
    movements: impl Iterator<Item = Range<usize>>,
) -> Vec<f64> {
    // Residuals that happen to be near zero must not hold the fit.
    const NEAR: f64 = 0.5;
    let weight = |r: f64| NEAR / r.max(NEAR);
    deviations(residuals, movements).map(weight).collect()
}

/// The largest of the residuals of each row in robust standard deviations.
fn deviations(
    mut residuals: Vec<[f64; 3]>,
    movements: impl Iterator<Item = Range<usize>>,
) -> impl Iterator<Item = f64> {
    let mut scratch = Vec::with_capacity(residuals.len());
    for movement in movements {
        let rows = &mut residuals[movement];
        for k in 0..3 {
            scratch.clear();
            scratch.extend(rows.iter().map(|row| row[k]));
            let middle = median(&mut scratch).unwrap_or(0.0);
            rows.iter_mut().for_each(|row| row[k] -= middle);
        }
    }
    let scale = [0, 1, 2].map(|k| {
        scratch.clear();
        let magnitudes = residuals.iter().map(|row| row[k].abs());
        scratch.extend(magnitudes.filter(|size| *size > 0.0));
        (PER_MEDIAN * median(&mut scratch).unwrap_or(0.0)).max(f64::MIN_POSITIVE)
    });
    residuals.into_iter().map(move |row| {
        let deviation = |k: usize| row[k].abs() / scale[k];
        deviation(0).max(deviation(1)).max(deviation(2))
    })
}

/// A fit of about the least magnitudes of the pose errors of some rows: a start that bad rows hardly
/// bend.
///
/// # Errors
/// See [`SolveError`].
pub fn start(problem: &Problem<'_>) -> Result<Solution, SolveError> {
    const ROUNDS: u32 = 15;
    const ROWS: usize = 4000;
    let mut problem = problem.thinned(ROWS);
    let mut solution = solve(&problem, None)?;
    for _ in 0..ROUNDS {
        let residuals = residuals(&problem, &solution.parameters);
        let movements = problem.rows.movement_rows();
        let weights = least_magnitudes(residuals.ok_or(SolveError::NoUsableStart)?, movements);
        let rows = &mut Arc::make_mut(&mut problem.rows).rows;
        for (row, weight) in rows.iter_mut().zip(weights) {
            row.weight = weight;
        }
        solution = solve(&problem, Some(solution.parameters))?;
    }
    Ok(solution)
}

/// The reference less the decoded pose of every row, with no offset taken off, m, m, rad;
/// `None` next to a pole.
fn residuals(problem: &Problem<'_>, parameters: &Parameters) -> Option<Vec<[f64; 3]>> {
    let decoder = Decoder::new(parameters, problem.stage)?;
    problem
        .rows
        .rows
        .iter()
        .map(|row| decoder.error(row))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 1000 rows in two movements, each with an offset of its own, about which residuals spread
    /// evenly from -1 to 1: half of them are within 0.5.
    fn residuals() -> Vec<[f64; 3]> {
        let one = |row: usize| {
            let offset = if row < 500 { 40.0 } else { -70.0 };
            [offset + ((row % 500) as f64 - 250.0) / 250.0; 3]
        };
        (0..1000).map(one).collect()
    }

    fn weights(loss: Loss, residuals: &[[f64; 3]]) -> Vec<f64> {
        loss.weights(residuals.to_vec(), [0..500, 500..1000].into_iter())
    }

    #[test]
    fn only_rows_beyond_six_robust_standard_deviations_count_less() {
        let clean = residuals();
        for loss in Loss::ALL {
            assert!(weights(loss, &clean).iter().all(|weight| *weight == 1.0));
        }
        let mut off = clean;
        off[700][1] += 100.0;
        let share = THRESHOLD / (100.0 / (0.5 * PER_MEDIAN));
        for (loss, expected) in [
            (Loss::None, 1.0),
            (Loss::Huber, share),
            (Loss::Cauchy, share * share),
        ] {
            let weights = weights(loss, &off);
            assert!(
                (weights[700] / expected - 1.0).abs() < 0.05,
                "{loss:?} {}",
                weights[700]
            );
            assert_eq!(
                weights.iter().filter(|w| **w < 1.0).count(),
                usize::from(loss != Loss::None)
            );
        }
    }

    #[test]
    fn cauchy_ends_without_outliers_and_without_rows_among_them() {
        let mut weights = vec![1.0; 60];
        weights[3] = 0.3;
        weights[20..40].fill(0.1);
        weights[30] = 1.0;
        assert_eq!(Loss::Huber.last(weights.clone()), weights);
        let last = Loss::Cauchy.last(weights);
        let left_out = (0..60).filter(|&row| last[row] == 0.0);
        assert_eq!(
            left_out.collect::<Vec<_>>(),
            [3].into_iter().chain(20..40).collect::<Vec<_>>()
        );
    }
}
