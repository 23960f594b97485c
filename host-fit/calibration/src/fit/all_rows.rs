//! A fit to a sample of the rows of logs, judged on all of them.

use super::warning::{is_count, of_counts, of_rest};
use super::{Fit, FitError, FitSettings, RANGE_MARGIN, fit};
use crate::judge::{Judge, Zeros, error, medians};
use hallstage_input::dataset::Dataset;
use hallstage_input::interrupt;
use hallstage_input::log::{LogError, LogReading};
use hallstage_input::stage::Stage;
use hallstage_solver::solve::robust::Loss;
use runtime::calibration::Origin;
use runtime::parameters::FitRecord;

/// A row is left out if its error is this many times as far from the median of its run as that of any
/// row that the fit kept.
const BEYOND: f64 = 1.5;

/// Fits what was read of logs; where that is a sample, all rows are read again, and the calibration is
/// judged on them. After Ctrl-C, which ends a search, the sample alone counts.
///
/// # Errors
/// Those of reading again, and inside the result those of [`fit`].
pub fn fit_log(
    log: &LogReading,
    stage: &Stage,
    settings: &FitSettings,
) -> Result<Result<Fit, FitError>, LogError> {
    let fitted = fit(&log.dataset, stage, settings);
    let (rows, _) = log.dataset.read();
    match fitted {
        Ok(fit) if rows > log.dataset.rows.len() && !interrupt::requested() => {
            fit.judged_on_all_rows(log, stage)
        }
        fitted => Ok(fitted),
    }
}

impl Fit {
    pub(super) fn judged_on_all_rows(
        mut self,
        log: &LogReading,
        stage: &Stage,
    ) -> Result<Result<Self, FitError>, LogError> {
        let logs = log.dataset.logs.len();
        let mut judge = Judge::new(&self.decoded.parameters, stage, logs);
        if self.loss != Loss::None {
            judge = judge.with_limit(self.limit(&log.dataset));
        }
        let decoder = self.set.decoder();
        log.each_row(stage, |log, row| {
            let error = error(&decoder, &row.row);
            judge.take((log, row.movement, row.begins), &row.row, error);
        })?;
        self.all = judge.judgement(Zeros::of_model(self.model));
        self.left_out = self.all.left_out.clone();
        self.errors_solver_zeros = None;
        let axes = self.all.errors.axes;
        self.set.fit = FitRecord {
            rows: u32::try_from(self.all.rows()).unwrap_or(u32::MAX),
            rms: axes.map(|a| a.rms as f32),
            peak: axes.map(|a| a.peak as f32),
            ..self.set.fit
        };
        let rest = of_rest(&self.judgement.errors, &self.all.errors);
        self.warnings.extend(rest);
        // Of all rows and movements, where those of the sample were counted.
        self.warnings.retain(|warning| !is_count(warning));
        let counts = of_counts(&self.all.zeros, self.all.undecoded);
        self.warnings.extend(counts);
        Ok(self.with_range_of_all_rows())
    }

    /// How far a row may be from the median of its run, m, m, rad, by the rows that the fit kept.
    fn limit(&self, dataset: &Dataset) -> [f64; 3] {
        let mut outliers = self.outliers.iter().peekable();
        let mut farthest = [0.0f64; 3];
        for movement in &dataset.movements {
            let kept: Vec<[f64; 3]> = (movement.rows.clone())
                .filter(|row| outliers.next_if_eq(&row).is_none())
                .filter_map(|row| self.decoded.errors[row])
                .collect();
            let middle = medians(|| kept.iter().copied());
            for error in &kept {
                for axis in 0..3 {
                    farthest[axis] = farthest[axis].max((error[axis] - middle[axis]).abs());
                }
            }
        }
        farthest.map(|far| BEYOND * far)
    }

    /// Widens the range of the calibration to what all rows reach.
    fn with_range_of_all_rows(mut self) -> Result<Self, FitError> {
        let to = &mut self.calibration;
        let wider = |range: f64, reach: f64| range.max(RANGE_MARGIN * reach);
        for axis in 0..3 {
            to.calibrated_planar[axis] = wider(to.calibrated_planar[axis], self.all.planar[axis]);
            to.calibrated_vertical[axis] =
                wider(to.calibrated_vertical[axis], self.all.vertical[axis]);
        }
        let origin = Origin {
            serial: self.set.serial.clone(),
            created: self.set.created.clone(),
            logs_sha256: self.set.logs_sha256,
            fit: self.set.fit,
        };
        self.set = to.prepare(&origin).map_err(FitError::Unusable)?;
        Ok(self)
    }
}

#[cfg(test)]
mod tests;
