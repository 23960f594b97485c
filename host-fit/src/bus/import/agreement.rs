//! How well a refined offset holds: its standard error, and whether each movement agrees with it.
//!
//! What the terms of `refine` leave of the signals is no white noise, so the standard error is told by
//! the scatter of the gradient from one tenth of a second to the next, each summed over its
//! ticks: the sandwich estimator of a least-squares fit with clustered errors (White 1980; Liang and
//! Zeger 1986).

use super::offset::Offset;
use super::reference::Sample;
use super::refine::{RATE_PRIOR, Row, Scales, Solved, Sums, each_row};
use super::survey::Point;
use nalgebra::{Matrix2, Vector2};

/// Ticks of a cluster.
const CLUSTER_TICKS: usize = 50;

/// A movement must leave as much of its motion, as a share, and as much of the motion of a movement in
/// the mean, to be one of another time.
const LEFT_MAX: f64 = 0.4;
const LEFT_OF_MEAN_MAX: f64 = 0.02;

/// How far the offset of one movement may be from that of all, in servo periods, beyond five
/// standard errors.
const MOVEMENT_PERIODS_MAX: f64 = 0.5;
const STANDARD_ERRORS: f64 = 5.0;

/// How well an offset holds.
#[derive(Clone, Copy, Debug)]
pub(super) struct Agreement {
    /// Standard error of the offset, at the end of the points where it is larger, us.
    pub(super) standard_error_us: f64,
    /// A movement that does not agree with the offset of all.
    pub(super) astray: Option<i64>,
}

/// What the terms leave of a tick, for each probe: of the signal, and of the columns of time; and
/// the signal.
struct Left {
    movement: i64,
    signal: [f64; 3],
    left: [(f64, Vector2<f64>); 3],
}

/// Sums of one movement.
struct OfMovement {
    movement: i64,
    square: Matrix2<f64>,
    gradient: Vector2<f64>,
    ticks: f64,
    /// What is left of the motion, and the motion, codes squared.
    left: f64,
    motion: f64,
}

/// How well a refined offset holds; `None` if nothing moves.
pub(super) fn agreement(
    points: &[Point],
    predicted: &[Sample],
    offset: &Offset,
    step_us: f64,
) -> Option<Agreement> {
    let scales = Scales::of(points, predicted);
    let sums = Sums::over(points, predicted, &scales, offset, (f64::INFINITY, step_us));
    let solved = [
        sums.probes[0].solved(0)?,
        sums.probes[1].solved(1)?,
        sums.probes[2].solved(2)?,
    ];
    let mut rows = Vec::with_capacity(points.len());
    each_row(
        points.iter(),
        predicted,
        &scales,
        offset,
        step_us,
        |row: Row| {
            rows.push(Left {
                movement: row.movement,
                signal: row.signal,
                left: [0, 1, 2].map(|k| solved[k].left(&row, k)),
            });
        },
    );
    let mut scatter = Matrix2::zeros();
    let movements: Vec<OfMovement> = rows
        .chunk_by(|a, b| a.movement == b.movement)
        .map(|rows| of_movement(rows, &solved, &mut scatter))
        .collect();
    let square = movements.iter().map(|m| m.square).sum::<Matrix2<f64>>();
    let by_noise = (square + Matrix2::new(0.0, 0.0, 0.0, RATE_PRIOR)).try_inverse()?;
    let by_scatter = by_noise * scatter * by_noise;
    let at_ends = [points.first()?, points.last()?].map(|end| {
        let since = Vector2::new(1.0, (end.t_us - offset.middle_us) * 1e-6);
        let variance = |matrix: &Matrix2<f64>| (since.transpose() * matrix * since)[0];
        variance(&by_noise).max(variance(&by_scatter)).sqrt()
    });
    let inflation = (by_scatter[(0, 0)] / by_noise[(0, 0)]).max(1.0).sqrt();
    let ticks: f64 = movements.iter().map(|m| m.ticks).sum();
    let motion: f64 = movements.iter().map(|m| m.motion).sum();
    let is_astray = |m: &&OfMovement| {
        let is_other =
            m.left > LEFT_MAX * m.motion && m.left / m.ticks > LEFT_OF_MEAN_MAX * (motion / ticks);
        let step = -m.gradient[0] / m.square[(0, 0)];
        let error = inflation / m.square[(0, 0)].sqrt();
        is_other || step.abs() > MOVEMENT_PERIODS_MAX * step_us + STANDARD_ERRORS * error
    };
    Some(Agreement {
        standard_error_us: at_ends[0].max(at_ends[1]),
        astray: movements.iter().find(is_astray).map(|m| m.movement),
    })
}

/// Sums over the ticks of one movement, zero deviations taken out; adds the squares of the
/// gradients of its clusters to `scatter`.
fn of_movement(rows: &[Left], solved: &[Solved; 3], scatter: &mut Matrix2<f64>) -> OfMovement {
    let ticks = rows.len() as f64;
    let means = [0, 1, 2].map(|k| {
        let left = rows.iter().map(|row| row.left[k].0).sum::<f64>() / ticks;
        let time = rows.iter().map(|row| row.left[k].1).sum::<Vector2<f64>>() / ticks;
        let signal = rows.iter().map(|row| row.signal[k]).sum::<f64>() / ticks;
        (left, time, signal)
    });
    let mut all = OfMovement {
        movement: rows.first().map_or(0, |row| row.movement),
        square: Matrix2::zeros(),
        gradient: Vector2::zeros(),
        ticks,
        left: 0.0,
        motion: 0.0,
    };
    for cluster in rows.chunks(CLUSTER_TICKS) {
        let mut gradient = Vector2::zeros();
        for row in cluster {
            for (k, (mean_left, mean_time, mean_signal)) in means.iter().enumerate() {
                let (left, time) = (row.left[k].0 - mean_left, row.left[k].1 - mean_time);
                let weight = 1.0 / solved[k].variance;
                gradient += weight * left * time;
                all.square += weight * time * time.transpose();
                all.left += left * left;
                all.motion += (row.signal[k] - mean_signal).powi(2);
            }
        }
        all.gradient += gradient;
        *scatter += gradient * gradient.transpose();
    }
    all
}
