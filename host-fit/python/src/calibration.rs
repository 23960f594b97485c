//! A calibration: of a fit, brought up to date, or read from its files.

use crate::choice::chosen;
use crate::decoder::{self, Decoder};
use crate::error::{internal, output_error, recalibrate_error, refused, wrong};
use crate::evaluation::Evaluation;
use crate::finding;
use crate::fit::blob_text;
use crate::log::Log;
use crate::origin::{OfFit, Origin};
use crate::report::{About, head, residuals, text, write};
use crate::stage::Stage;
use crate::statistics::Statistics;
use crate::work;
use host_fit::calibrate::{JudgedFit, Updated, other_scales};
use host_fit::calibration::diagnose::refusal::Refusal;
use host_fit::calibration::recalibrate::StoredPosterior;
use host_fit::calibration::words;
use host_fit::input::log::LogReading;
use host_fit::input::stage::Stage as Designed;
use host_fit::output::{Outputs, blob_file, posterior_file};
use host_fit::report::errors::{errors, from_rms_and_peak};
use host_fit::report::page::CERTIFICATE;
use host_fit::report::result::Report;
use host_fit::solver::estimator::model::Model;
use host_fit::solver::estimator::update::Change;
use numpy::PyArray2;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyList};
use runtime::ParameterSet;
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A calibration of a stage, and what is known of it. Made by `fit`, `Calibration.recalibrate` and
/// `Calibration.open`.
#[pyclass(frozen, module = "hallstage")]
pub struct Calibration {
    set: ParameterSet,
    known: Option<StoredPosterior>,
    /// The stage, with the columns of the log that was fitted.
    designed: Arc<Designed>,
    stage: Py<Stage>,
    origin: Origin,
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
            known: outcome.known(&log.dataset, &designed),
            designed,
            stage,
            origin: Origin::Fit(Box::new(OfFit {
                outcome,
                report,
                log,
            })),
        })
    }

    pub const fn set(&self) -> &ParameterSet {
        &self.set
    }

    /// What is known of the parameters.
    fn known(&self) -> Statistics<'_> {
        Statistics {
            set: &self.set,
            known: self.known.as_ref(),
            fit: self.origin.fit().map(|(of, fit)| (&of.report, fit)),
        }
    }

    /// Raises for a log without reference, or of a stage with other scales of its codes.
    fn check_log(&self, py: Python<'_>, log: &Log) -> PyResult<()> {
        log.check_reference(py)?;
        other_scales(&self.set, &log.designed).map_or(Ok(()), |problem| Err(wrong("log", problem)))
    }

    fn blob_bytes(&self) -> PyResult<Vec<u8>> {
        blob_file::to_bytes(Path::new("params.bin"), &self.set)
            .map_err(|error| output_error(&error))
    }
}

#[pymethods]
impl Calibration {
    /// Reads a parameter blob, and what is known of its errors if `params.bin.posterior` stands beside it.
    ///
    /// Raises `OSError` where it cannot be read, `ValueError` where it is no sound blob, or one for other
    /// scales than the stage has.
    #[staticmethod]
    fn open(path: PathBuf, stage: Py<Stage>) -> PyResult<Self> {
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

    /// "good", "limited" or "refused", or None where that is not known.
    #[getter]
    fn verdict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let verdict = self
            .origin
            .diagnosis()
            .and_then(|diagnosis| diagnosis.verdict);
        finding::figures(py, &verdict)
    }

    /// What is wrong with the log, the most severe first: a list of `Finding`.
    #[getter]
    fn findings<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        let found = self
            .origin
            .diagnosis()
            .map(|diagnosis| &diagnosis.findings[..]);
        finding::list(py, found.unwrap_or_default())
    }

    /// What the user should know besides.
    #[getter]
    fn warnings(&self) -> Vec<String> {
        self.origin.warnings().to_vec()
    }

    /// All figures as a dict, as `host-fit fit --json` or `host-fit recalibrate --json` writes them; None of a
    /// calibration that was read from its files.
    #[getter]
    fn figures<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        match &self.origin {
            Origin::Fit(of) => finding::figures(py, &of.report),
            Origin::Update(of) => finding::figures(py, &of.figures),
            Origin::Files => finding::figures(py, &Value::Null),
        }
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
    /// (`rms_x_um`, ...), at its ends (`ends_x_um`, ...) and by a unit of the source (`sensitivity_x_um`, ...); then
    /// `combined`, and the inputs that are not included. None without a budget. Needs pandas.
    #[getter]
    fn budget<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        self.known().budget_frame(py)
    }

    /// rms and peak of X, Y, Rz, a dict, um, um, urad: over all rows of the log, zero deviations refitted where
    /// the model has them.
    #[getter]
    fn errors<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        if let Some((_, fit)) = self.origin.fit() {
            return finding::figures(py, &errors(&fit.judgement.errors));
        }
        let [rms, peak] = [self.set.fit.rms, self.set.fit.peak].map(|of| of.map(f64::from));
        finding::figures(py, &from_rms_and_peak(rms, peak))
    }

    /// Errors of the rows of the log that was fitted (of a long one, of the sample), zero deviations taken off,
    /// as `Residuals`: decoded pose less reference, m, m, rad, with the weight of each row in the fit.
    ///
    /// Raises `ValueError` of a calibration that `fit` has not made.
    fn residuals<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let (of, fit) = self.origin.fit_or_raise("residuals")?;
        let dataset = fit.rows(&of.log.dataset);
        let errors = fit.errors_by_row(dataset);
        residuals(
            py,
            dataset,
            &errors,
            Some(&fit.fitted.weights_by_row(dataset)),
        )
    }

    /// Judges the calibration on another log with reference, by the target's decoder.
    ///
    /// `delta`: zero deviations, "fit" for each movement or "zero"; as the model has them if not given.
    /// `limit`: largest rms error in terms of that on the calibration's own log; 3 if not given, and 10 for
    /// models 12 to 31. Raises `LogError` for a log without reference.
    #[pyo3(signature = (log, *, delta = None, limit = None))]
    fn evaluate(
        &self,
        py: Python<'_>,
        log: &Bound<'_, Log>,
        delta: Option<&str>,
        limit: Option<f64>,
    ) -> PyResult<Evaluation> {
        let log = log.get();
        self.check_log(py, log)?;
        Evaluation::new(
            py,
            log,
            (&self.set, self.known.as_ref()),
            self.blob_bytes()?,
            (delta, limit),
        )
    }

    /// Brings the calibration up to date by a few seconds of log; of the field model.
    ///
    /// `what` has changed: "gain" of all probes (2 s of a sine along Y), "gains" of each probe (2 s of X, Y, Rz
    /// at once), "all" (8 s of all six axes at once, as after a probe was seated anew), "temperature" (a run
    /// of 8 s at another one adds to k and h). `created`: creation time for the blob. Raises `LogRefused` where
    /// the log does not determine that, `ValueError` of other models or where `all` lacks the posterior.
    #[pyo3(signature = (log, what, *, created = ""))]
    fn recalibrate(
        &self,
        py: Python<'_>,
        log: &Bound<'_, Log>,
        what: &str,
        created: &str,
    ) -> PyResult<Self> {
        let log = log.get();
        self.check_log(py, log)?;
        let what = chosen::<Change>("what", what)?;
        let created = blob_text("created", created)?;
        let (reading, designed) = (&log.reading, &log.designed);
        let blob = (&self.set, self.known.as_ref());
        let updated = work::run(py, || Updated::new(blob, reading, designed, what, created))?;
        let updated = updated.map_err(|error| recalibrate_error(py, &error))?;
        if let Some(refusal) = updated.refusal_message() {
            let code = updated.refusal.as_ref().map(Refusal::code);
            let findings = &updated.new.diagnosis.findings;
            return Err(refused(py, &refusal, code, findings));
        }
        Ok(Self {
            set: updated.new.set.clone(),
            known: updated.new.known.clone(),
            designed: Arc::clone(designed),
            stage: log.stage.clone_ref(py),
            origin: Origin::Update(Box::new(updated)),
        })
    }

    /// The difference from an `older` calibration, a dict: `parameters` by name (a: older, b: newer,
    /// change, sigma) and `pose_difference`, by the decoder over their common range, um and urad.
    fn diff<'py>(&self, py: Python<'py>, older: PyRef<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let [before, now] = [older.known(), self.known()];
        let figures = py.detach(|| now.changes_from(&before));
        finding::figures(py, &figures)
    }

    /// Writes the certificate that `host-fit fit --report` writes, to this file.
    ///
    /// `operator`: who did it; `notes`: lines of name and text. Raises `OSError` where the file cannot be
    /// written, `ValueError` of a calibration that `fit` has not made.
    #[pyo3(signature = (path, *, operator = None, notes = None))]
    fn report(
        &self,
        py: Python<'_>,
        path: PathBuf,
        operator: Option<&str>,
        notes: Option<BTreeMap<String, String>>,
    ) -> PyResult<()> {
        let (of, fit) = self.origin.fit_or_raise("report")?;
        let about = About {
            title: CERTIFICATE,
            serial: &self.set.serial,
            operator,
            notes: notes.unwrap_or_default(),
            created: &self.set.created,
            certificate: "",
            call: vec!["hallstage".into(), "fit".into()],
        };
        let blob = self.blob_bytes()?;
        let stage_file = self.stage.get().path.as_ref();
        py.detach(|| {
            let (log, report) = (&of.log, &of.report);
            write(
                &path,
                about,
                (log, fit.rows(&log.dataset), &self.designed),
                stage_file,
                of.outcome.subject(),
                (words::messages(&log.warnings), &blob),
                report,
            )
        })
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

    fn _repr_html_(&self) -> PyResult<Option<String>> {
        let subject = self.origin.subject();
        subject.map(|subject| head(&subject, &[])).transpose()
    }
}
