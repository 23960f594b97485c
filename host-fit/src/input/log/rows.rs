//! One row of a log, from cells to codes and SI units.

use super::cell::{self, CellFault, Code};
use super::header::{Columns, ReferenceSource, Source, VerticalSource};
use super::line::Line;
use super::time::{Clock, Form};
use crate::input::stage::{CodeScale, Stage};
use crate::input::whole::chunk::{Sample, SampledVertical};

/// Largest sensible rotation, rad: the models are linear in rotations.
const ROTATION_MAX_RAD: f64 = 0.1;
/// Largest sensible displacement, in full scales of the sensor that follows it: no sensor
/// that is worth reading has a quarter of its designed sensitivity.
const FULL_SCALES: f64 = 4.0;

/// A bad cell: which one, from 0, and what is wrong.
pub(super) struct BadCell {
    pub(super) cell: usize,
    pub(super) fault: CellFault,
}

/// Turns the records of one log into rows.
#[derive(Clone)]
pub(super) struct RowReader<'a> {
    columns: &'a Columns,
    hall: &'a CodeScale,
    capacitive: &'a CodeScale,
    y_baseline_m: f64,
    displacement_max_m: f64,
    height_max_m: f64,
    keep_saturated: bool,
    pub(super) clock: Clock,
    pub(super) between_codes: BetweenCodes,
}

/// How far voltages are from whole codes.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct BetweenCodes {
    cells: usize,
    sum: f64,
}

impl BetweenCodes {
    /// With those of another part of the log.
    pub(super) fn and(self, other: Self) -> Self {
        Self {
            cells: self.cells + other.cells,
            sum: self.sum + other.sum,
        }
    }

    /// On average; 0 if the log has none.
    pub(super) fn mean(self) -> f64 {
        self.sum / self.cells.max(1) as f64
    }
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
            y_baseline_m: stage.y_baseline_m,
            displacement_max_m: FULL_SCALES * full_scale_m(&stage.hall),
            height_max_m: FULL_SCALES * full_scale_m(&stage.capacitive),
            keep_saturated,
            clock: Clock::default(),
            between_codes: BetweenCodes::default(),
        }
    }

    /// The number of the movement, if the log has a column for it.
    pub(super) fn movement(&self, line: &Line<'_>) -> Result<Option<i64>, BadCell> {
        let Some(Source { cell, .. }) = self.columns.movement else {
            return Ok(None);
        };
        if let Some(number) = line.integer(cell) {
            return Ok(Some(number));
        }
        let number = cell::whole(line.cell(cell), "movement numbers");
        number.map(Some).map_err(|fault| BadCell { cell, fault })
    }

    /// The time, us.
    pub(super) fn t_us(&mut self, line: &Line<'_>) -> Result<i64, BadCell> {
        let Source { cell, scale } = self.columns.time;
        if let (Some(number), 1.0, Some(Form::Number)) =
            (line.integer(cell), scale, self.clock.form)
        {
            return Ok(number);
        }
        let t_us = self.clock.t_us(line.cell(cell), scale);
        // Within the range that the limit leaves.
        t_us.map(|t_us| t_us.round() as i64)
            .map_err(|fault| BadCell { cell, fault })
    }

    /// The sample of a row at `t_us`.
    #[inline]
    pub(super) fn sample(&mut self, line: &Line<'_>, t_us: i64) -> Result<Sample, BadCell> {
        let hall = self.codes(line, &self.columns.hall, self.hall)?;
        let columns = self.columns;
        let vertical = match &columns.vertical {
            VerticalSource::Codes(sources) => {
                SampledVertical::Codes(self.codes(line, sources, self.capacitive)?)
            }
            VerticalSource::Pose([z, rx, ry]) => SampledVertical::Pose([
                scaled(line, z, self.height_max_m, "m")?,
                scaled(line, rx, ROTATION_MAX_RAD, "rad")?,
                scaled(line, ry, ROTATION_MAX_RAD, "rad")?,
            ]),
        };
        Ok(Sample {
            t_us,
            hall,
            vertical,
            reference: self.reference(line)?,
        })
    }

    fn codes(
        &mut self,
        line: &Line<'_>,
        sources: &[Source; 3],
        converter: &CodeScale,
    ) -> Result<[i32; 3], BadCell> {
        let mut one = |&Source { cell, scale }: &Source| {
            let bad = |fault| BadCell { cell, fault };
            let Code {
                code,
                fraction,
                is_saturated,
            } = cell::code(line.integer(cell), line.cell(cell), scale, converter).map_err(bad)?;
            if is_saturated && !self.keep_saturated {
                return Err(bad(CellFault::Saturated { code }));
            }
            if scale != 1.0 {
                self.between_codes.cells += 1;
                self.between_codes.sum += fraction.abs();
            }
            Ok(code)
        };
        let [a, b, c] = sources;
        Ok([one(a)?, one(b)?, one(c)?])
    }

    /// X, Y, Rz: m, m, rad.
    fn reference(&self, line: &Line<'_>) -> Result<[f64; 3], BadCell> {
        let length = |source| scaled(line, source, self.displacement_max_m, "m");
        match &self.columns.reference {
            ReferenceSource::Absent => Ok([0.0; 3]),
            ReferenceSource::Pose([x, y, rz]) => Ok([
                length(x)?,
                length(y)?,
                scaled(line, rz, ROTATION_MAX_RAD, "rad")?,
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
    line: &Line<'_>,
    source: &Source,
    limit: f64,
    unit: &'static str,
) -> Result<f64, BadCell> {
    let Source { cell, scale } = *source;
    if let Some(number) = line.integer(cell) {
        let value = number as f64 * scale;
        if value.abs() <= limit {
            return Ok(value);
        }
    }
    cell::scaled(line.cell(cell), scale, limit, unit).map_err(|fault| BadCell { cell, fault })
}
