//! The rows that a log holds, as arrays.

use host_fit::input::dataset::{Dataset, Row};
use numpy::{Element, PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use runtime::frame::MISSING_CODE;

/// A row, its log and its movement.
#[derive(Clone, Copy)]
pub struct HeldRow {
    pub log: usize,
    pub movement: i64,
    pub row: Row,
}

/// The rows of one or more logs.
#[derive(Default)]
pub struct HeldRows {
    pub rows: Vec<HeldRow>,
    /// The movement of the last row: its log, its number there, its number here.
    last: (usize, i64, i64),
    /// The largest number of a movement.
    most: i64,
}

impl HeldRows {
    /// Adds the next row. The movements of a second log get larger numbers than the movements of the first.
    pub fn push(&mut self, log: usize, movement: i64, row: &Row) {
        let (last_log, last, number) = self.last;
        let number = match log {
            0 => movement,
            _ if (last_log, last) == (log, movement) => number,
            _ => self.most.saturating_add(1),
        };
        self.last = (log, movement, number);
        self.most = self.most.max(number);
        self.rows.push(HeldRow {
            log,
            movement: number,
            row: *row,
        });
    }

    /// The rows of a dataset.
    pub fn of(dataset: &Dataset) -> Self {
        let mut held = Self::default();
        for row in &dataset.rows {
            let movement = &dataset.movements[row.movement];
            held.push(movement.log, movement.index, row);
        }
        held
    }

    /// A number of each row.
    pub fn numbers<'py, T: Element>(
        &self,
        py: Python<'py>,
        of: impl Fn(&HeldRow) -> T,
    ) -> Bound<'py, PyArray1<T>> {
        PyArray1::from_iter(py, self.rows.iter().map(of))
    }

    /// Three numbers of each row.
    pub fn triples<'py, T: Element>(
        &self,
        py: Python<'py>,
        of: impl Fn(&Row) -> [T; 3],
    ) -> PyResult<Bound<'py, PyArray2<T>>> {
        rows_of_three(py, self.rows.iter().map(|held| of(&held.row)).collect())
    }

    /// Temperature of mount (0) or body (1), degC, NaN where there is none.
    pub fn celsius<'py>(&self, py: Python<'py>, sensor: usize) -> Bound<'py, PyArray1<f64>> {
        self.numbers(py, |held| match held.row.frame.temperature_mc()[sensor] {
            MISSING_CODE => f64::NAN,
            code => f64::from(code) / 1e3,
        })
    }

    /// Whether any row has a temperature of mount (0) or body (1).
    pub fn has_celsius(&self, sensor: usize) -> bool {
        let mut rows = self.rows.iter();
        rows.any(|held| held.row.frame.temperature_mc()[sensor] != MISSING_CODE)
    }
}

/// An array of rows of three.
pub fn rows_of_three<T: Element>(
    py: Python<'_>,
    rows: Vec<[T; 3]>,
) -> PyResult<Bound<'_, PyArray2<T>>> {
    let count = rows.len();
    PyArray1::from_vec(py, rows.into_flattened()).reshape([count, 3])
}
