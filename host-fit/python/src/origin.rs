//! The origin of a calibration: a fit, an update or files.

use host_fit::calibrate::{JudgedFit, Updated};
use host_fit::calibration::diagnose::Diagnosis;
use host_fit::calibration::fit::Fit;
use host_fit::input::log::LogReading;
use host_fit::report::result::Report;
use host_fit::report::verdict::Subject;
use pyo3::PyResult;
use pyo3::exceptions::PyValueError;
use std::sync::Arc;

/// The origin of a calibration.
pub enum Origin {
    Fit(Box<OfFit>),
    Update(Box<Updated>),
    Files,
}

pub struct OfFit {
    pub outcome: JudgedFit,
    pub report: Report,
    pub log: Arc<LogReading>,
}

impl Origin {
    /// The fit, if there was one.
    pub fn fit(&self) -> Option<(&OfFit, &Fit)> {
        match self {
            Self::Fit(of) => Some((of, of.outcome.fitted.as_ref().ok()?)),
            _ => None,
        }
    }

    /// The same, or an exception that names the caller.
    pub fn fit_or_raise(&self, what: &str) -> PyResult<(&OfFit, &Fit)> {
        let problem = || {
            PyValueError::new_err(format!(
                "{what}: only a calibration that `fit` has made has its log; use evaluate(log)"
            ))
        };
        self.fit().ok_or_else(problem)
    }

    pub fn diagnosis(&self) -> Option<&Diagnosis> {
        match self {
            Self::Fit(of) => Some(&of.outcome.diagnosis),
            Self::Update(of) => Some(&of.new.diagnosis),
            Self::Files => None,
        }
    }

    /// What reports say of it.
    pub fn subject(&self) -> Option<Subject<'_>> {
        match self {
            Self::Fit(of) => Some(of.outcome.subject()),
            Self::Update(of) => Some(of.subject()),
            Self::Files => None,
        }
    }

    pub fn warnings(&self) -> &[String] {
        match self {
            Self::Fit(of) => &of.report.warnings,
            Self::Update(of) => &of.warnings,
            Self::Files => &[],
        }
    }
}
