//! One row of a log, from cells to codes and SI units.

use super::cell::{CellFault, Code};
use super::header::{Columns, Source};
use super::layout::Quantity;
use super::record::Record;
use super::time::Clock;
use crate::dataset::{LoggedFrame, Row};
use crate::stage::{CodeScale, Interferometer, Stage};
use nalgebra::{Matrix3, Vector3};
use runtime::capacitive::vertical_per_gap;
use runtime::frame::MISSING_CODE;
use runtime::{RawFrame, VerticalPose};

/// Largest sensible rotation, rad: the models are linear in rotations.
pub const ROTATION_MAX_RAD: f64 = 0.1;
/// Largest sensible temperature, m degC. Kelvin taken for degrees Celsius are beyond it.
const TEMPERATURE_MAX_MC: f64 = 2e5;
/// Larger numbers are no kelvin, either, m degC.
const KELVIN_MAX_MC: f64 = 1e6;
/// Largest sensible displacement, in full scales of its sensor: no useful sensor has a quarter of its designed
/// sensitivity.
const FULL_SCALES: f64 = 4.0;

/// A bad cell: its number, from 0, and its fault.
pub(super) struct BadCell {
    pub(super) cell: usize,
    pub(super) fault: CellFault,
}

/// Turns the records of one log into rows.
pub(super) struct RowReader<'a> {
    pub(super) columns: Columns,
    hall: &'a CodeScale,
    capacitive: &'a CodeScale,
    vertical_per_gap: Matrix3<f64>,
    interferometer: &'a Interferometer,
    displacement_max_m: f64,
    height_max_m: f64,
    /// m degC at zero of the columns.
    zero_mc: f64,
    keep_saturated: bool,
    clock: Clock,
    /// Number of voltages, and the sum of their differences from whole codes.
    between_codes: (usize, f64),
}

/// Largest displacement that a log may hold, m.
pub fn displacement_max_m(stage: &Stage) -> f64 {
    FULL_SCALES * full_scale_m(&stage.hall)
}

fn full_scale_m(scale: &CodeScale) -> f64 {
    let codes = scale.window.low.abs().max(scale.window.high.abs());
    scale.m_per_count * f64::from(codes)
}

impl<'a> RowReader<'a> {
    pub(super) fn new(columns: Columns, stage: &'a Stage, keep_saturated: bool) -> Self {
        Self {
            columns,
            hall: &stage.hall,
            capacitive: &stage.capacitive,
            // A checked stage has its sensors in a triangle.
            vertical_per_gap: vertical_per_gap(&stage.capacitive_probes_m).unwrap_or_default(),
            interferometer: &stage.interferometer,
            displacement_max_m: displacement_max_m(stage),
            height_max_m: FULL_SCALES * full_scale_m(&stage.capacitive),
            zero_mc: stage.temperature.scale_mc[1],
            keep_saturated,
            clock: Clock::default(),
            between_codes: (0, 0.0),
        }
    }

    /// Mean difference of voltages from whole codes; 0 without voltages.
    pub(super) fn between_codes(&self) -> f64 {
        let (cells, sum) = self.between_codes;
        sum / cells.max(1) as f64
    }

    /// The number of the movement, if the log has a column for it.
    pub(super) fn movement(&self, row: &Record) -> Result<Option<i64>, BadCell> {
        let Some(Source { cell, .. }) = self.columns.movement else {
            return Ok(None);
        };
        let number = row.cell(cell).whole("movement numbers");
        number.map(Some).map_err(|fault| BadCell { cell, fault })
    }

    /// The time, us, a whole number.
    pub(super) fn t_us(&mut self, row: &Record) -> Result<f64, BadCell> {
        let Source { cell, scale } = self.columns.time;
        let t_us = self.clock.t_us(row.cell(cell), scale);
        t_us.map(f64::round)
            .map_err(|fault| BadCell { cell, fault })
    }

    /// The row at `t_us`; its movement and sequence number are still 0.
    pub(super) fn row(&mut self, row: &Record, t_us: i64) -> Result<Row, BadCell> {
        let hall = self.codes(row, self.columns.hall, self.hall)?;
        let [mount, body] = self.columns.temperature;
        let temperature_mc = [
            self.temperature_mc(row, mount)?,
            self.temperature_mc(row, body)?,
        ];
        let (set, [a, b, c]) = self.columns.vertical;
        let mut capacitive = [0; 3];
        let height = |source| scaled(row, source, self.height_max_m, "m");
        let rotation = |source| scaled(row, source, ROTATION_MAX_RAD, "rad");
        let vertical_per_gap = self.vertical_per_gap;
        let from_gaps = |gaps_m| (vertical_per_gap * Vector3::from(gaps_m)).into();
        let vertical = match set {
            Quantity::VERTICAL => [height(a)?, rotation(b)?, rotation(c)?],
            Quantity::GAP_LENGTHS => from_gaps([height(a)?, height(b)?, height(c)?]),
            _ => {
                capacitive = self.codes(row, [a, b, c], self.capacitive)?;
                let m_per_count = self.capacitive.m_per_count;
                from_gaps(capacitive.map(|code| f64::from(code) * m_per_count))
            }
        };
        let codes = RawFrame::new(hall, capacitive, 0, t_us as u32);
        let frame = LoggedFrame {
            codes: codes.with_temperature_mc(temperature_mc),
            vertical: (set != Quantity::GAPS)
                .then(|| VerticalPose::from_array(vertical.map(|x| x as f32))),
        };
        Ok(Row {
            movement: 0,
            t_us,
            frame,
            signal_m: hall.map(|code| f64::from(code) * self.hall.m_per_count),
            vertical,
            reference: self.reference(row, vertical)?,
        })
    }

    fn codes(
        &mut self,
        row: &Record,
        sources: [Source; 3],
        converter: &CodeScale,
    ) -> Result<[i32; 3], BadCell> {
        let mut one = |Source { cell, scale }: Source| {
            let bad = |fault| BadCell { cell, fault };
            let Code {
                code,
                fraction,
                is_saturated,
            } = row.cell(cell).code(scale, converter).map_err(bad)?;
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

    /// m degC, or [`MISSING_CODE`] where the log has no column or nothing in it.
    fn temperature_mc(&self, row: &Record, source: Option<Source>) -> Result<i32, BadCell> {
        let there = source.filter(|source| !row.cell(source.cell).text.trim_ascii().is_empty());
        there.map_or(Ok(MISSING_CODE), |source| {
            let above_zero = scaled(row, source, f64::MAX, "m degC")?;
            let temperature_mc = above_zero + self.zero_mc;
            match temperature_mc.abs() <= TEMPERATURE_MAX_MC {
                true => Ok(temperature_mc.round() as i32),
                false => Err(BadCell {
                    cell: source.cell,
                    fault: CellFault::Temperature {
                        celsius: temperature_mc * 1e-3,
                        unit: match temperature_mc < KELVIN_MAX_MC {
                            true if self.zero_mc < 0.0 => "C",
                            true => "K",
                            false => "mC",
                        },
                    },
                }),
            }
        })
    }

    /// X, Y, Rz: m, m, rad.
    fn reference(&self, row: &Record, vertical: [f64; 3]) -> Result<[f64; 3], BadCell> {
        let length = |source| scaled(row, source, self.displacement_max_m, "m");
        let Some((set, [x, y, z])) = self.columns.reference else {
            return Ok([0.0; 3]);
        };
        let (x, y) = (length(x)?, length(y)?);
        if set != Quantity::BEAMS {
            return Ok([x, y, scaled(row, z, ROTATION_MAX_RAD, "rad")?]);
        }
        Ok(self.interferometer.pose([x, y, length(z)?], vertical))
    }
}

#[inline]
fn scaled(row: &Record, source: Source, limit: f64, unit: &'static str) -> Result<f64, BadCell> {
    let Source { cell, scale } = source;
    let value = row.cell(cell).scaled(scale, limit, unit);
    value.map_err(|fault| BadCell { cell, fault })
}
