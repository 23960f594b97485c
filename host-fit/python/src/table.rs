//! Columns as the text of a log.

use crate::error::wrong;
use numpy::PyReadonlyArray1;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use runtime::frame::MISSING_CODE;
use std::io::Write;

/// Rows that are written between two looks at signals.
const ROWS_AT_ONCE: usize = 1 << 16;

/// A column.
enum Column {
    Real(Vec<f64>),
    Whole(Vec<i64>),
    Codes(Vec<i32>),
}

impl Column {
    fn new(array: &Bound<'_, PyAny>) -> PyResult<Self> {
        if let Ok(real) = array.extract::<PyReadonlyArray1<f64>>() {
            return Ok(Self::Real(real.as_array().to_vec()));
        }
        if let Ok(whole) = array.extract::<PyReadonlyArray1<i64>>() {
            return Ok(Self::Whole(whole.as_array().to_vec()));
        }
        let codes = array.extract::<PyReadonlyArray1<i32>>();
        let problem = "a mask, a slice or an array of numbers of rows is needed";
        let codes = codes.map_err(|_| wrong("rows", problem))?;
        Ok(Self::Codes(codes.as_array().to_vec()))
    }

    const fn len(&self) -> usize {
        match self {
            Self::Real(all) => all.len(),
            Self::Whole(all) => all.len(),
            Self::Codes(all) => all.len(),
        }
    }

    /// Adds a cell, with every digit that a number has; nothing for NaN and a missing code.
    fn write(&self, row: usize, text: &mut Vec<u8>) {
        // Into memory it does not fail.
        let _ = match self {
            Self::Real(all) if all[row].is_nan() => Ok(()),
            Self::Codes(all) if all[row] == MISSING_CODE => Ok(()),
            Self::Real(all) => write!(text, "{:?}", all[row]),
            Self::Whole(all) => write!(text, "{}", all[row]),
            Self::Codes(all) => write!(text, "{}", all[row]),
        };
    }
}

/// Columns by name, all rows or some, as CSV.
pub fn csv(columns: &Bound<'_, PyDict>, rows: Option<&Bound<'_, PyAny>>) -> PyResult<Vec<u8>> {
    let mut names = Vec::new();
    let mut all = Vec::new();
    for (name, array) in columns {
        let array = rows.map_or(Ok(array.clone()), |rows| array.get_item(rows))?;
        all.push(Column::new(&array)?);
        names.push(name.extract::<String>()?);
    }
    let count = all.first().map_or(0, Column::len);
    if count == 0 {
        return Err(wrong("rows", "no row is left"));
    }
    let mut text = names.join(",").into_bytes();
    text.push(b'\n');
    let py = columns.py();
    for start in (0..count).step_by(ROWS_AT_ONCE) {
        py.detach(|| {
            for row in start..count.min(start + ROWS_AT_ONCE) {
                for column in &all {
                    column.write(row, &mut text);
                    text.push(b',');
                }
                // In place of the last comma.
                if let Some(last) = text.last_mut() {
                    *last = b'\n';
                }
            }
        });
        py.check_signals()?;
    }
    Ok(text)
}
