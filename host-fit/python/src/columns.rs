//! The arrays of a log.

use crate::finding;
use crate::held::rows_of_three;
use crate::log::Log;
use crate::source::TEMPERATURES;
use crate::stage::Stage;
use host_fit::input::channels::columns;
use host_fit::report::channels::channels;
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use pyo3::types::PyDict;

#[pymethods]
impl Log {
    /// Rows that were read; more than are held of a long log with `rows="sample"`.
    #[getter]
    fn rows_read(&self) -> usize {
        self.reading.dataset.read().0
    }

    /// The stage.
    #[getter(stage)]
    fn of_stage(&self, py: Python<'_>) -> Py<Stage> {
        self.stage.clone_ref(py)
    }

    /// Warnings of the logs, in words.
    #[getter(warnings)]
    fn in_words(&self) -> Vec<String> {
        self.warnings()
    }

    /// The properties of each channel, as `host-fit check --json` writes them, in SI: a list of dicts.
    #[getter]
    fn channels<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let dataset = &self.reading.dataset;
        finding::figures(
            py,
            &channels(&columns(dataset, &self.text.designed), dataset),
        )
    }

    /// Time of the rows within their log, s: float64, (n,).
    #[getter]
    fn time<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.held.numbers(py, |held| held.row.t_us as f64 / 1e6)
    }

    /// Number of the movement of the rows: int64, (n,); the movements of a second log have larger numbers than the movements of the first.
    #[getter]
    fn movement<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<i64>> {
        self.held.numbers(py, |held| held.movement)
    }

    /// Codes of the Hall probes A, B, C: int32, (n, 3).
    #[getter]
    fn hall<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<i32>>> {
        self.held.triples(py, |row| row.frame.hall())
    }

    /// Codes of the gaps 1, 2, 3: int32, (n, 3); `None` of a log that has gaps or the vertical pose itself.
    #[getter]
    fn caps<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray2<i32>>>> {
        let codes = self
            .held
            .rows
            .iter()
            .map(|held| held.row.frame.capacitive());
        let codes: Option<Vec<[i32; 3]>> = codes.collect();
        codes.map(|codes| rows_of_three(py, codes)).transpose()
    }

    /// X, Y, Rz by the interferometers: float64, (n, 3), m, m, rad; zeros in a log without reference.
    #[getter]
    fn reference<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.held.triples(py, |row| row.reference)
    }

    /// Z, Rx, Ry by the capacitive sensors: float64, (n, 3), m, rad, rad.
    #[getter]
    fn vertical<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.held.triples(py, |row| row.vertical)
    }

    /// Temperature of the magnets' mount: float64, (n,), degC, NaN where there is none.
    #[getter]
    fn mount<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.held.celsius(py, 0)
    }

    /// Temperature of the stage body at the Hall elements, as `mount`.
    #[getter]
    fn body<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.held.celsius(py, 1)
    }

    /// The rows as a `pandas.DataFrame` in SI and degC: number of the log where there are several, movement, time, codes, the
    /// vertical pose where there are no codes of the gaps, reference, temperatures. `Log.load` reads the file of its `to_csv`.
    /// The reference is the pose, or the beams where `[interferometer]` has places, scales or air. Needs pandas.
    #[getter]
    fn df<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let columns = self.columns(py)?;
        py.import("pandas")?.call_method1("DataFrame", (columns,))
    }
}

impl Log {
    /// The columns of the log by name.
    pub fn columns<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let held = &self.held;
        let columns = PyDict::new(py);
        let add = |names: [&str; 3], array: &Bound<'py, PyAny>| {
            let arrays = array.getattr("T")?.try_iter()?;
            names
                .into_iter()
                .zip(arrays)
                .try_for_each(|(name, array)| columns.set_item(name, array?))
        };
        if self.reading.dataset.logs.len() > 1 {
            columns.set_item("log", held.numbers(py, |held| held.log as i64))?;
        }
        columns.set_item("movement", self.movement(py))?;
        columns.set_item("time_s", self.time(py))?;
        add(["hall_a", "hall_b", "hall_c"], self.hall(py)?.as_any())?;
        match self.caps(py)? {
            Some(caps) => add(["cap_1", "cap_2", "cap_3"], caps.as_any())?,
            None => add(["z_m", "rx_rad", "ry_rad"], self.vertical(py)?.as_any())?,
        }
        let interferometer = &self.text.designed.interferometer;
        if self.has_reference() && interferometer.corrects() {
            let beams = held.triples(py, |row| row.beams_m(interferometer))?;
            add(["ifm_x_m", "ifm_y1_m", "ifm_y2_m"], beams.as_any())?;
        } else if self.has_reference() {
            add(["x_m", "y_m", "rz_rad"], self.reference(py)?.as_any())?;
        }
        for (sensor, name) in TEMPERATURES.into_iter().enumerate() {
            if held.has_celsius(sensor) {
                columns.set_item(name, held.celsius(py, sensor))?;
            }
        }
        Ok(columns)
    }
}
