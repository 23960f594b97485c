//! The stage as designed.

use crate::error::{stage_error, wrong};
use crate::pickle::restored;
use host_fit::input::stage::Stage as Designed;
use pyo3::prelude::*;
use pyo3::types::{IntoPyDict, PyBool, PyDict, PyTuple};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A stage as designed: where its sensors stand, what their codes mean, how it moves, and which column of a
/// log holds what.
///
/// Its keyword arguments are the tables of `stage.toml`, each a dict: `hall`, `capacitive`, `interferometer`,
/// `servo`, and where they are wanted `motion`, `search`, `temperature`, `log`. All numbers are SI.
/// Raises `ValueError` with the key where one is missing, unknown or cannot be true.
///
/// `Stage.load("stage.toml")` is the same as `Stage(**tomllib.load(file))`.
#[pyclass(frozen, eq, module = "hallstage")]
pub struct Stage {
    pub designed: Arc<Designed>,
    /// The text of the file.
    text: String,
    /// The file that it was read from.
    pub path: Option<PathBuf>,
}

impl PartialEq for Stage {
    /// Whatever file they were read from.
    fn eq(&self, other: &Self) -> bool {
        self.designed == other.designed
    }
}

#[pymethods]
impl Stage {
    #[new]
    #[pyo3(signature = (**tables))]
    fn new(py: Python<'_>, tables: Option<&Bound<'_, PyDict>>) -> PyResult<Self> {
        let plain = py.import("hallstage._results")?.getattr("plain")?;
        let options = [
            ("default", plain),
            ("allow_nan", PyBool::new(py, false).to_owned().into_any()),
        ];
        let options = options.into_py_dict(py)?;
        let mut all = toml::Table::new();
        for (name, table) in tables.into_iter().flatten() {
            let name: String = name.extract()?;
            if !table.is_instance_of::<PyDict>() {
                return Err(wrong(&name, "a dict is needed, as the table of stage.toml"));
            }
            let json = py
                .import("json")?
                .call_method("dumps", (table,), Some(&options));
            let json: String = json.map_err(|error| wrong(&name, error))?.extract()?;
            let table = serde_json::from_str(&json).map_err(|error| wrong(&name, error))?;
            all.insert(name, table);
        }
        Self::_restore(all.to_string(), None)
    }

    #[staticmethod]
    fn _restore(text: String, path: Option<PathBuf>) -> PyResult<Self> {
        let name = path.as_deref().unwrap_or(Path::new("Stage(...)"));
        let designed = Designed::from_toml(&text, name).map_err(|error| stage_error(&error))?;
        Ok(Self {
            designed: Arc::new(designed),
            text,
            path,
        })
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        restored(py, (py.get_type::<Self>(), &self.text, &self.path))
    }

    /// Reads a `stage.toml`.
    ///
    /// Raises `OSError` where it cannot be read, `ValueError` with line and key where it is wrong.
    #[staticmethod]
    fn load(path: PathBuf) -> PyResult<Self> {
        let designed = Designed::from_file(&path).map_err(|error| stage_error(&error))?;
        Ok(Self {
            designed: Arc::new(designed),
            text: std::fs::read_to_string(&path)?,
            path: Some(path),
        })
    }

    /// Time between two rows of the servo, s.
    #[getter]
    fn servo_period_s(&self) -> f64 {
        self.designed.servo_period_s
    }

    /// Displacement of a Hall code at the designed sensitivity, m.
    #[getter]
    fn hall_m_per_count(&self) -> f64 {
        self.designed.hall.m_per_count
    }

    /// Where the Hall probes A, B, C stand as designed, (x, y) of each, m.
    #[getter]
    fn hall_places_m(&self) -> [[f64; 2]; 3] {
        self.designed.places_m()
    }

    /// Distance between the two Y beams of the interferometer, m.
    #[getter]
    fn y_baseline_m(&self) -> f64 {
        self.designed.interferometer.y_baseline_m
    }

    fn __repr__(&self) -> &str {
        &self.text
    }
}
