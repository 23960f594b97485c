//! A calibration judged on another log.

use crate::choice::chosen;
use crate::error::{log_error, wrong};
use crate::finding;
use crate::log::Log;
use crate::report::{About, by_axis, head, residuals, text, write, zero_deviations};
use crate::stage::Stage;
use crate::work;
use host_fit::calibrate::{EvalOrder, Evaluation as Evaluated};
use host_fit::calibration::diagnose::refusal::Refusal;
use host_fit::calibration::judge::Zeros;
use host_fit::calibration::recalibrate::StoredPosterior;
use host_fit::calibration::words::python;
use host_fit::input::stage::Stage as Designed;
use host_fit::report::result::Report;
use numpy::PyArray2;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use runtime::ParameterSet;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

/// How a calibration does on logs with reference, by the target's own decoder.
#[pyclass(frozen, module = "hallstage")]
pub struct Evaluation {
    evaluated: Evaluated,
    report: Report,
    designed: Arc<Designed>,
    stage: Py<Stage>,
    serial: String,
    blob: Vec<u8>,
}

impl Evaluation {
    /// Judges a parameter set with its posterior on a log.
    pub fn new(
        py: Python<'_>,
        log: &Log,
        of_blob: (&ParameterSet, Option<&StoredPosterior>),
        blob: Vec<u8>,
        (delta, limit): (Option<&str>, Option<f64>),
    ) -> PyResult<Self> {
        let started = Instant::now();
        let zeros = delta
            .map(|name| chosen::<Zeros>("delta", name))
            .transpose()?;
        if limit.is_some_and(|limit| !(limit.is_finite() && limit > 0.0)) {
            return Err(wrong("limit", "a factor above zero is needed"));
        }
        let order = EvalOrder { zeros, limit };
        let (text, logs) = (log.text.clone(), log.reading.dataset.logs.len());
        let (set, known) = (of_blob.0.clone(), of_blob.1.cloned());
        let evaluated = work::run(py, move |watch| {
            let of_blob = (&set, known.as_ref());
            Evaluated::new(of_blob, &text.designed, order, logs, |take| {
                text.read(Evaluated::OPTIONS, watch, take)
            })
        })?;
        let evaluated = evaluated.map_err(|error| log_error(py, &error))?;
        Ok(Self {
            report: evaluated.report(started.elapsed().as_secs_f64()),
            evaluated,
            designed: Arc::clone(&log.text.designed),
            stage: log.stage.clone_ref(py),
            serial: of_blob.0.serial.as_str().to_owned(),
            blob,
        })
    }
}

#[pymethods]
impl Evaluation {
    /// "good", "limited" or "refused", or `None` where that is not known.
    #[getter]
    fn verdict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        finding::figures(py, &self.evaluated.diagnosis.verdict)
    }

    /// The stage.
    #[getter(stage)]
    fn of_stage(&self, py: Python<'_>) -> Py<Stage> {
        self.stage.clone_ref(py)
    }

    /// All figures of `host-fit eval --json` as a dict, in SI.
    #[getter]
    fn details<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        finding::figures(py, &self.report)
    }

    /// rms errors of X, Y, Rz over all rows, a dict, m, m, rad.
    #[getter]
    fn rms<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let axes = self.evaluated.judgement.errors.axes;
        by_axis(py, &axes.map(|axis| axis.rms))
    }

    /// The largest errors of X, Y, Rz over all rows, a dict, m, m, rad.
    #[getter]
    fn peak<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let axes = self.evaluated.judgement.errors.axes;
        by_axis(py, &axes.map(|axis| axis.peak))
    }

    /// Zero deviations of the Hall probes A, B, C, a row for each movement: float64, (movements, 3), m.
    #[getter]
    fn zero_deviations<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        zero_deviations(py, &self.evaluated.judgement)
    }

    /// Faults of the logs, the most severe first.
    #[getter]
    fn findings<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        finding::list(py, &self.evaluated.diagnosis.findings)
    }

    /// Further messages to the user.
    #[getter]
    fn warnings(&self) -> Vec<String> {
        let warnings = self.report.warnings.iter();
        warnings.map(|warning| python(warning)).collect()
    }

    /// Why the calibration does not describe these logs, and what to do, or `None` if it does.
    #[getter]
    fn refusal(&self) -> Option<String> {
        let message = self.evaluated.refusal_message();
        message.map(|message| python(&message))
    }

    /// The same as a name that stays: "other_log", "beyond_limit" or "findings"; `None` if it does.
    #[getter]
    fn refusal_code(&self) -> Option<&'static str> {
        self.evaluated.refusal.as_ref().map(Refusal::code)
    }

    /// Errors of the rows, zero deviations taken off, m, m, rad.
    fn residuals<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let of = &self.evaluated;
        residuals(py, &of.log.dataset, &of.by_row, None)
    }

    /// Writes the page that `host-fit eval --report` writes, to this file.
    ///
    /// `operator`: who did it; `notes`: lines of name and text; `created`: date and time, as you want them to
    /// read. Raises `OSError` where the file cannot be written.
    #[pyo3(signature = (path, *, operator = None, notes = None, created = ""))]
    fn report(
        &self,
        py: Python<'_>,
        path: PathBuf,
        operator: Option<&str>,
        notes: Option<BTreeMap<String, String>>,
        created: &str,
    ) -> PyResult<()> {
        let of = &self.evaluated;
        let about = About {
            title: of.title(),
            serial: &self.serial,
            operator,
            notes: notes.unwrap_or_default(),
            created,
            certificates: of.certificates.clone(),
            call: vec!["hallstage".into(), "Calibration.evaluate".into()],
        };
        let stage_file = self.stage.get().path.as_ref();
        py.detach(|| {
            write(
                &path,
                about,
                (&of.log, &of.log.dataset, &self.designed),
                stage_file,
                of.subject(),
                (self.report.warnings.clone(), &self.blob),
                &self.report,
            )
        })
    }

    fn __repr__(&self) -> String {
        text(&self.evaluated.subject())
    }

    fn _repr_html_(&self) -> PyResult<String> {
        head(&self.evaluated.subject(), &self.report.warnings)
    }
}
