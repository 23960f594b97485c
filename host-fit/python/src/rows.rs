//! The rows to decode: of a log, or codes and temperatures in arrays.

use crate::arrays::{codes, reals, same_rows, slice};
use crate::error::wrong;
use crate::log::Log;
use numpy::PyReadonlyArray2;
use pyo3::prelude::*;
use runtime::RawFrame;
use runtime::frame::MISSING_CODE;
use std::ops::Range;

/// What a call decodes.
pub enum Given<'a, 'py> {
    /// All rows of a log.
    Log(&'a Log),
    /// Codes.
    Codes(Codes<'py>),
}

/// Codes of the sensors and temperatures, checked, with as many rows each.
pub struct Codes<'py> {
    hall: PyReadonlyArray2<'py, i32>,
    caps: PyReadonlyArray2<'py, i32>,
    temperature: Option<Vec<[i32; 2]>>,
}

/// The rows of [`Codes`].
#[derive(Clone, Copy)]
pub struct Rows<'a> {
    hall: &'a [[i32; 3]],
    caps: &'a [[i32; 3]],
    temperature: Option<&'a [[i32; 2]]>,
}

impl<'a, 'py> Given<'a, 'py> {
    /// From the arguments of a call: a log, or codes.
    pub fn new(
        log: Option<&'a Bound<'py, Log>>,
        hall: Option<&Bound<'py, PyAny>>,
        caps: Option<&Bound<'py, PyAny>>,
        temperatures: [Option<&Bound<'py, PyAny>>; 2],
    ) -> PyResult<Self> {
        let (hall, caps) = match (log, hall, caps) {
            (Some(log), None, None) if temperatures.iter().all(Option::is_none) => {
                return Ok(Self::Log(log.get()));
            }
            (None, Some(hall), Some(caps)) => (codes("hall", hall)?, codes("caps", caps)?),
            (Some(_), ..) => {
                return Err(wrong("log", "a log has its codes and temperatures itself"));
            }
            (None, None, _) => return Err(wrong("hall", "is missing")),
            (None, _, None) => return Err(wrong("caps", "is missing")),
        };
        let rows = hall.as_array().nrows();
        same_rows("caps", caps.as_array().nrows(), "hall", rows)?;
        Ok(Self::Codes(Codes {
            hall,
            caps,
            temperature: temperatures_mc(rows, temperatures)?,
        }))
    }
}

impl Codes<'_> {
    /// All rows.
    pub fn rows(&self) -> PyResult<Rows<'_>> {
        Ok(Rows {
            hall: slice(self.hall.as_slice())?.as_chunks().0,
            caps: slice(self.caps.as_slice())?.as_chunks().0,
            temperature: self.temperature.as_deref(),
        })
    }
}

impl Rows<'_> {
    /// How many there are.
    pub const fn len(&self) -> usize {
        self.hall.len()
    }

    /// One of them, numbered from 0.
    #[inline(always)]
    pub fn frame(&self, row: usize) -> RawFrame {
        let frame = RawFrame::new(self.hall[row], self.caps[row], row as u32, 0);
        match self.temperature {
            Some(all) => frame.with_temperature_mc(all[row]),
            None => frame,
        }
    }

    /// Some of them, in order.
    #[inline(always)]
    pub fn frames(&self, rows: Range<usize>) -> impl Iterator<Item = RawFrame> {
        rows.map(|row| self.frame(row))
    }
}

/// Temperatures of mount and body as codes, m degC; `None` where none are given.
fn temperatures_mc(
    rows: usize,
    given: [Option<&Bound<'_, PyAny>>; 2],
) -> PyResult<Option<Vec<[i32; 2]>>> {
    if given.iter().all(Option::is_none) {
        return Ok(None);
    }
    let mut all = vec![[MISSING_CODE; 2]; rows];
    for (sensor, (argument, given)) in ["mount", "body"].into_iter().zip(given).enumerate() {
        let Some(given) = given else { continue };
        let celsius = reals(argument, given)?;
        let celsius = slice(celsius.as_slice())?;
        same_rows(argument, celsius.len(), "hall", rows)?;
        for (row, (code, celsius)) in all.iter_mut().zip(celsius).enumerate() {
            match celsius.abs() {
                ..=1e6 => code[sensor] = (celsius * 1e3).round() as i32,
                _ if celsius.is_nan() => {}
                _ => {
                    let problem = format!("row {row}: {celsius} degC is no temperature");
                    return Err(wrong(argument, problem));
                }
            }
        }
    }
    Ok(Some(all))
}
