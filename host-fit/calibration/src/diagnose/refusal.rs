//! Why a calibration is not to be used, as data.

use crate::fit::FitError;
use crate::judge::identify::FitFailure;
use crate::judge::verdict::is_refused;
use crate::recalibrate::RecalibrateError;
use hallstage_input::axis::Axis;
use hallstage_input::finding::{Finding, Severity};

/// An rms error beyond its limit: m, m, rad.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Beyond {
    /// The axis.
    pub axis: &'static Axis,
    /// The error.
    pub rms: f64,
    /// Its limit.
    pub limit: f64,
}

/// Why a calibration is not to be used.
#[derive(Clone, Debug, PartialEq)]
pub enum Refusal {
    /// There is no fit to the log.
    NoFit {
        /// Why.
        error: FitError,
        /// Whether the findings explain it.
        is_explained: bool,
    },
    /// Findings refuse the log.
    Findings,
    /// Errors are beyond the limits that the user set.
    BeyondLimit {
        /// Every such error.
        errors: Vec<Beyond>,
        /// Whether these are the errors predicted for service, not the errors on the log.
        is_in_service: bool,
    },
    /// A search was interrupted while its errors were still far above the noise from row to row.
    Unfinished {
        /// The errors over the noise.
        over_noise: f64,
    },
    /// A blob has much larger errors on a log than on its own logs.
    OtherLog {
        /// The worst axis; its limit is the error on the blob's own logs.
        worst: Beyond,
        /// The largest ratio that is allowed.
        factor: f64,
        /// Whether the blob is of the field model.
        is_field: bool,
        /// The largest difference between the lever arms of the blob and of a fit to the log, m, and between their angles,
        /// rad; `None` without such a fit.
        apart: Option<[f64; 2]>,
    },
    /// A blob cannot be brought up to date by a log.
    NotUpdated(RecalibrateError),
}

impl Refusal {
    /// A refusal because there is no fit.
    pub fn no_fit(error: &FitError, findings: &[Finding]) -> Self {
        // That the model does not describe the log is the last thing to be suspected.
        let least = match error {
            FitError::Failed(FitFailure::NotDescribed { .. }) => Severity::Warn,
            _ => Severity::Refuse,
        };
        let explains = |found: &Finding| {
            let from = found.code().entry().explains_from;
            from.is_some_and(|from| found.severity >= from.max(least))
        };
        Self::NoFit {
            error: error.clone(),
            is_explained: findings.iter().any(explains),
        }
    }

    /// The refusal of a log with these findings, if there is a reason.
    pub fn from_findings(findings: &[Finding]) -> Option<Self> {
        is_refused(findings).then_some(Self::Findings)
    }

    /// Its name in JSON, which is stable.
    pub const fn code(&self) -> &'static str {
        match self {
            Self::NoFit { .. } => "no_fit",
            Self::Findings => "findings",
            Self::BeyondLimit { .. } => "beyond_limit",
            Self::Unfinished { .. } => "unfinished",
            Self::OtherLog { .. } => "other_log",
            Self::NotUpdated(_) => "not_updated",
        }
    }
}

/// Whether probes that differ so much between two fits, in the lever arms (m) or the angles (rad), do not stand in the same seats.
pub fn are_elsewhere([lever_m, angle_rad]: [f64; 2]) -> bool {
    lever_m > 3e-3 || angle_rad > 0.02
}
