//! A calibration: of a fit, brought up to date, or read from its files.

use crate::decoder::{self, Decoder};
use crate::error::{internal, output_error, wrong};
use crate::log::Log;
use crate::origin::{OfFit, Origin};
use crate::pickle::restored;
use crate::report::text;
use crate::stage::Stage;
use crate::statistics::Statistics;
use host_fit::calibrate::{JudgedFit, other_scales};
use host_fit::calibration::recalibrate::StoredPosterior;
use host_fit::input::log::LogReading;
use host_fit::input::stage::Stage as Designed;
use host_fit::output::{Outputs, blob_file, posterior_file};
use host_fit::report::result::Report;
use host_fit::solver::estimator::model::Model;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyTuple};
use runtime::ParameterSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A calibration of a stage with its statistics. Made by `fit`, `Calibration.load`,
/// `Calibration.recalibrate` and `Calibration.with_parameters`.
#[pyclass(frozen, module = "hallstage")]
pub struct Calibration {
    pub set: ParameterSet,
    pub known: Option<StoredPosterior>,
    /// The stage, with the columns of the log that was fitted.
    pub designed: Arc<Designed>,
    pub stage: Py<Stage>,
    pub origin: Origin,
}

impl Calibration {
    /// The calibration of a fit that has a blob, with its report.
    pub fn from_fit(
        outcome: JudgedFit,
        report: Report,
        log: Arc<LogReading>,
        designed: Arc<Designed>,
        stage: Py<Stage>,
    ) -> PyResult<Self> {
        let fit = outcome.fitted.as_ref().map_err(internal)?;
        Ok(Self {
            set: fit.set.clone(),
            known: outcome.known(&log.dataset),
            designed,
            stage,
            origin: Origin::Fit(Box::new(OfFit {
                outcome,
                report,
                log,
            })),
        })
    }

    /// What is known of the parameters.
    pub fn known(&self) -> Statistics<'_> {
        Statistics {
            set: &self.set,
            known: self.known.as_ref(),
            fit: self.origin.fit().map(|(of, fit)| (&of.report, fit)),
        }
    }

    /// Raises for a log without reference, or of a stage with other scales of its codes.
    pub fn check_log(&self, py: Python<'_>, log: &Log) -> PyResult<()> {
        log.check_reference(py)?;
        other_scales(&self.set, &log.text.designed)
            .map_or(Ok(()), |problem| Err(wrong("log", problem)))
    }

    pub fn blob_bytes(&self) -> PyResult<Vec<u8>> {
        blob_file::to_bytes(Path::new("params.bin"), &self.set)
            .map_err(|error| output_error(&error))
    }
}

#[pymethods]
impl Calibration {
    /// Reads a parameter blob, and the statistics of its errors if `params.bin.posterior` stands beside it.
    ///
    /// Raises `OSError` where it cannot be read, `ValueError` where it is no sound blob, or one for other
    /// scales than the stage has.
    #[staticmethod]
    fn load(path: PathBuf, stage: Py<Stage>) -> PyResult<Self> {
        let (set, known) = decoder::read(&path)?;
        let designed = Arc::clone(&stage.get().designed);
        if let Some(problem) = other_scales(&set, &designed) {
            return Err(wrong("stage", problem));
        }
        Ok(Self {
            set,
            known,
            designed,
            stage,
            origin: Origin::Files,
        })
    }

    /// Writes the parameter blob, the bytes of `host-fit fit`, and of the field model the posterior beside it,
    /// `params.bin.posterior`: both, or nothing.
    ///
    /// Raises `OSError` where they cannot be written.
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        let written = py.detach(|| {
            let mut outputs = Outputs::default();
            let known = self.known.as_ref();
            posterior_file::add_calibration(&mut outputs, &path, &self.set, known)?;
            outputs.commit()
        });
        written.map(drop).map_err(|error| output_error(&error))
    }

    /// The parameter blob, as a controller takes it.
    #[getter]
    fn blob<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        Ok(PyBytes::new(py, &self.blob_bytes()?))
    }

    /// A decoder with these parameters.
    fn decoder(&self) -> Decoder {
        Decoder::new(self.set.clone(), self.known.clone())
    }

    /// Equation of the model: "12", "15", "30", "31", or "field".
    #[getter]
    fn model(&self) -> &'static str {
        Model::from_kind(self.set.model).name
    }

    /// Serial number of the stage.
    #[getter]
    fn serial(&self) -> &str {
        &self.set.serial
    }

    /// Creation time, as given.
    #[getter]
    fn created(&self) -> &str {
        &self.set.created
    }

    /// Whether it was made by `force` of a log that is refused, or in spite of a limit.
    #[getter]
    fn forced(&self) -> bool {
        self.set.fit.forced
    }

    fn __repr__(&self) -> String {
        let model = Model::from_kind(self.set.model).title();
        let of = match self.set.serial.as_str() {
            "" => String::new(),
            serial => format!(" of {serial}"),
        };
        let title = format!("calibration{of}, {model}");
        match self.origin.subject() {
            Some(subject) => format!("{title}\n{}", text(&subject)),
            None => format!("<{title}>"),
        }
    }

    /// The bytes of its files.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        let (blob, posterior) = files(py, &self.set, self.known.as_ref())?;
        let stage = self.stage.clone_ref(py);
        restored(py, (py.get_type::<Self>(), blob, posterior, stage))
    }

    #[staticmethod]
    fn _restore(blob: &[u8], posterior: Option<&[u8]>, stage: Py<Stage>) -> PyResult<Self> {
        let (set, known) = from_files(blob, posterior)?;
        Ok(Self {
            set,
            known,
            designed: Arc::clone(&stage.get().designed),
            stage,
            origin: Origin::Files,
        })
    }
}

/// The bytes of a blob and of the posterior beside it.
pub fn files<'py>(
    py: Python<'py>,
    set: &ParameterSet,
    known: Option<&StoredPosterior>,
) -> PyResult<(Bound<'py, PyBytes>, Option<Bound<'py, PyBytes>>)> {
    let blob = blob_file::to_bytes(Path::new("params.bin"), set);
    let blob = blob.map_err(|error| output_error(&error))?;
    let posterior = known.map(|known| PyBytes::new(py, &posterior_file::to_bytes(&blob, known)));
    Ok((PyBytes::new(py, &blob), posterior))
}

/// A blob and its posterior from these bytes.
pub fn from_files(
    blob: &[u8],
    posterior: Option<&[u8]>,
) -> PyResult<(ParameterSet, Option<StoredPosterior>)> {
    let set = ParameterSet::from_bytes(blob).map_err(internal)?;
    let known = posterior.map(posterior_file::from_bytes).transpose();
    let known = known.map_err(internal)?.map(|(_, known)| known);
    Ok((set, known))
}
