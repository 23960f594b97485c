//! Fits and checks.

use crate::calibration::Calibration;
use crate::error::{calibrate_error, refused, wrong};
use crate::finding;
use crate::log::Log;
use crate::work;
use host_fit::calibrate::{ErrorLimits, FitOrder};
use host_fit::calibration::diagnose::refusal::Refusal;
use host_fit::calibration::fit::{FitSettings, ModelChoice};
use host_fit::calibration::words::python;
use host_fit::cli::FitOptions;
use host_fit::input::axis::PLANAR;
use host_fit::input::watch::Watch;
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use runtime::parameters::Text;
use std::collections::BTreeMap;
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
    let (reading, stage) = (Arc::clone(&log.reading), Arc::clone(&log.text.designed));
    let made = work::run(py, move |watch| {
        let mut settings = FitSettings::new(ModelChoice::Auto);
        settings.options.watch = watch;
        let order = FitOrder {
            settings,
            limits: ErrorLimits::default(),
            is_kept: false,
        };
        order.run(&reading, &stage)
    })?;
    let outcome = made.map_err(|error| calibrate_error(&error))?;
    let verdict = finding::figures(py, &outcome.diagnosis.verdict)?;
    let findings = finding::list(py, &outcome.diagnosis.findings)?;
    let class = py.import("hallstage._results")?.getattr("Findings")?;
    let code = outcome.refusal.as_ref().map(Refusal::code);
    let refusal = outcome.refusal_message().map(|message| python(&message));
    class.call1((findings, verdict, refusal, code))
}

/// Fits the calibration of a stage to logs, diagnoses them, and takes off the faults that can be: what
/// `host-fit fit` does, with the same defaults, figures and bytes.
///
/// `model`: "auto" (the field model where the log can carry it, else 31), "12", "15", "30", "31" (equations of
/// the paper), "field". `solver`, `project`, `loss`, `train`, `draw`, `population`, `generations`, `seed`,
/// `serial`, `created`, `force`: as the options of that program, which its reference explains. `limit`: the largest rms errors
/// by axis, m and rad, `{"x": 1.5e-6, "rz": 4e-6}`. Other threads of Python go on meanwhile; Ctrl-C ends it.
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
    let mut limits = None;
    for (name, value) in options.into_iter().flatten() {
        let name: String = name.extract()?;
        match value.extract::<bool>() {
            Err(_) if name == "force" => return Err(wrong("force", "True or False is needed")),
            _ if name == "limit" && !value.is_none() => limits = read_limits(&value)?,
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
    let options = FitOptions::from_words(words);
    let mut options = options.map_err(|error| match error.strip_prefix("unexpected argument") {
        Some(_) => PyTypeError::new_err(python(&error)),
        None => PyValueError::new_err(python(&error)),
    })?;
    options.limit = limits;
    let order = options.order(created, Watch::NONE);
    let mut order = order.map_err(|mismatch| wrong(mismatch.argument, mismatch.problem))?;
    let (reading, stage) = (Arc::clone(&log.reading), Arc::clone(&log.text.designed));
    let (fitted, designed) = (Arc::clone(&reading), Arc::clone(&stage));
    let made = work::run(py, move |watch| {
        order.settings.options.watch = watch;
        let outcome = order.run(&reading, &stage)?;
        let log_and_stage = (&*reading, &*stage);
        let report = outcome.report(&order, log_and_stage, started.elapsed().as_secs_f64());
        Ok((outcome, report))
    })?;
    let (outcome, report) = made.map_err(|error| calibrate_error(&error))?;
    match report {
        Some(report) if outcome.has_blob => {
            Calibration::from_fit(outcome, report, fitted, designed, log.stage.clone_ref(py))
        }
        _ => {
            let why = outcome.refusal_message().unwrap_or_default();
            let code = outcome.refusal.as_ref().map(Refusal::code);
            Err(refused(py, &why, code, &outcome.diagnosis.findings))
        }
    }
}

/// Largest rms errors by axis.
fn read_limits(given: &Bound<'_, PyAny>) -> PyResult<Option<ErrorLimits>> {
    let problem = "a dict of x, y and rz to numbers above zero, m and rad, is needed";
    let by_axis: BTreeMap<String, f64> = given.extract().map_err(|_| wrong("limit", problem))?;
    let mut limits = ErrorLimits::default();
    for (name, limit) in by_axis {
        let axis = PLANAR.iter().position(|axis| axis.key == name);
        let axis = axis.filter(|_| limit.is_finite() && limit > 0.0);
        limits.0[axis.ok_or_else(|| wrong("limit", problem))?] = Some(limit);
    }
    Ok(Some(limits))
}
