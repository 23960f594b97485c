//! The library's errors as Python's exceptions. The classes of the package stand in `hallstage._errors`.

use host_fit::calibrate::CalibrateError;
use host_fit::calibration::recalibrate::RecalibrateError;
use host_fit::calibration::words::python;
use host_fit::input::finding::Finding;
use host_fit::input::log::{CellFault, LogError, LogProblem};
use host_fit::input::source::SourceProblem;
use host_fit::input::stage::StageError;
use host_fit::output::OutputError;
use host_fit::output::blob_file::BlobFileError;
use host_fit::output::posterior_file::PosteriorFileError;
use pyo3::call::PyCallArgs;
use pyo3::exceptions::{
    PyFileNotFoundError, PyKeyboardInterrupt, PyOSError, PyRuntimeError, PyValueError,
};
use pyo3::prelude::*;
use std::fmt::Display;

/// An error in the words of the package.
fn said(error: impl Display) -> String {
    python(&error.to_string())
}

/// A wrong argument, by its name.
pub fn wrong(argument: &str, problem: impl Display) -> PyErr {
    PyValueError::new_err(said(format_args!("{argument}: {problem}")))
}

/// An exception of a class of this package.
fn own<'py>(py: Python<'py>, class: &str, arguments: impl PyCallArgs<'py>) -> PyErr {
    let made = || -> PyResult<Bound<'py, PyAny>> {
        let class = py.import("hallstage._errors")?.getattr(class)?;
        class.call1(arguments)
    };
    made().map_or_else(|error| error, PyErr::from_value)
}

/// A log that is refused: `LogError`, or `OSError` where its file cannot be read.
pub fn log_error(py: Python<'_>, error: &LogError) -> PyErr {
    use SourceProblem::{Interrupted, IsFolder, NotFound, Unreadable};
    match &error.problem {
        LogProblem::Source(of @ (Interrupted | NotFound | IsFolder | Unreadable { .. })) => {
            source_error(of, said(error))
        }
        _ => {
            let place = &error.place;
            let file = Some(place.path.display().to_string()).filter(|file| !file.is_empty());
            let (column, name) = place.column.clone().unzip();
            let arguments = (said(error), file, place.line, column, name);
            own(py, "LogError", arguments)
        }
    }
}

/// A log that arrays made, by argument and row: a header stands above its rows.
pub fn arrays_error(py: Python<'_>, error: &LogError, arguments: &[(String, String)]) -> PyErr {
    let place = &error.place;
    let named = |(header, _): &&(String, String)| {
        (place.column.as_ref()).is_some_and(|(_, name)| name == header)
    };
    let row = place.line.and_then(|line| line.checked_sub(2));
    let (Some((_, argument)), Some(row)) = (arguments.iter().find(named), row) else {
        return log_error(py, error);
    };
    let nan = CellFault::Missing {
        text: "NaN".to_owned(),
    };
    let problem: &dyn Display = match &error.problem {
        LogProblem::Cell(CellFault::Empty) => &nan,
        other => other,
    };
    let message = said(format_args!("{argument}[{row}]: {problem}"));
    let column = place.column.as_ref().map(|(column, _)| *column);
    own(
        py,
        "LogError",
        (message, None::<String>, row, column, argument),
    )
}

/// A log that is no good for a calibration.
pub fn refused(py: Python<'_>, why: &str, code: Option<&str>, findings: &[Finding]) -> PyErr {
    let made = crate::finding::list(py, findings);
    made.map_or_else(
        |error| error,
        |findings| own(py, "LogRefused", (said(why), findings, code)),
    )
}

pub fn calibrate_error(error: &CalibrateError) -> PyErr {
    match error {
        CalibrateError::Unsupported(error) => wrong("project", error),
        CalibrateError::Interrupted(_) => PyKeyboardInterrupt::new_err(()),
    }
}

pub fn stage_error(error: &StageError) -> PyErr {
    match error {
        StageError::Source(source) => source_error(&source.problem, said(error)),
        _ => PyValueError::new_err(said(error)),
    }
}

/// A file that cannot be read.
fn source_error(problem: &SourceProblem, message: String) -> PyErr {
    match problem {
        SourceProblem::NotFound => PyFileNotFoundError::new_err(message),
        SourceProblem::Interrupted => PyKeyboardInterrupt::new_err(()),
        _ => PyOSError::new_err(message),
    }
}

pub fn blob_error(error: &BlobFileError) -> PyErr {
    match error {
        BlobFileError::Read(source) => source_error(&source.problem, said(error)),
        BlobFileError::Unusable { .. } => PyValueError::new_err(said(error)),
    }
}

pub fn posterior_error(error: &PosteriorFileError) -> PyErr {
    match error {
        PosteriorFileError::Read(source) => source_error(&source.problem, said(error)),
        _ => PyValueError::new_err(said(error)),
    }
}

pub fn output_error(error: &OutputError) -> PyErr {
    PyOSError::new_err(said(error))
}

pub fn recalibrate_error(py: Python<'_>, error: &RecalibrateError) -> PyErr {
    match error {
        RecalibrateError::OtherModel { .. } | RecalibrateError::NothingKnown => {
            PyValueError::new_err(said(error))
        }
        _ => refused(py, &error.to_string(), None, &[]),
    }
}

/// What no input leads to.
pub fn internal(error: impl Display) -> PyErr {
    PyRuntimeError::new_err(error.to_string())
}
