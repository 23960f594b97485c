//! Residuals of the Hall signals, and the error of a channel that explains them.

use super::channels::{LogSignals, median};
use crate::diagnose::slopes::Slopes;
use hallstage_solver::estimator::dynamics::Dynamics;
use hallstage_solver::estimator::parameters::FieldParameters;
use hallstage_solver::estimator::probe::probes;
use hallstage_solver::estimator::rows::Rows;
use hallstage_solver::statistics::{robust_deviation, white_noise};
use nalgebra::Vector3;

/// A channel shows an error that explains the residuals if it moves by this part of the error, up to the inverse.
const SEEN_MIN: f64 = 0.5;
/// The parameters explain a signal if its residuals are at most this part of it.
const UNEXPLAINED_MAX: f64 = 0.5;

/// Residuals of the three Hall signals.
pub(super) struct Residuals {
    slopes: Slopes,
    /// The residuals by probe and row, m at the designed scale; 0 in rows that are left out.
    pub(super) values: [Vec<f64>; 3],
    /// White noise, m.
    pub(super) noise_m: [f64; 3],
}

impl Residuals {
    /// Residuals for these parameters and this lag of the reference. The median of each movement is taken off as its
    /// zero, so that a fault of some rows does not move the others. `None` where the parameters do not explain the
    /// signals.
    pub(super) fn new(log: &LogSignals, parameters: &FieldParameters, lag_s: f64) -> Option<Self> {
        let probes = probes(parameters);
        let all: Vec<usize> = log.source.rows.clone().collect();
        let weights: Vec<f64> = log.usable.iter().map(|&u| f64::from(u8::from(u))).collect();
        let rows = Rows::weighted(log.dataset, &all, &weights);
        let dynamics = Dynamics {
            lag_s,
            ..Dynamics::default()
        };
        let left = rows.residuals_m(&probes, &dynamics, &vec![[0.0; 3]; rows.movements.len()]);
        let used: Vec<usize> = (0..all.len()).filter(|&row| log.usable[row]).collect();
        let centred = |values: &[f64]| {
            let mut centred = vec![0.0; values.len()];
            for segment in &log.segments {
                let used = || segment.clone().filter(|&row| log.usable[row]);
                let zero = median(used().map(|row| values[row]));
                used().for_each(|row| centred[row] = values[row] - zero);
            }
            centred
        };
        let values = [0, 1, 2].map(|probe| {
            let mut left_m = vec![0.0; all.len()];
            for (&row, left) in used.iter().zip(&left) {
                left_m[row] = left[probe];
            }
            centred(&left_m)
        });
        let is_understood = |probe: usize| {
            let moved = centred(&log.channels[probe])
                .into_iter()
                .map(|x| x * x)
                .sum::<f64>();
            let left_m = robust_deviation(used.iter().map(|&row| values[probe][row]));
            left_m <= UNEXPLAINED_MAX * (moved / used.len().max(1) as f64).sqrt()
        };
        let white = |values: &Vec<f64>| {
            let threes = used.windows(3);
            let threes = threes.map(|rows| [values[rows[0]], values[rows[1]], values[rows[2]]]);
            white_noise(threes).max(1e-10)
        };
        (0..3).all(is_understood).then(|| Self {
            slopes: Slopes::new(log.stage, probes),
            noise_m: values.each_ref().map(white),
            values,
        })
    }

    /// The effect of an error of each channel on the residuals at a row.
    pub(super) fn slopes(&self, log: &LogSignals, row: usize) -> Vec<Vector3<f64>> {
        let here = &log.rows[row];
        let slopes = (self.slopes).at(here.reference, here.vertical);
        slopes.into_iter().take(log.channels.len()).collect()
    }

    /// By channel: the error (m) that explains most of the residuals (m) at a row, and how much it lowers their
    /// squares over their noise.
    pub(super) fn errors(&self, log: &LogSignals, row: usize, shown_m: [f64; 3]) -> Vec<[f64; 2]> {
        let noise_m = Vector3::from(self.noise_m);
        let shown = Vector3::from(shown_m).component_div(&noise_m);
        let error = |slopes: Vector3<f64>| {
            let slopes = slopes.component_div(&noise_m);
            let size_m = slopes.dot(&shown) / slopes.norm_squared();
            [size_m, size_m * slopes.dot(&shown)]
        };
        self.slopes(log, row).into_iter().map(error).collect()
    }
}

/// Whether a channel shows (m) the error (m) that explains the residuals.
pub(super) fn is_seen(shown_m: f64, error_m: f64) -> bool {
    (SEEN_MIN..1.0 / SEEN_MIN).contains(&(shown_m / error_m))
}
