//! What calibrations and evaluations show alike: verdict and findings in a notebook, residuals, a page.

use crate::error::{internal, output_error, wrong};
use crate::held::rows_of_three;
use host_fit::calibration::judge::Judgement;
use host_fit::calibration::recalibrate::Certificates;
use host_fit::calibration::words::{message, python};
use host_fit::input::axis::AXES;
use host_fit::input::dataset::Dataset;
use host_fit::input::log::LogReading;
use host_fit::input::stage::Stage as Designed;
use host_fit::output::write_atomically;
use host_fit::report::errors::RowErrors;
use host_fit::report::html::{Cause, Page};
use host_fit::report::page::{Source, facts};
use host_fit::report::provenance::Provenance;
use host_fit::report::result::Report;
use host_fit::report::verdict::{Subject, Summary};
use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{IntoPyDict, PyDict};
use std::collections::BTreeMap;
use std::ffi::OsString;
use std::path::{Path, PathBuf};

/// Verdict, table by axis and findings, for a notebook.
pub fn head(subject: &Subject, warnings: &[String]) -> PyResult<String> {
    let page = Page {
        title: "",
        number: String::new(),
        first: Vec::new(),
        verdict: Summary::new(subject),
        facts: Vec::new(),
        causes: Some(Cause::grouped(&subject.diagnosis.findings)),
        warnings,
        sections: Vec::new(),
    };
    page.head().map(|head| python(&head)).map_err(internal)
}

/// The same in words, for a terminal.
pub fn text(subject: &Subject) -> String {
    let findings = subject.diagnosis.findings.iter();
    let messages = findings.map(|found| message(found) + "\n");
    let text = Summary::new(subject).as_text() + &messages.collect::<String>();
    python(text.trim_end())
}

/// Errors of the rows of a dataset (m, m, rad) as a `hallstage.Residuals`.
pub fn residuals<'py>(
    py: Python<'py>,
    dataset: &Dataset,
    errors: &RowErrors,
    weights: Option<&[f64]>,
) -> PyResult<Bound<'py, PyAny>> {
    let rows = dataset.rows.iter();
    let time = PyArray1::from_iter(py, rows.clone().map(|row| row.t_us as f64 / 1e6));
    let movement = rows.map(|row| dataset.movements[row.movement].index);
    let movement = PyArray1::from_iter(py, movement);
    let axes = errors.iter().map(|error| error.unwrap_or([f64::NAN; 3]));
    let axes = rows_of_three(py, axes.collect())?.transpose()?;
    let weight = match weights {
        Some(weights) => PyArray1::from_slice(py, weights),
        None => PyArray1::from_vec(py, vec![1.0; errors.len()]),
    };
    let class = py.import("hallstage._results")?.getattr("Residuals")?;
    class.call1((time, movement, axes, weight))
}

/// Zero deviations of the probes of each movement, m.
pub fn zero_deviations<'py>(
    py: Python<'py>,
    judgement: &Judgement,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    rows_of_three(
        py,
        judgement.zeros.iter().map(|zero| zero.delta_m).collect(),
    )
}

/// Numbers of X, Y, Rz, and where there are more of Z, Rx, Ry, as a dict.
pub fn by_axis<'py>(py: Python<'py>, numbers: &[f64]) -> PyResult<Bound<'py, PyDict>> {
    let axes = AXES.iter().map(|axis| axis.key);
    axes.zip(numbers.iter().copied()).into_py_dict(py)
}

/// Who says what on a page.
pub struct About<'a> {
    pub title: &'static str,
    pub serial: &'a str,
    pub operator: Option<&'a str>,
    pub notes: BTreeMap<String, String>,
    pub created: &'a str,
    /// The certificates of the calibration that was judged, and of those before it.
    pub certificates: Certificates,
    /// The call that led to it, in words.
    pub call: Vec<OsString>,
}

/// Writes the page of logs and what was made of them, whole or not at all. The errors of the report are of the rows of
/// `dataset`.
pub fn write(
    path: &Path,
    about: About,
    (log, dataset, stage): (&LogReading, &Dataset, &Designed),
    stage_file: Option<&PathBuf>,
    subject: Subject,
    (warnings, blob): (Vec<String>, &[u8]),
    report: &Report,
) -> PyResult<()> {
    let mut provenance = Provenance::new(about.call.into_iter());
    provenance.add_logs(&log.dataset);
    if let Some(file) = stage_file {
        provenance.add_file(file, "stage as designed");
    }
    provenance.add_bytes(Path::new("calibration"), blob, "parameter blob");
    let notes: Vec<(String, String)> = about.notes.into_iter().collect();
    let source = Source {
        title: about.title,
        subject,
        facts: facts(about.serial, about.operator, Some(about.created), &notes),
        stage,
        dataset,
        provenance,
        warnings,
        report: Some(report),
        as_found: None,
        certificates: Some(about.certificates),
    };
    let html = source.html().map_err(internal)?;
    if path.is_dir() {
        return Err(wrong(
            "path",
            "a folder; name a file, such as certificate.html",
        ));
    }
    write_atomically(path, html.as_bytes()).map_err(|error| output_error(&error))
}
