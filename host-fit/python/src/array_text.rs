//! Arrays as the text of a log: so they pass all checks of a file, and have its hash.

use crate::arrays::{codes, reals, same_rows, slice, whole};
use crate::error::wrong;
use host_fit::input::log::layout::Kind;
use numpy::PyReadonlyArray1;
use pyo3::prelude::*;
use std::io::Write;

/// Columns of a log.
pub struct ArrayText {
    columns: Vec<(String, Column)>,
    /// Name of each column in the header, and of its argument.
    pub arguments: Vec<(String, String)>,
    rows: usize,
    units: String,
    angles: String,
}

enum Column {
    Whole(Vec<i64>),
    Real(Vec<f64>),
    /// Where NaN is an empty cell.
    Optional(Vec<f64>),
}

type Given<'a, 'py> = Option<&'a Bound<'py, PyAny>>;

impl ArrayText {
    /// With these units of lengths and of angles.
    pub fn new(units: &str, angles: &str) -> PyResult<Self> {
        for (argument, unit, kind) in [
            ("units", units, Kind::Length),
            ("angles", angles, Kind::Angle),
        ] {
            if kind.unit(unit).is_none() {
                let problem = format!("`{unit}` is none of {}", kind.units());
                return Err(wrong(argument, problem));
            }
        }
        Ok(Self {
            columns: Vec::new(),
            arguments: Vec::new(),
            rows: 0,
            units: units.to_owned(),
            angles: angles.to_owned(),
        })
    }

    fn add(&mut self, argument: &str, header: String, column: Column) -> PyResult<()> {
        let rows = match &column {
            Column::Whole(numbers) => numbers.len(),
            Column::Real(numbers) | Column::Optional(numbers) => numbers.len(),
        };
        match self.arguments.first() {
            None => self.rows = rows,
            Some((_, first)) => same_rows(argument, rows, first, self.rows)?,
        }
        self.arguments.push((header.clone(), argument.to_owned()));
        self.columns.push((header, column));
        Ok(())
    }

    /// Adds numbers, if they are given.
    pub fn real(&mut self, header: &str, argument: &str, given: Given<'_, '_>) -> PyResult<()> {
        let Some(given) = given else { return Ok(()) };
        let numbers = owned(&reals(argument, given)?)?;
        self.add(argument, header.to_owned(), Column::Real(numbers))
    }

    /// Adds temperatures, NaN where there is none, if they are given.
    pub fn optional(&mut self, header: &str, argument: &str, given: Given<'_, '_>) -> PyResult<()> {
        let Some(given) = given else { return Ok(()) };
        let numbers = owned(&reals(argument, given)?)?;
        self.add(argument, header.to_owned(), Column::Optional(numbers))
    }

    /// Adds lengths.
    pub fn length(&mut self, argument: &str, key: &str, given: Given<'_, '_>) -> PyResult<()> {
        self.real(&format!("{key} [{}]", self.units), argument, given)
    }

    /// Adds angles.
    pub fn angle(&mut self, argument: &str, given: Given<'_, '_>) -> PyResult<()> {
        self.real(&format!("{argument} [{}]", self.angles), argument, given)
    }

    /// Adds whole numbers.
    pub fn whole(&mut self, header: &str, given: Given<'_, '_>) -> PyResult<()> {
        let Some(given) = given else { return Ok(()) };
        let numbers = whole(header, given)?;
        let numbers = slice(numbers.as_slice())?.to_vec();
        self.add(header, header.to_owned(), Column::Whole(numbers))
    }

    /// Adds codes of three sensors.
    pub fn codes(&mut self, argument: &str, keys: [&str; 3], given: Given<'_, '_>) -> PyResult<()> {
        let Some(given) = given else { return Ok(()) };
        let all = codes(argument, given)?;
        let (rows, _) = slice(all.as_slice())?.as_chunks::<3>();
        for (k, key) in keys.into_iter().enumerate() {
            let numbers = rows.iter().map(|row| row[k].into()).collect();
            self.add(argument, key.to_owned(), Column::Whole(numbers))?;
        }
        Ok(())
    }

    /// The text: enough digits to restore each number.
    pub fn bytes(&self) -> Vec<u8> {
        let names: Vec<&str> = self.columns.iter().map(|(name, _)| name.as_str()).collect();
        let mut text = names.join(",").into_bytes();
        text.reserve(self.rows * 12 * self.columns.len());
        for row in 0..self.rows {
            for (k, (_, column)) in self.columns.iter().enumerate() {
                text.push(if k == 0 { b'\n' } else { b',' });
                // Writing to a vector cannot fail.
                let _ = match column {
                    Column::Whole(numbers) => write!(text, "{}", numbers[row]),
                    Column::Optional(numbers) if numbers[row].is_nan() => Ok(()),
                    Column::Real(numbers) | Column::Optional(numbers) => {
                        write!(text, "{:e}", numbers[row])
                    }
                };
            }
        }
        text.push(b'\n');
        text
    }
}

fn owned(numbers: &PyReadonlyArray1<'_, f64>) -> PyResult<Vec<f64>> {
    Ok(slice(numbers.as_slice())?.to_vec())
}
