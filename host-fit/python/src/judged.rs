//! How good a calibration is: on its own log, and on others.

use crate::calibration::Calibration;
use crate::choice::chosen;
use crate::error::{recalibrate_error, refused};
use crate::evaluation::Evaluation;
use crate::finding;
use crate::fit::blob_text;
use crate::log::Log;
use crate::origin::Origin;
use crate::report::{About, by_axis, head, residuals, write, zero_deviations};
use crate::work;
use host_fit::calibrate::Updated;
use host_fit::calibration::diagnose::refusal::Refusal;
use host_fit::calibration::judge::Judgement;
use host_fit::calibration::recalibrate::Certificates;
use host_fit::calibration::words;
use host_fit::output::kept::CERTIFICATE;
use host_fit::solver::estimator::update::Change;
use numpy::PyArray2;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;

#[pymethods]
impl Calibration {
    /// "good", "limited" or "refused", or `None` where that is not known.
    #[getter]
    fn verdict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let verdict = self
            .origin
            .diagnosis()
            .and_then(|diagnosis| diagnosis.verdict);
        finding::figures(py, &verdict)
    }

    /// Faults of the log, the most severe first: a list of `Finding`.
    #[getter]
    fn findings<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        let found = self
            .origin
            .diagnosis()
            .map(|diagnosis| &diagnosis.findings[..]);
        finding::list(py, found.unwrap_or_default())
    }

    /// Further messages to the user.
    #[getter]
    fn warnings(&self) -> Vec<String> {
        let warnings = self.origin.warnings().iter();
        warnings.map(|warning| words::python(warning)).collect()
    }

    /// All figures of `host-fit fit --json` or `host-fit recalibrate --json` as a dict, in SI; `None` of a calibration that was
    /// read from its files.
    #[getter]
    fn details<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        match &self.origin {
            Origin::Fit(of) => finding::figures(py, &of.report),
            Origin::Update(of) => finding::figures(py, &of.figures),
            Origin::Files => finding::figures(py, &Value::Null),
        }
    }

    /// rms errors of X, Y, Rz, a dict, m, m, rad: over all rows of the log, zero deviations refitted where the model has
    /// them.
    #[getter]
    fn rms<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let judged = self
            .judgement()
            .map(|judged| judged.errors.axes.map(|axis| axis.rms));
        by_axis(py, &judged.unwrap_or(self.set.fit.rms.map(f64::from)))
    }

    /// The largest errors of X, Y, Rz over the same rows, a dict, m, m, rad.
    #[getter]
    fn peak<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let judged = self
            .judgement()
            .map(|judged| judged.errors.axes.map(|axis| axis.peak));
        by_axis(py, &judged.unwrap_or(self.set.fit.peak.map(f64::from)))
    }

    /// Zero deviations of the Hall probes A, B, C, a row for each movement: float64, (movements, 3), m; `None` of a calibration
    /// that was read from its files.
    #[getter]
    fn zero_deviations<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray2<f64>>>> {
        let judgement = self.judgement();
        judgement
            .map(|judgement| zero_deviations(py, judgement))
            .transpose()
    }

    /// Errors of the rows of the log that was fitted (of a long one, of its sample), zero deviations taken off,
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
        let reading = Arc::clone(&log.reading);
        let designed = Arc::clone(&log.text.designed);
        let (set, known) = (self.set.clone(), self.known.clone());
        let updated = work::run(py, move |_| {
            Updated::new((&set, known.as_ref()), &reading, &designed, what, created)
        })?;
        let updated = updated.map_err(|error| recalibrate_error(py, &error))?;
        if let Some(refusal) = updated.refusal_message() {
            let code = updated.refusal.as_ref().map(Refusal::code);
            let findings = &updated.new.diagnosis.findings;
            return Err(refused(py, &refusal, code, findings));
        }
        Ok(Self {
            set: updated.new.set.clone(),
            known: updated.new.known.clone(),
            designed: Arc::clone(&log.text.designed),
            stage: log.stage.clone_ref(py),
            origin: Origin::Update(Box::new(updated)),
        })
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
            certificates: Certificates::default(),
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

    fn _repr_html_(&self) -> PyResult<Option<String>> {
        let subject = self.origin.subject();
        subject.map(|subject| head(&subject, &[])).transpose()
    }
}

impl Calibration {
    /// How it does on its log.
    fn judgement(&self) -> Option<&Judgement> {
        match &self.origin {
            Origin::Fit(_) => self.origin.fit().map(|(_, fit)| &fit.judgement),
            Origin::Update(of) => Some(&of.new.judgement),
            Origin::Files => None,
        }
    }
}
