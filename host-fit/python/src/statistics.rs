//! What is known of the parameters of a calibration: values, standard errors, covariance.

use crate::finding;
use crate::si;
use host_fit::calibration::fit::Fit;
use host_fit::calibration::recalibrate::{StoredPosterior, with_parameters};
use host_fit::diff::{parameter_changes, pose_difference};
use host_fit::input::stage::Stage as Designed;
use host_fit::report::budget;
use host_fit::report::parameters::{Parameter, parameters_in, temperature_parameters_in};
use host_fit::report::result::Report;
use host_fit::solver::estimator::paper::Parameters;
use host_fit::solver::estimator::parameters::FieldParameters;
use host_fit::solver::estimator::terms;
use nalgebra::DMatrix;
use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{IntoPyDict, PyDict};
use runtime::ParameterSet;
use runtime::calibration::Origin;
use serde_json::{Value, json};
use std::collections::BTreeMap;

/// A blob, what stands beside it, and the fit that it comes from, where there is one.
pub struct Statistics<'a> {
    pub set: &'a ParameterSet,
    pub known: Option<&'a StoredPosterior>,
    pub fit: Option<(&'a Report, &'a Fit)>,
}

impl Statistics<'_> {
    /// Names and covariance of the parameters that have a standard error, SI.
    fn covariance(&self) -> Option<(Vec<String>, DMatrix<f64>)> {
        let (names, mut covariance) = match self.fit {
            Some((_, fit)) => {
                let posterior = &fit.estimate.posterior;
                (posterior.names(), posterior.covariance.clone())
            }
            None => {
                let covariance = self.known?.covariance.clone();
                (terms::names(covariance.nrows()), covariance)
            }
        };
        let all = self.raw_parameters();
        for (k, name) in names.iter().enumerate() {
            let (factor, _) = si::unit(all.get(name).map_or("", |parameter| parameter.unit));
            covariance.row_mut(k).scale_mut(factor);
            covariance.column_mut(k).scale_mut(factor);
        }
        Some((names, covariance))
    }

    /// The parameters by name, in the units of the program.
    fn raw_parameters(&self) -> BTreeMap<String, Parameter> {
        let mut all = match self.fit {
            Some((report, _)) => report.parameters.clone(),
            None => parameters_in(self.set),
        };
        all.extend(temperature_parameters_in(self.set));
        all
    }

    /// The blob with other values of some parameters, SI, by name.
    ///
    /// # Errors
    /// An unknown name, or values that make no decoder.
    pub fn with_values(
        &self,
        stage: &Designed,
        values: &BTreeMap<String, f64>,
    ) -> Result<ParameterSet, String> {
        let paper = || FieldParameters::from_model_31(&Parameters::from_set(self.set), stage);
        let mut parameters = FieldParameters::from_set(self.set, stage).unwrap_or_else(paper);
        let known = self.raw_parameters();
        let names = terms::names(usize::MAX);
        for (name, value) in values {
            let place = names.iter().position(|known| known == name);
            let parameter = known.get(name).zip(place);
            let (parameter, place) =
                parameter.ok_or_else(|| format!("`{name}` is no parameter of this calibration"))?;
            let value = value / si::unit(parameter.unit).0;
            if !value.is_finite() {
                return Err(format!("{name} must be a finite number"));
            }
            match place.checked_sub(terms::COUNT) {
                None => parameters.probes.as_flattened_mut()[place] = value,
                Some(k) => parameters.gain_per_k.as_flattened_mut()[k] = value - parameter.value,
            }
        }
        let origin = Origin {
            serial: self.set.serial.clone(),
            created: self.set.created.clone(),
            logs_sha256: self.set.logs_sha256,
            fit: self.set.fit,
        };
        with_parameters(self.set, &parameters, stage, &origin).map_err(|error| error.to_string())
    }

    /// What changed since `older`, in parameters and in poses.
    pub fn changes_from(&self, older: &Self) -> Value {
        let errors = [older.standard_errors(), self.standard_errors()];
        json!({
            "same_logs": older.set.logs_sha256 == self.set.logs_sha256,
            "parameters": parameter_changes([older.set, self.set], [&errors[0], &errors[1]]),
            "pose_difference": pose_difference(older.set, self.set),
        })
    }

    /// Standard errors by name, where the posterior holds them.
    fn standard_errors(&self) -> BTreeMap<String, f64> {
        let errors = self.known.into_iter().flat_map(|known| {
            let errors = known.covariance.diagonal().map(f64::sqrt);
            let names = terms::names(known.covariance.nrows());
            names.into_iter().zip(errors.as_slice().to_vec())
        });
        errors.collect()
    }

    /// The names of the rows and columns of the covariance.
    pub fn names(&self) -> PyResult<Vec<String>> {
        Ok(self.covariance_or_raise()?.0)
    }

    fn covariance_or_raise(&self) -> PyResult<(Vec<String>, DMatrix<f64>)> {
        let problem = "covariance: none stands beside the blob, as params.bin.posterior";
        self.covariance()
            .ok_or_else(|| PyValueError::new_err(problem))
    }

    /// The covariance as an array.
    pub fn covariance_array<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.matrix(py, |matrix, i, j| matrix[(i, j)])
    }

    /// The covariance as a `pandas.DataFrame`.
    pub fn covariance_frame<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let names = self.names()?;
        let options = [("index", &names), ("columns", &names)].into_py_dict(py)?;
        let covariance = self.covariance_array(py)?;
        let pandas = py.import("pandas")?;
        pandas.call_method("DataFrame", (covariance,), Some(&options))
    }

    /// The correlations as an array.
    pub fn correlations<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.matrix(py, |matrix, i, j| match i == j {
            true => 1.0,
            false => matrix[(i, j)] / (matrix[(i, i)] * matrix[(j, j)]).sqrt(),
        })
    }

    /// A function of the covariance and two of its rows, as an array.
    fn matrix<'py>(
        &self,
        py: Python<'py>,
        of: impl Fn(&DMatrix<f64>, usize, usize) -> f64,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let (names, matrix) = self.covariance_or_raise()?;
        let n = names.len();
        // Its lower triangle counts, as in the file.
        let number = |(i, j): (usize, usize)| of(&matrix, i.max(j), i.min(j));
        let numbers = (0..n * n).map(|k| number((k / n, k % n)));
        PyArray1::from_iter(py, numbers).reshape([n, n])
    }

    /// The parameters as a `pandas.DataFrame`.
    pub fn parameter_frame<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let rows = self.parameters(py)?.values();
        let frame = py.import("pandas")?.call_method1("DataFrame", (rows,))?;
        frame.call_method1("set_index", ("name",))
    }

    /// The budget as a `pandas.DataFrame`.
    pub fn budget_frame<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        let frame = |budget| {
            let rows = finding::figures(py, &budget::frame(budget))?;
            let options = [("sep", "_")].into_py_dict(py)?;
            py.import("pandas")?
                .call_method("json_normalize", (rows,), Some(&options))
        };
        let budget = self.known.and_then(|known| known.budget.as_ref());
        budget.map(frame).transpose()
    }

    /// The parameters as a dict of `hallstage.Parameter`, in the order of the covariance; parameters without one follow.
    pub fn parameters<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let class = py.import("hallstage._results")?.getattr("Parameter")?;
        let errors = self.standard_errors();
        let mut all = self.raw_parameters();
        let parameters = PyDict::new(py);
        let add = |name: String, parameter: Parameter| {
            let error = parameter
                .standard_error
                .or_else(|| errors.get(&name).copied());
            let (factor, unit) = si::unit(parameter.unit);
            let (value, error) = (parameter.value * factor, error.map(|error| error * factor));
            let made = class.call1((&name, value, error, unit))?;
            parameters.set_item(name, made)
        };
        let order = self.covariance().map(|(names, _)| names);
        for name in order.unwrap_or_default() {
            if let Some(parameter) = all.remove(&name) {
                add(name, parameter)?;
            }
        }
        all.into_iter()
            .try_for_each(|(name, parameter)| add(name, parameter))?;
        Ok(parameters)
    }
}
