//! What the motion does not explain of the Hall signals: residuals of the field model, fitted to
//! each probe by itself.
//!
//! With an offset of its own in every segment, a probe's 27 parameters depend on no other probe, so
//! a fault of one probe stays in its residual. Cauchy's weights keep faulty rows from bending the
//! fit, and the prior of the field model keeps a drift from passing for a shape of the magnet.

use super::channels::{LogSignals, robust_deviation, signals_less_means, speeds, white_noise};
use crate::input::stage::Stage;
use crate::problem::parameters::Parameters;
use crate::solve::field::parameters::FieldParameters;
use crate::solve::field::probe::{Probe, probes};
use crate::solve::field::terms::{PER_PROBE, TERMS};
use nalgebra::{Cholesky, DMatrix, DVector};
use rayon::prelude::*;
use std::ops::Range;

/// The parameters of a probe, and a lag of the reference.
const COLUMNS: usize = PER_PROBE + 1;
/// Rows that the fit uses at most, about: enough for any noise.
const ROWS_MAX: usize = 12_000;
/// Gauss-Newton steps with the probes at their designed places, and at those that the slopes show.
const STEPS: usize = 4;
/// Residual that halves the weight of a row, in standard deviations.
const HALF_WEIGHT: f64 = 3.0;
/// Weight that holds a parameter without prior, in parts of what the rows say: it decides where a
/// log does not.
const RIDGE: f64 = 1e-9;
/// Noise below this is rounding, mm.
const NOISE_MIN_MM: f64 = 2e-5;
/// Residuals beyond this part of the signals are those of a log that is not understood.
const UNEXPLAINED_MAX: f64 = 0.3;

/// A row as the fit of a probe sees it.
struct Row {
    columns: [f64; COLUMNS],
    /// What an offset of the reference changes, up to its sign.
    by_offset: f64,
    /// Signal less model, mm.
    left_mm: f64,
}

/// A fit of one probe.
struct ProbeFit {
    probe: Probe,
    lag_s: f64,
    /// By segment, mm.
    offsets_mm: Vec<f64>,
}

/// Residuals of the three Hall signals.
pub(super) struct Residuals {
    fits: Vec<ProbeFit>,
    stride: usize,
    /// Of X, Y, Rz by row, per s.
    speeds: Vec<[f64; 3]>,
    /// White noise of the signals, mm.
    signal_noise_mm: [f64; 3],
    /// By probe and row, m at the designed scale; 0 in rows that are left out.
    pub(super) values: [Vec<f64>; 3],
    /// White noise, m.
    pub(super) noise_m: [f64; 3],
}

impl Residuals {
    /// `None` where too few rows are left, or the motion does not explain the signals.
    pub(super) fn new(log: &LogSignals, stage: &Stage) -> Option<Self> {
        let mut residuals = Self {
            fits: Vec::new(),
            stride: log.len().div_ceil(ROWS_MAX),
            speeds: speeds(log),
            signal_noise_mm: [0, 1, 2]
                .map(|k| white_noise(log, &log.channels[k].values, 1e3).max(NOISE_MIN_MM)),
            values: Default::default(),
            noise_m: [0.0; 3],
        };
        let mut parameters = FieldParameters::of_model_31(&Parameters::designed(stage), stage);
        let mut lags_s = [0.0; 3];
        for _ in 0..2 * STEPS {
            let here = probes(&parameters).into_par_iter().enumerate();
            let unknowns = parameters.probes.par_iter_mut().zip(&mut lags_s);
            let fits: Option<Vec<ProbeFit>> = (here.zip(unknowns))
                .map(|((k, probe), (values, lag_s))| {
                    residuals.step(log, k, probe, values, lag_s, HALF_WEIGHT)
                })
                .collect();
            residuals.fits = fits?;
        }
        let last = |(k, probe): (usize, Probe)| {
            // Offsets and factor at the last parameters, which stay, for rows of equal weight.
            let (mut values, mut lag_s) = (parameters.probes[k], lags_s[k]);
            let fit = residuals.step(log, k, probe, &mut values, &mut lag_s, f64::INFINITY)?;
            let left = residuals.left_m(log, k, &fit);
            let noise_m = 1e-3 * white_noise(log, &left, 1e3);
            let used = (0..log.len()).filter(|&row| log.usable[row]);
            let left_m = robust_deviation(used.map(|row| left[row]));
            let moved = signals_less_means(log, k);
            let squares: f64 = moved.iter().map(|m| m * m).sum();
            let moved_m = (squares / moved.len().max(1) as f64).sqrt();
            let understood = left_m <= UNEXPLAINED_MAX * moved_m;
            let lag_s = lags_s[k];
            understood.then_some((ProbeFit { lag_s, ..fit }, left, noise_m))
        };
        let probes = probes(&parameters).into_par_iter().enumerate();
        let found: Option<Vec<_>> = probes.map(last).collect();
        for (k, (fit, left, noise_m)) in found?.into_iter().enumerate() {
            residuals.fits[k] = fit;
            residuals.values[k] = left;
            residuals.noise_m[k] = noise_m;
        }
        Some(residuals)
    }

    fn row(&self, log: &LogSignals, (k, probe): (usize, &Probe), lag_s: f64, row: usize) -> Row {
        let speed = self.speeds[row];
        let here = &log.rows[row];
        let planar_mm = [0, 1, 2].map(|i| (here.reference[i] + lag_s * speed[i]) * 1e3);
        let reading = probe.read(planar_mm, here.vertical);
        let mut columns = [0.0; COLUMNS];
        columns[..PER_PROBE].copy_from_slice(&reading.by_parameter);
        for (by_axis, speed) in reading.by_pose.iter().zip(speed) {
            columns[PER_PROBE] += by_axis * speed * 1e3;
        }
        Row {
            columns,
            by_offset: libm::hypot(reading.by_pose[0], reading.by_pose[1]),
            left_mm: log.channels[k].values[row] * 1e3 - reading.signal_mm,
        }
    }

    fn used<'s>(
        &self,
        log: &'s LogSignals,
        segment: &Range<usize>,
    ) -> impl Iterator<Item = usize> + 's {
        let rows = segment.clone().step_by(self.stride);
        rows.filter(|&row| log.usable[row])
    }

    /// One step of Gauss and Newton from `probe`, which is that of `values`; rows `half_weight`
    /// standard deviations off have half the weight.
    fn step(
        &self,
        log: &LogSignals,
        k: usize,
        probe: Probe,
        values: &mut [f64; PER_PROBE],
        lag_s: &mut f64,
        half_weight: f64,
    ) -> Option<ProbeFit> {
        let rows: Vec<Vec<Row>> = (log.segments.par_iter())
            .map(|segment| {
                let of = |row| self.row(log, (k, &probe), *lag_s, row);
                self.used(log, segment).map(of).collect()
            })
            .collect();
        let count: usize = rows.iter().map(Vec::len).sum();
        if count < 4 * COLUMNS {
            return None;
        }
        // The median of each segment, so that no weights are needed to begin with.
        let middles: Vec<f64> = (rows.iter())
            .map(|rows| {
                let mut offsets: Vec<f64> =
                    rows.iter().map(|row| row.left_mm / row.by_offset).collect();
                super::channels::median(&mut offsets)
            })
            .collect();
        let off = |row: &Row, middle: f64| row.left_mm - middle * row.by_offset;
        let all = rows.iter().zip(&middles);
        let scale_mm = robust_deviation(
            all.flat_map(|(rows, &middle)| rows.iter().map(move |row| off(row, middle))),
        )
        .max(NOISE_MIN_MM);
        let noise_mm = self.signal_noise_mm[k];

        let mut gram = [[0.0; COLUMNS]; COLUMNS];
        let mut right = [0.0; COLUMNS];
        let mut projected = Vec::with_capacity(rows.len());
        for (rows, &middle) in rows.iter().zip(&middles) {
            let mut of_columns = [0.0; COLUMNS];
            let (mut of_left, mut of_offset) = (0.0, f64::MIN_POSITIVE);
            let weight = |row: &Row| {
                let deviations = off(row, middle) / (half_weight * scale_mm);
                1.0 / (1.0 + deviations * deviations)
            };
            for row in rows {
                let weighted = weight(row) * row.by_offset;
                (of_columns.iter_mut().zip(&row.columns)).for_each(|(sum, f)| *sum += weighted * f);
                of_left += weighted * row.left_mm;
                of_offset += weighted * row.by_offset;
            }
            let share = of_columns.map(|sum| sum / of_offset);
            for row in rows {
                let weight = weight(row);
                let f: [f64; COLUMNS] =
                    std::array::from_fn(|i| row.columns[i] - share[i] * row.by_offset);
                let left = row.left_mm - of_left / of_offset * row.by_offset;
                for i in 0..COLUMNS {
                    let weighted = weight * f[i];
                    right[i] += weighted * left;
                    // Cholesky reads no more than the lower triangle; whole SIMD registers of it.
                    let row = gram[i].iter_mut().zip(&f).take((i + 1).next_multiple_of(4));
                    row.for_each(|(sum, f)| *sum += weighted * f);
                }
            }
            projected.push((share, of_left / of_offset));
        }
        let mut pull = [0.0; COLUMNS];
        for (i, term) in TERMS.iter().enumerate() {
            if let Some(prior) = term.prior {
                pull[i] = (noise_mm / prior) * (noise_mm / prior);
                right[i] -= pull[i] * values[i];
            }
        }
        // A column that stands still within the segments tells nothing.
        let least = 1e-12 * count as f64;
        let scales: Vec<f64> = (0..COLUMNS)
            .map(|i| 1.0 / (gram[i][i] + pull[i]).max(least).sqrt())
            .collect();
        let scaled = DMatrix::from_fn(COLUMNS, COLUMNS, |i, j| {
            let held = if i == j { pull[i] } else { 0.0 };
            (gram[i][j] + held) * scales[i] * scales[j] + if i == j { RIDGE } else { 0.0 }
        });
        let factor = Cholesky::new(scaled)?;
        let solved = factor.solve(&DVector::from_fn(COLUMNS, |i, _| right[i] * scales[i]));
        let step: Vec<f64> = (0..COLUMNS).map(|i| solved[i] * scales[i]).collect();
        if step.iter().any(|x| !x.is_finite()) {
            return None;
        }
        (values.iter_mut().zip(&step)).for_each(|(value, step)| *value += step);
        let fit = ProbeFit {
            probe,
            lag_s: *lag_s,
            offsets_mm: projected.iter().map(|(_, offset)| *offset).collect(),
        };
        *lag_s += step[PER_PROBE];
        Some(fit)
    }

    fn left_m(&self, log: &LogSignals, k: usize, fit: &ProbeFit) -> Vec<f64> {
        let mut values = vec![0.0; log.len()];
        for (segment, offset_mm) in log.segments.iter().zip(&fit.offsets_mm) {
            for row in segment.clone().filter(|&row| log.usable[row]) {
                let here = self.row(log, (k, &fit.probe), fit.lag_s, row);
                values[row] = (here.left_mm - offset_mm * here.by_offset) * 1e-3;
            }
        }
        values
    }

    /// How an error of 1 m of each channel of [`LogSignals::channels`] shows in the residuals of
    /// the three probes at a row, m.
    pub(super) fn of_errors(&self, log: &LogSignals, row: usize) -> Vec<[f64; 3]> {
        let here = &log.rows[row];
        let planar_mm = here.reference.map(|x| x * 1e3);
        let mut shown = vec![[0.0; 3]; log.channels.len()];
        for (k, fit) in self.fits.iter().enumerate() {
            let reading = fit.probe.read(planar_mm, here.vertical);
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
                let signal_mm = fit.probe.signal_mm(planar_mm, moved);
                shown[6 + gap][k] = -(signal_mm - reading.signal_mm) * 1e-3 / STEP_M;
            }
        }
        shown
    }
}
