//! The parameters of a calibration with their statistics, and calibrations with other parameters.

use crate::calibration::Calibration;
use crate::error::wrong;
use crate::finding;
use crate::origin::Origin;
use crate::report::by_axis;
use crate::stage::Stage;
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::collections::BTreeMap;
use std::sync::Arc;

#[pymethods]
impl Calibration {
    /// The stage.
    #[getter(stage)]
    fn of_stage(&self, py: Python<'_>) -> Py<Stage> {
        self.stage.clone_ref(py)
    }

    /// The parameters by name, a dict of `Parameter`: lever arms (m), misalignments (rad), sensitivities and
    /// their slopes (equation 33), of the field model its other terms, and k and h of the temperatures, in the
    /// units that each says.
    #[getter]
    fn parameters<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        self.known().parameters(py)
    }

    /// Names of the parameters that have a standard error, in the order of `covariance`.
    #[getter]
    fn names(&self) -> PyResult<Vec<String>> {
        self.known().names()
    }

    /// Covariance of the parameters of `names`, float64, (k, k), in their units. Of the field model the posterior
    /// under the noise of the log; of others the sandwich over movements.
    #[getter]
    fn covariance<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.known().covariance_array(py)
    }

    /// The same as a `pandas.DataFrame` with the names of its rows and columns.
    fn covariance_frame<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.known().covariance_frame(py)
    }

    /// The parameters as a `pandas.DataFrame`, a row for each by name: `value`, `std`, `unit`.
    fn to_frame<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.known().parameter_frame(py)
    }

    /// Correlations of the same parameters, from -1 to 1.
    #[getter]
    fn correlations<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.known().correlations(py)
    }

    /// The uncertainty budget as a `pandas.DataFrame`, a row for each source: `u` in `unit`, contributions over service
    /// (`rms_x_m`, ...), at its ends (`ends_x_m`, ...) and by a unit of the source (`sensitivity_x_m`, ...); then
    /// `combined`, and the inputs that are not included. `None` without a budget. Needs pandas.
    #[getter]
    fn budget<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        self.known().budget_frame(py)
    }

    /// White noise of the readings of the Hall probes A, B, C: float64, (3,), m; `None` without a posterior.
    #[getter]
    fn noise<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<f64>>> {
        let known = self.known.as_ref()?;
        Some(PyArray1::from_slice(py, &known.noise.white_m))
    }

    /// The largest magnitudes of the pose that the calibration covers, a dict of x, y, rz, z, rx, ry, m and rad.
    #[getter]
    fn range<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let constants = &self.set.constants;
        let ends = [constants.calibrated_planar, constants.calibrated_vertical];
        by_axis(py, ends.map(|ends| ends.map(f64::from)).as_flattened())
    }

    /// The calibration with other values of some parameters, a dict by name in the units of `parameters`, as a Monte Carlo
    /// draws them: `cal.with_parameters(dict(zip(cal.names, draw)))`. Blobs hold float32, so values are rounded to it.
    ///
    /// Raises `ValueError` for an unknown name and for values that make no decoder.
    fn with_parameters(&self, py: Python<'_>, values: BTreeMap<String, f64>) -> PyResult<Self> {
        let set = self.known().with_values(&self.designed, &values);
        Ok(Self {
            set: set.map_err(|problem| wrong("values", problem))?,
            known: self.known.clone(),
            designed: Arc::clone(&self.designed),
            stage: self.stage.clone_ref(py),
            origin: Origin::Files,
        })
    }

    /// The difference from an `older` calibration, a dict: `parameters` by name (a: older, b: newer,
    /// change, sigma) and `pose_difference`, by the decoder over their common range, m and rad.
    fn diff<'py>(&self, py: Python<'py>, older: PyRef<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let [before, now] = [older.known(), self.known()];
        let figures = py.detach(|| now.changes_from(&before));
        finding::figures(py, &figures)
    }
}
