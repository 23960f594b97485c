//! What a calibration leaves of the Hall signals: signal less model, by probe.

use super::channels::{
    LogSignals, median, robust_deviation, signals_less_means, speeds, white_noise,
};
use crate::solve::field::parameters::FieldParameters;
use crate::solve::field::probe::{Probe, probes};
use rayon::prelude::*;

/// Residuals beyond this part of the signals are those of a log that is not understood.
const UNEXPLAINED_MAX: f64 = 0.3;

/// Residuals of the three Hall signals.
pub(super) struct Residuals {
    probes: [Probe; 3],
    /// By probe and row, m at the designed scale; 0 in rows that are left out.
    pub(super) values: [Vec<f64>; 3],
    /// White noise, m.
    pub(super) noise_m: [f64; 3],
}

impl Residuals {
    /// Of parameters, and a lag of the reference. Each segment's own zero, its median, is taken off: a
    /// fault of some rows moves none of the others. `None` where the parameters do not explain the signals.
    pub(super) fn new(log: &LogSignals, parameters: &FieldParameters, lag_s: f64) -> Option<Self> {
        let probes = probes(parameters);
        let speeds = speeds(log);
        let left_m = |(k, probe): (usize, &Probe)| {
            let mut values = vec![0.0; log.len()];
            for segment in &log.segments {
                let rows = || segment.clone().filter(|&row| log.usable[row]);
                let mut zeros = Vec::new();
                for row in rows() {
                    let (here, speed) = (&log.rows[row], speeds[row]);
                    let planar_mm = [0, 1, 2].map(|i| (here.reference[i] + lag_s * speed[i]) * 1e3);
                    let signal_m = probe.signal_mm(planar_mm, here.vertical) * 1e-3;
                    values[row] = log.channels[k].values[row] - signal_m;
                    zeros.push(values[row]);
                }
                let zero = median(&mut zeros);
                rows().for_each(|row| values[row] -= zero);
            }
            let used = (0..log.len()).filter(|&row| log.usable[row]);
            let left_m = robust_deviation(used.map(|row| values[row]));
            let moved = signals_less_means(log, k);
            let squares: f64 = moved.iter().map(|m| m * m).sum();
            let moved_m = (squares / moved.len().max(1) as f64).sqrt();
            let noise_m = 1e-3 * white_noise(log, &values, 1e3);
            (left_m <= UNEXPLAINED_MAX * moved_m).then_some((values, noise_m))
        };
        let left: Option<Vec<_>> = probes.par_iter().enumerate().map(left_m).collect();
        let [a, b, c] = <[_; 3]>::try_from(left?).ok()?;
        Some(Self {
            probes,
            noise_m: [a.1, b.1, c.1],
            values: [a.0, b.0, c.0],
        })
    }

    /// How an error of 1 m of each channel of [`LogSignals::channels`] shows in the residuals of
    /// the three probes at a row, m.
    pub(super) fn of_errors(&self, log: &LogSignals, row: usize) -> Vec<[f64; 3]> {
        let here = &log.rows[row];
        let planar_mm = here.reference.map(|x| x * 1e3);
        let mut shown = vec![[0.0; 3]; log.channels.len()];
        for (k, probe) in self.probes.iter().enumerate() {
            let reading = probe.read(planar_mm, here.vertical);
            let [x, y, rz] = reading.by_pose;
            let turn = rz / log.baseline_m;
            shown[k][k] = 1.0;
            for (beam, by_beam) in [x, 0.5 * y + turn, 0.5 * y - turn].into_iter().enumerate() {
                shown[3 + beam][k] = -by_beam;
            }
            for gap in 0..shown.len().saturating_sub(6) {
                const STEP_M: f64 = 1e-6;
                let moved: [f64; 3] =
                    std::array::from_fn(|i| here.vertical[i] + STEP_M * log.gap_rows[i][gap]);
                let signal_mm = probe.signal_mm(planar_mm, moved);
                shown[6 + gap][k] = -(signal_mm - reading.signal_mm) * 1e-3 / STEP_M;
            }
        }
        shown
    }
}
