//! Fits and checks.

use crate::calibration::Calibration;
use crate::error::{calibrate_error, refused, wrong};
use crate::finding;
use crate::log::Log;
use crate::work::{self, WATCH};
use host_fit::calibrate::{ErrorLimits, FitOrder};
use host_fit::calibration::diagnose::refusal::Refusal;
use host_fit::calibration::fit::{FitSettings, ModelChoice};
use host_fit::cli::FitOptions;
use pyo3::exceptions::{PyKeyboardInterrupt, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use runtime::parameters::Text;
use std::sync::Arc;
use std::time::Instant;

/// A text that goes into a blob.
pub fn blob_text(argument: &str, text: &str) -> PyResult<Text> {
    Text::try_from(text).map_err(|_| wrong(argument, "at most 32 bytes fit into a blob"))
}

/// Looks at a log as `host-fit check` does: fits it, keeps nothing, and gives what is wrong with it, the most
/// severe first: a list of `Finding`, with `.verdict` and `.refusal`.
///
/// Raises `LogError` for a log without reference.
#[pyfunction]
pub fn check<'py>(py: Python<'py>, log: &Bound<'_, Log>) -> PyResult<Bound<'py, PyAny>> {
    let log = log.get();
    log.check_reference(py)?;
    let mut settings = FitSettings::new(ModelChoice::Auto);
    settings.options.watch = WATCH;
    let order = FitOrder {
        settings,
        limits: ErrorLimits::default(),
        is_kept: false,
    };
    let (reading, stage) = (&log.reading, &log.designed);
    let made = work::run(py, || order.run(reading, stage))?;
    let outcome = made.map_err(|error| calibrate_error(&error))?;
    let verdict = finding::figures(py, &outcome.diagnosis.verdict)?;
    let findings = finding::list(py, &outcome.diagnosis.findings)?;
    let class = py.import("hallstage._results")?.getattr("Findings")?;
    let code = outcome.refusal.as_ref().map(Refusal::code);
    class.call1((findings, verdict, outcome.refusal_message(), code))
}

/// Fits the calibration of a stage to logs, diagnoses them, and takes off the faults that can be: what
/// `host-fit fit` does, with the same defaults, figures and bytes.
///
/// `model`: "auto" (the field model where the log can carry it, else 31), "12", "15", "30", "31" (equations of
/// the paper), "field". `solver`, `project`, `loss`, `train`, `draw`, `population`, `generations`, `seed`,
/// `serial`, `created`, `limit` ("x=1.5um,rz=4urad"), `force`: as the options of that program, which its reference explains. Other threads of Python go on
/// meanwhile; Ctrl-C ends it.
///
/// Raises `LogRefused` with `.findings` where the log is no good for a calibration or the errors are beyond
/// `limit`, unless `force` is true; `ValueError` that names the argument that is wrong.
#[pyfunction]
#[pyo3(
    signature = (log, **options),
    text_signature = "(log, *, model='auto', solver='lm', project='linear', loss=None, train=None, draw='stratified', \
                      population=None, generations=None, seed=1, serial='', created='', limit=None, force=False)"
)]
pub fn fit(
    py: Python<'_>,
    log: &Bound<'_, Log>,
    options: Option<&Bound<'_, PyDict>>,
) -> PyResult<Calibration> {
    let started = Instant::now();
    let log = log.get();
    log.check_reference(py)?;
    let (mut words, mut created) = (Vec::new(), Text::default());
    for (name, value) in options.into_iter().flatten() {
        let name: String = name.extract()?;
        match value.extract::<bool>() {
            _ if name == "created" => {
                let text: String = value.extract().map_err(|error| wrong("created", error))?;
                created = blob_text("created", &text)?;
            }
            _ if value.is_none() => {}
            Ok(false) => {}
            Ok(true) => words.push(format!("--{name}")),
            Err(_) => words.push(format!("--{name}={}", value.str()?.to_cow()?)),
        }
    }
    let options = FitOptions::from_words(words).map_err(PyValueError::new_err)?;
    let order = options.order(created, WATCH);
    let order = order.map_err(|mismatch| wrong(mismatch.argument, mismatch.problem))?;
    let stage = &log.designed;
    let made = work::run(py, || {
        let log_and_stage = (&*log.reading, &**stage);
        let outcome = order.run(&log.reading, stage)?;
        let report = outcome.report(&order, log_and_stage, started.elapsed().as_secs_f64());
        Ok((outcome, report))
    })?;
    let (outcome, report) = made.map_err(|error| calibrate_error(&error))?;
    // A search that was interrupted in another thread.
    if WATCH.is_stopped() {
        return Err(PyKeyboardInterrupt::new_err(()));
    }
    match report {
        Some(report) if outcome.has_blob => {
            let (designed, stage) = (Arc::clone(stage), log.stage.clone_ref(py));
            Calibration::from_fit(outcome, report, Arc::clone(&log.reading), designed, stage)
        }
        _ => {
            let why = outcome.refusal_message().unwrap_or_default();
            let code = outcome.refusal.as_ref().map(Refusal::code);
            Err(refused(py, &why, code, &outcome.diagnosis.findings))
        }
    }
}
