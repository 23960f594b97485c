//! A fit to an excerpt, judged on all rows of the logs.

use super::{Fit, FitError, FitSettings, FitWarning, RANGE_MARGIN};
use crate::input::dataset::Dataset;
use crate::input::stage::Stage;
use crate::judge::Zeros;
use crate::judge::identify::check_explained;
use crate::judge::of_rows::{NO_LIMIT, OfRows, limit};
use crate::judge::stretches::far_worse;
use crate::solve::robust::Loss;
use runtime::calibration::Origin;
use runtime::parameters::FitRecord;

impl Fit {
    /// Judges the fit of an excerpt on all rows, and widens its range to theirs.
    pub(super) fn judge_whole(
        &mut self,
        dataset: &Dataset,
        stage: &Stage,
        settings: &FitSettings,
    ) -> Result<(), FitError> {
        let Some(whole) = &dataset.whole else {
            return Ok(());
        };
        let limit = match self.loss {
            Loss::None => NO_LIMIT,
            Loss::Huber | Loss::Cauchy => limit(&self.decoded, dataset, &self.outliers),
        };
        let rows = OfRows::new(&self.set, whole, limit);
        let zeros = Zeros::of_model(self.model);
        let [judged, kept] = rows.judgements(&self.set, whole, stage, zeros);
        if !settings.force {
            check_explained(judged.motion, &kept.errors, self.model)?;
        }
        self.widen_range(stage, (rows.planar, rows.vertical))?;
        let axes = judged.errors.axes;
        self.set.fit = FitRecord {
            rows: u32::try_from(whole.rows()).unwrap_or(u32::MAX),
            rms: axes.map(|a| a.rms as f32),
            peak: axes.map(|a| a.peak as f32),
            ..self.set.fit
        };
        self.warnings
            .extend(FitWarning::of_rest(&self.judgement.errors, &judged.errors));
        // Of all rows and movements, where those of the excerpt were counted.
        self.warnings.retain(|warning| !warning.is_count());
        let counts = FitWarning::of_counts(&judged.zeros, judged.undecoded);
        self.warnings.extend(counts);
        self.stretches = far_worse(&rows.spreads, whole);
        self.left_out = rows.left_out;
        self.whole = Some(judged);
        Ok(())
    }

    /// Widens the range of the calibration to what all rows reach: m, m, rad; m, rad, rad.
    fn widen_range(
        &mut self,
        stage: &Stage,
        (planar, vertical): ([f64; 3], [f64; 3]),
    ) -> Result<(), FitError> {
        let to = &mut self.calibration;
        for axis in 0..3 {
            let wider = |range: f64, reach: f64| range.max(RANGE_MARGIN * reach);
            to.calibrated_planar[axis] = wider(to.calibrated_planar[axis], planar[axis]);
            to.calibrated_vertical[axis] = wider(to.calibrated_vertical[axis], vertical[axis]);
        }
        let origin = Origin {
            serial: self.set.serial.clone(),
            created: self.set.created.clone(),
            logs_sha256: self.set.logs_sha256,
            fit: self.set.fit,
        };
        self.set = to.prepare(&origin).map_err(FitError::Unusable)?;
        if self.field.is_some() {
            self.warnings.retain(|warning| !warning.is_of_range());
            let ranges = [to.calibrated_planar, to.calibrated_vertical];
            let [planar, vertical] = ranges.map(|range| range.map(|most| most / RANGE_MARGIN));
            self.warnings
                .extend(FitWarning::of_ranges(stage, planar, vertical));
        }
        Ok(())
    }
}
