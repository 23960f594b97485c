//! One row of a log, from cells to SI units.

use super::cell::{self, CellFault, Code};
use super::header::{Columns, ReferenceSource, Source, VerticalSource};
use super::table::Table;
use super::time::Clock;
use crate::input::dataset::{LoggedFrame, Row};
use crate::input::stage::{CodeScale, Stage};
use runtime::capacitive::{vertical_pose, vertical_rows};
use runtime::{RawFrame, VerticalPose};

/// Largest sensible rotation, rad: the models are linear in rotations.
pub(crate) const ROTATION_MAX_RAD: f64 = 0.1;
/// Largest sensible displacement, in full scales of the sensor that follows it: no sensor
/// that is worth reading has a quarter of its designed sensitivity.
const FULL_SCALES: f64 = 4.0;

/// A bad cell: which one, from 0, and what is wrong.
pub(super) struct BadCell {
    pub(super) cell: usize,
    pub(super) fault: CellFault,
}

/// Turns the records of one log into rows.
pub(super) struct RowReader<'a> {
    columns: &'a Columns,
    hall: &'a CodeScale,
    capacitive: &'a CodeScale,
    vertical_rows: [[f64; 3]; 3],
    y_baseline_m: f64,
    displacement_max_m: f64,
    height_max_m: f64,
    keep_saturated: bool,
    clock: Clock,
    /// Voltages: how many, and the sum of how far they are from whole codes.
    between_codes: (usize, f64),
}

/// Largest displacement that a log may hold, m.
pub(crate) fn displacement_max_m(stage: &Stage) -> f64 {
    FULL_SCALES * full_scale_m(&stage.hall)
}

fn full_scale_m(scale: &CodeScale) -> f64 {
    let codes = scale.window.low.abs().max(scale.window.high.abs());
    scale.m_per_count * f64::from(codes)
}

impl<'a> RowReader<'a> {
    pub(super) fn new(columns: &'a Columns, stage: &'a Stage, keep_saturated: bool) -> Self {
        Self {
            columns,
            hall: &stage.hall,
            capacitive: &stage.capacitive,
            // A checked stage has its sensors in a triangle.
            vertical_rows: vertical_rows(&stage.capacitive_probes_m).unwrap_or_default(),
            y_baseline_m: stage.y_baseline_m,
            displacement_max_m: displacement_max_m(stage),
            height_max_m: FULL_SCALES * full_scale_m(&stage.capacitive),
            keep_saturated,
            clock: Clock::default(),
            between_codes: (0, 0.0),
        }
    }

    /// The number of the movement, if the log has a column for it.
    pub(super) fn movement(&self, table: &Table<'_>) -> Result<Option<i64>, BadCell> {
        let Some(Source { cell, .. }) = self.columns.movement else {
            return Ok(None);
        };
        let number = cell::whole(table.cell(cell), "movement numbers");
        number.map(Some).map_err(|fault| BadCell { cell, fault })
    }

    /// The time, us.
    pub(super) fn t_us(&mut self, table: &Table<'_>) -> Result<i64, BadCell> {
        let Source { cell, scale } = self.columns.time;
        let t_us = self.clock.t_us(table.cell(cell), scale);
        // Within the range that the limit leaves.
        t_us.map(|t_us| t_us.round() as i64)
            .map_err(|fault| BadCell { cell, fault })
    }

    /// How far voltages were from whole codes, on average; 0 if the log has none.
    pub(super) fn mean_between_codes(&self) -> f64 {
        let (cells, sum) = self.between_codes;
        sum / cells.max(1) as f64
    }

    /// The row of slot `movement` at `t_us`; its sequence number is still 0.
    pub(super) fn row(
        &mut self,
        table: &Table<'_>,
        movement: usize,
        t_us: i64,
    ) -> Result<Row, BadCell> {
        let hall = self.codes(table, &self.columns.hall, self.hall)?;
        let time_us = t_us as u32;
        let columns = self.columns;
        let (frame, vertical) = match &columns.vertical {
            VerticalSource::Codes(sources) => {
                let capacitive = self.codes(table, sources, self.capacitive)?;
                let gaps_m = capacitive.map(|code| f64::from(code) * self.capacitive.m_per_count);
                let frame = LoggedFrame::Codes(RawFrame {
                    hall,
                    capacitive,
                    sequence: 0,
                    time_us,
                });
                (frame, vertical_pose(&self.vertical_rows, gaps_m).to_array())
            }
            VerticalSource::Pose([z, rx, ry]) => {
                let vertical = [
                    scaled(table, z, self.height_max_m, "m")?,
                    scaled(table, rx, ROTATION_MAX_RAD, "rad")?,
                    scaled(table, ry, ROTATION_MAX_RAD, "rad")?,
                ];
                let frame = LoggedFrame::HallCodes {
                    hall,
                    vertical: VerticalPose::from_array(vertical.map(|x| x as f32)),
                    sequence: 0,
                    time_us,
                };
                (frame, vertical)
            }
        };
        Ok(Row {
            movement,
            t_us,
            frame,
            signal_m: hall.map(|code| f64::from(code) * self.hall.m_per_count),
            vertical,
            reference: self.reference(table)?,
        })
    }

    fn codes(
        &mut self,
        table: &Table<'_>,
        sources: &[Source; 3],
        converter: &CodeScale,
    ) -> Result<[i32; 3], BadCell> {
        let mut one = |&Source { cell, scale }: &Source| {
            let bad = |fault| BadCell { cell, fault };
            let Code {
                code,
                fraction,
                is_saturated,
            } = cell::code(table.cell(cell), scale, converter).map_err(bad)?;
            if is_saturated && !self.keep_saturated {
                return Err(bad(CellFault::Saturated { code }));
            }
            if scale != 1.0 {
                self.between_codes.0 += 1;
                self.between_codes.1 += fraction.abs();
            }
            Ok(code)
        };
        let [a, b, c] = sources;
        Ok([one(a)?, one(b)?, one(c)?])
    }

    /// X, Y, Rz: m, m, rad.
    fn reference(&self, table: &Table<'_>) -> Result<[f64; 3], BadCell> {
        let length = |source| scaled(table, source, self.displacement_max_m, "m");
        match &self.columns.reference {
            ReferenceSource::Absent => Ok([0.0; 3]),
            ReferenceSource::Pose([x, y, rz]) => Ok([
                length(x)?,
                length(y)?,
                scaled(table, rz, ROTATION_MAX_RAD, "rad")?,
            ]),
            ReferenceSource::Beams([x, y1, y2]) => {
                let (x, y1, y2) = (length(x)?, length(y1)?, length(y2)?);
                // libm, not the platform's: the same bits everywhere.
                let rz = libm::atan((y1 - y2) / self.y_baseline_m);
                Ok([x, (y1 + y2) / 2.0, rz])
            }
        }
    }
}

fn scaled(
    table: &Table<'_>,
    source: &Source,
    limit: f64,
    unit: &'static str,
) -> Result<f64, BadCell> {
    let cell = source.cell;
    cell::scaled(table.cell(cell), source.scale, limit, unit)
        .map_err(|fault| BadCell { cell, fault })
}
