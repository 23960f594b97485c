//! Copies and pickles. Nothing changes an object of this package, so it is its own copy.

use crate::calibration::Calibration;
use crate::decoder::Decoder;
use crate::log::Log;
use crate::stage::Stage;
use pyo3::prelude::*;
use pyo3::types::PyTuple;

/// The answer of `__reduce__`: a class makes the object again by its `_restore`, from these arguments after the class.
pub fn restored<'py>(
    py: Python<'py>,
    arguments: impl IntoPyObject<'py, Target = PyTuple, Output = Bound<'py, PyTuple>, Error = PyErr>,
) -> PyResult<Bound<'py, PyTuple>> {
    let restored = py.import("hallstage._results")?.getattr("restored")?;
    (restored, arguments).into_pyobject(py)
}

macro_rules! copies {
    ($($class:ident)*) => {$(
        #[pymethods]
        impl $class {
            const fn __copy__(slf: PyRef<'_, Self>) -> PyRef<'_, Self> {
                slf
            }

            const fn __deepcopy__<'a>(slf: PyRef<'a, Self>, _memo: &Bound<'_, PyAny>) -> PyRef<'a, Self> {
                slf
            }
        }
    )*};
}

copies! { Stage Log Calibration Decoder }
