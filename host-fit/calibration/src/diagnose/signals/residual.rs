//! Residuals of the Hall signals, and the channel whose error explains them.

use super::channels::{LogSignals, median, robust_deviation};
use crate::diagnose::slopes::Slopes;
use crate::solve::field::blocks::Rows;
use crate::solve::field::parameters::FieldParameters;
use crate::solve::field::probe::probes;
use nalgebra::Vector3;

/// Residuals beyond this part of the signals are those of a log that is not understood.
const UNEXPLAINED_MAX: f64 = 0.3;
/// A beam or gap explains what its own values show, within this factor, ...
const SEEN_FACTOR: f64 = 2.0;
/// ... and at least this part of what a probe would, which may be wrong at will.
const EXPLAINED_MIN: f64 = 0.8;

/// Residuals of the three Hall signals.
pub(super) struct Residuals {
    slopes: Slopes,
    /// By probe and row, m at the designed scale; 0 in rows that are left out.
    pub(super) values: [Vec<f64>; 3],
    /// White noise, m.
    pub(super) noise_m: [f64; 3],
}

/// An error of one channel.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Error {
    pub(super) channel: usize,
    pub(super) size_m: f64,
    /// By how much it lowers the squares of the residuals, in units of their noise.
    pub(super) explained: f64,
}

impl Residuals {
    /// Of parameters, and a lag of the reference. Each movement's own zero, its median, is taken off: a
    /// fault of some rows moves none of the others. `None` where the parameters do not explain the signals.
    pub(super) fn new(log: &LogSignals, parameters: &FieldParameters, lag_s: f64) -> Option<Self> {
        let probes = probes(parameters);
        let all: Vec<usize> = (log.first..log.first + log.len()).collect();
        let weights: Vec<f64> = log.usable.iter().map(|&u| f64::from(u8::from(u))).collect();
        let rows = Rows::weighted(log.dataset, &all, &weights);
        let left_mm = rows.residuals_mm(&probes, lag_s, &vec![[0.0; 3]; rows.movements.len()]);
        let used = || (0..log.len()).filter(|&row| log.usable[row]);
        let mut values = [(); 3].map(|()| vec![0.0; log.len()]);
        for (k, values) in values.iter_mut().enumerate() {
            for (row, left_mm) in used().zip(&left_mm) {
                values[row] = left_mm[k] * 1e-3;
            }
            let mut moved = log.channels[k].values.clone();
            for values in [&mut *values, &mut moved] {
                for segment in &log.segments {
                    let rows = || segment.clone().filter(|&row| log.usable[row]);
                    let zero = median(&mut rows().map(|row| values[row]).collect::<Vec<_>>());
                    rows().for_each(|row| values[row] -= zero);
                }
            }
            let squares = used().map(|row| moved[row] * moved[row]).sum::<f64>();
            let moved_m = (squares / used().count().max(1) as f64).sqrt();
            let left_m = robust_deviation(used().map(|row| values[row]));
            if left_m > UNEXPLAINED_MAX * moved_m {
                return None;
            }
        }
        Some(Self {
            slopes: Slopes::new(log.stage, probes),
            noise_m: values.each_ref().map(|values| white_noise(log, values)),
            values,
        })
    }

    /// How an error of each channel of the log shows in the residuals at a row, over their noise.
    pub(super) fn of_errors(&self, log: &LogSignals, row: usize) -> Vec<Vector3<f64>> {
        let here = &log.rows[row];
        let slopes = self
            .slopes
            .at(here.reference.map(|x| x * 1e3), here.vertical);
        let slopes = slopes.iter().take(log.channels.len());
        slopes.map(|slopes| self.over_noise(*slopes)).collect()
    }

    /// Residuals (m) over their noise.
    pub(super) fn over_noise(&self, residuals_m: impl Into<Vector3<f64>>) -> Vector3<f64> {
        residuals_m
            .into()
            .zip_map(&self.noise_m.into(), |left, noise| left / noise.max(1e-10))
    }

    /// The error of each channel that explains most of what the residuals (m) show at a row.
    pub(super) fn errors(&self, log: &LogSignals, row: usize, shown_m: [f64; 3]) -> Vec<Error> {
        let shown = self.over_noise(shown_m);
        let errors = self.of_errors(log, row).into_iter().enumerate();
        let error = |(channel, slopes): (usize, Vector3<f64>)| {
            let size_m = slopes.dot(&shown) / slopes.norm_squared().max(1e-6);
            Error {
                channel,
                size_m,
                explained: size_m * slopes.dot(&shown),
            }
        };
        errors.map(error).collect()
    }
}

/// The error that explains most; `seen_m` is by how much a channel itself is off.
pub(super) fn blamed(errors: &[Error], seen_m: impl Fn(usize) -> f64) -> Option<Error> {
    let worth = |error: &Error| {
        let wanted_m = error.size_m.abs();
        let is_seen = || {
            (wanted_m / SEEN_FACTOR..wanted_m * SEEN_FACTOR).contains(&seen_m(error.channel).abs())
        };
        match error.channel {
            0..3 => EXPLAINED_MIN * error.explained,
            _ if is_seen() => error.explained,
            _ => 0.0,
        }
    };
    let errors = errors.iter().copied();
    errors.max_by(|a, b| worth(a).total_cmp(&worth(b)))
}

/// White noise from second differences, which hardly know the motion.
fn white_noise(log: &LogSignals, values: &[f64]) -> f64 {
    let rows = log.segments.iter().flat_map(|s| s.start + 2..s.end);
    let used = rows.filter(|&row| (row - 2..=row).all(|row| log.usable[row]));
    let differences = used.map(|row| values[row] - 2.0 * values[row - 1] + values[row - 2]);
    robust_deviation(differences) / 6f64.sqrt()
}
