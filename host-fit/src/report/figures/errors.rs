//! Errors over time, before and after the fit; by movement; how they are distributed.

use super::{Log, MOVEMENTS_SHOWN, PLANAR};
use crate::judge::statistics::{ErrorSums, PoseError};
use crate::report::axis::Axis;
use crate::report::before_after::Errors;
use crate::report::chart::{Chart, Mark, Panel, Scale, Tone};
use crate::report::series::lines;

/// The errors of X, Y, Rz over time, with the band of the noise, if it is given.
pub(in crate::report) fn over_time(log: &Log, errors: &Errors, noise: Option<[f64; 3]>) -> Chart {
    let of = |row: usize, axis: usize| Some(errors.by_row[row]?[axis] * 1e6);
    log.over_time(format!("Errors with {}", errors.title), PLANAR, noise, of)
}

/// rms and peak of each movement.
pub(in crate::report) fn of_movements(log: &Log, errors: &Errors) -> Vec<PoseError> {
    let of_movement = |rows: std::ops::Range<usize>| {
        let mut sums = ErrorSums::default();
        for (row, error) in rows.clone().zip(&errors.by_row[rows]) {
            if let Some(error) = error {
                sums.add(row, *error);
            }
        }
        sums.finish()
    };
    (log.dataset.movements.iter())
        .map(|movement| of_movement(movement.rows.clone()))
        .collect()
}

/// Bars of the rms errors of each movement.
pub(in crate::report) fn by_movement(movements: &[PoseError]) -> Chart {
    let panel = |axis: usize| {
        let rms = |k: usize| movements[k].axes[axis].rms * 1e6;
        Panel {
            label: PLANAR[axis].to_owned(),
            scale: Scale::FromZero,
            marks: over_movements(movements.len(), rms),
        }
    };
    Chart {
        caption: "rms error of each movement".to_owned(),
        x_label: "movement, in the order of the logs".to_owned(),
        x: Axis::Linear(0.5, movement_end(movements.len())),
        panels: [0, 1, 2].map(panel).into(),
    }
}

/// Where an abscissa of movements ends: its marks are whole numbers from ten on.
pub(super) fn movement_end(count: usize) -> f64 {
    count.max(10) as f64 + 0.5
}

/// Bars over the movements from 1, or a line where there are too many.
pub(super) fn over_movements(count: usize, of: impl Fn(usize) -> f64) -> Vec<Mark> {
    if count <= MOVEMENTS_SHOWN {
        let bar = |k: usize| (k as f64 + 0.6, k as f64 + 1.4, of(k));
        return vec![Mark::Bars(Tone::Data, (0..count).map(bar).collect())];
    }
    let x: Vec<f64> = (1..=count).map(|k| k as f64).collect();
    let lines = lines(&x, |k| Some(of(k)));
    lines
        .into_iter()
        .map(|line| Mark::Line(Tone::Data, line))
        .collect()
}

/// How the errors of the fit are distributed, in terms of their rms, beside the bell curve.
pub(in crate::report) fn distribution(errors: &Errors) -> Chart {
    const BIN: f64 = 0.25;
    const REACH: f64 = 5.0;
    let bell = (-50..=50).map(|k| f64::from(k) * 0.1);
    let bell: Vec<(f64, f64)> = bell
        .map(|x| (x, (-0.5 * x * x).exp() / std::f64::consts::TAU.sqrt()))
        .collect();
    let panel = |axis: usize| {
        let rms = errors.figures.axes[axis].rms.max(f64::MIN_POSITIVE);
        let mut counts = vec![0.0; (2.0 * REACH / BIN) as usize];
        let mut all = 0.0;
        for error in errors.by_row.iter().flatten() {
            let bin = (error[axis] / rms + REACH) / BIN;
            if let Some(count) = counts.get_mut(bin as usize).filter(|_| bin >= 0.0) {
                *count += 1.0;
            }
            all += 1.0;
        }
        let bar = |(k, count): (usize, f64)| {
            let left = k as f64 * BIN - REACH;
            (left, left + BIN, count / f64::max(all * BIN, 1.0))
        };
        Panel {
            label: ["X", "Y", "Rz"][axis].to_owned(),
            scale: Scale::FromZero,
            marks: vec![
                Mark::Bars(
                    Tone::Data,
                    counts.into_iter().enumerate().map(bar).collect(),
                ),
                Mark::Line(Tone::Second, bell.clone()),
            ],
        }
    };
    Chart {
        caption: "Density of the errors, and of a normal distribution".to_owned(),
        x_label: "error / rms".to_owned(),
        x: Axis::Linear(-REACH, REACH),
        panels: [0, 1, 2].map(panel).into(),
    }
}
