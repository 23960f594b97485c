//! A log in means over a few rows each, rows far from the others left out.

use crate::diagnose::signals::robust_deviation;
use crate::input::dataset::Dataset;
use crate::input::stage::Stage;
use crate::solve::field::blocks::{FieldRow, Rows};
use crate::solve::field::probe::Probe;
use crate::statistics::median;
use std::ops::Range;

/// A row this many times its white noise off the middle of its block, as beside a step, is left out: noise
/// alone does that once in 10^9 rows.
const SPIKE: f64 = 6.0;

/// Of long logs a mean is over so many more rows that there are not many more than these: a scan is
/// quick, and onsets within a tenth of a second.
const MEANS_MAX: usize = 4000;

/// A few rows that follow each other, as one.
#[derive(Clone, Debug)]
pub(super) struct Mean {
    /// Means of the rows; their number is the weight.
    pub(super) row: FieldRow,
    /// The first of the rows in the dataset.
    pub(super) first: usize,
    /// Beams X, Y1, Y2 and gaps 1, 2, 3, mm.
    pub(super) beams_mm: [f64; 3],
    pub(super) gaps_mm: [f64; 3],
}

/// A log.
#[derive(Debug)]
pub(super) struct Log {
    pub(super) means: Vec<Mean>,
    /// The means of each movement that has rows.
    pub(super) movements: Vec<Range<usize>>,
    /// White noise of A, B, C from row to row, mm.
    pub(super) white_mm: [f64; 3],
    /// Half the distance of the Y beams, m.
    pub(super) half_m: f64,
    /// Errors of the resets, mm, mm, mrad, where they are declared.
    pub(super) resets_mm: Option<[f64; 3]>,
}

impl Log {
    /// The rows of a dataset; `probes` are those of a first fit.
    pub(super) fn new(dataset: &Dataset, stage: &Stage, probes: &[Probe; 3]) -> Self {
        let selected: Vec<usize> = (0..dataset.rows.len()).collect();
        let rows = Rows::new(dataset, &selected);
        let residuals = rows.residuals_mm(probes, 0.0, &vec![[0.0; 3]; rows.movements.len()]);
        let least_mm = stage.hall.m_per_count * 1e3 / 12f64.sqrt();
        let white_mm = [0, 1, 2].map(|k| white(&rows, &residuals, k).max(least_mm));
        let half = 0.5 * stage.y_baseline_m;
        let mean = |block: Range<usize>| {
            let middle = [0, 1, 2].map(|k| {
                let mut of_block: Vec<f64> =
                    residuals[block.clone()].iter().map(|r| r[k]).collect();
                median(&mut of_block).unwrap_or(0.0)
            });
            let is_near = |row: &usize| {
                let off = |k: usize| (residuals[*row][k] - middle[k]).abs();
                (0..3).all(|k| off(k) <= SPIKE * white_mm[k])
            };
            let near: Vec<FieldRow> = block
                .clone()
                .filter(is_near)
                .map(|row| rows.rows[row])
                .collect();
            let row = mean_row(&near)?;
            let [x, y, rz] = row.reference_mm;
            let gaps_m = runtime::capacitive::gaps_m(
                &stage.capacitive_probes_m,
                &runtime::VerticalPose::from_array(row.vertical),
            );
            Some(Mean {
                row,
                first: block.start,
                beams_mm: [x, y + half * rz, y - half * rz],
                gaps_mm: gaps_m.map(|gap| gap * 1e3),
            })
        };
        let together = rows.blocks.len().div_ceil(MEANS_MAX).max(1);
        let (mut means, mut movements) = (Vec::new(), Vec::new());
        for movement in &rows.movements {
            let start = means.len();
            let some = rows.blocks[movement.clone()].chunks(together);
            means.extend(some.filter_map(|some| mean(some[0].start..some[some.len() - 1].end)));
            if means.len() > start {
                movements.push(start..means.len());
            }
        }
        Self {
            means,
            movements,
            white_mm,
            half_m: half,
            resets_mm: stage.resets_mm(),
        }
    }

    /// Changes of X, Y, Rz (mm/s, mm/s, mrad/s) by the lag of each beam.
    pub(super) fn by_lag(&self, row: &FieldRow) -> [[f64; 3]; 3] {
        let [x, y, rz] = row.rate_mm_per_s;
        let (y1, y2) = (0.5 * (y + self.half_m * rz), 0.5 * (y - self.half_m * rz));
        [
            [x, 0.0, 0.0],
            [0.0, y1, y1 / self.half_m],
            [0.0, y2, -y2 / self.half_m],
        ]
    }

    /// Where the stage was: the beams with their lags and the offset taken off.
    pub(super) fn planar_mm(
        &self,
        row: &FieldRow,
        lags_s: [f64; 3],
        offset_mm: [f64; 3],
    ) -> [f64; 3] {
        let mut planar_mm = row.planar_mm(0.0, offset_mm);
        for (rates, lag_s) in self.by_lag(row).iter().zip(lags_s) {
            planar_mm
                .iter_mut()
                .zip(rates)
                .for_each(|(x, rate)| *x += rate * lag_s);
        }
        planar_mm
    }

    /// How many numbers the means hold beyond the offsets of the movements.
    pub(super) fn count(&self) -> f64 {
        let offsets = self.resets_mm.map_or(self.movements.len(), |_| 0);
        3.0 * (self.means.len() - offsets) as f64
    }

    /// Poses (X, Y, Rz and Z, Rx, Ry: m, rad) spread over the log: what a model is good for that has no more
    /// terms.
    pub(super) fn poses(&self) -> Vec<([f64; 3], [f64; 3])> {
        const COUNT: usize = 256;
        let apart = (self.means.len() / COUNT).max(1);
        let rows = self.means.iter().step_by(apart).map(|mean| &mean.row);
        rows.map(|row| (row.reference_mm.map(|x| x * 1e-3), row.vertical))
            .collect()
    }
}

fn mean_row(rows: &[FieldRow]) -> Option<FieldRow> {
    let share = 1.0 / rows.len() as f64;
    let mean = |of: &dyn Fn(&FieldRow) -> f64| share * rows.iter().map(of).sum::<f64>();
    let three = |of: &dyn Fn(&FieldRow) -> [f64; 3]| [0, 1, 2].map(|k| mean(&|row| of(row)[k]));
    (!rows.is_empty()).then(|| FieldRow {
        time_s: mean(&|row| row.time_s),
        signal_mm: three(&|row| row.signal_mm),
        vertical: three(&|row| row.vertical),
        reference_mm: three(&|row| row.reference_mm),
        rate_mm_per_s: three(&|row| row.rate_mm_per_s),
        warmth_k: [[0.0; 2]; 3],
        weight: rows.len() as f64,
    })
}

/// White noise of a probe from second differences within movements, by their median.
fn white(rows: &Rows, residuals: &[[f64; 3]], probe: usize) -> f64 {
    let differences = rows
        .movement_rows()
        .flat_map(|movement| residuals[movement].windows(3))
        .map(|w| (w[0][probe] - 2.0 * w[1][probe]) + w[2][probe]);
    robust_deviation(differences) / 6f64.sqrt()
}
