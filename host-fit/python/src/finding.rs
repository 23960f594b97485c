//! Findings, and figures in general, on their way to Python: as JSON in SI, which has a name for each.

use crate::error::internal;
use crate::si;
use host_fit::calibration::words::Worded;
use host_fit::input::finding::Finding;
use pyo3::prelude::*;
use pyo3::types::PyList;
use serde::Serialize;

/// What a report has, as `json.loads` reads it, in SI and in the words of the package.
pub fn figures<'py>(py: Python<'py>, figures: &impl Serialize) -> PyResult<Bound<'py, PyAny>> {
    let figures = serde_json::to_value(figures).map_err(internal)?;
    let text = si::figures(figures).to_string();
    py.import("json")?.call_method1("loads", (text,))
}

/// A list of `hallstage.Finding`.
pub fn list<'py>(py: Python<'py>, findings: &[Finding]) -> PyResult<Bound<'py, PyList>> {
    let class = py.import("hallstage._results")?.getattr("Finding")?;
    let made = findings.iter().map(|found| {
        let members = figures(py, &Worded(found))?;
        let members = members.cast_into::<pyo3::types::PyDict>()?;
        class.call((), Some(&members))
    });
    PyList::new(py, made.collect::<PyResult<Vec<_>>>()?)
}
