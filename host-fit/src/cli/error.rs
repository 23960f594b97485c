//! Everything that can end a run, with the exit status that it leads to.
//!
//! | status | meaning |
//! |---|---|
//! | 0 | good |
//! | 2 | usage: the command line is wrong |
//! | 3 | bad input: a stage file, log or blob that is refused, an output that can't be written |
//! | 4 | the fit failed its own checks, a log is refused or not described, or no run can be planned; nothing was written |
//! | 130 | interrupted; the best so far was kept |
//!
//! Every message says what is wrong, where, and what to do. The library's errors have variants; here
//! they end, and only their message and their status count.

use super::fit_options::Mismatch;
use super::interrupt;
use crate::bus::update::{UpdateError, UpdateRunError};
use crate::calibrate::CalibrateError;
use crate::join::JoinError;
use crate::output::export::ExportError;
use crate::output::{OutputError, OutputProblem};
use hallstage_calibration::fit::FitError;
use hallstage_calibration::plan::PlanError;
use hallstage_calibration::recalibrate::RecalibrateError;
use hallstage_calibration::words::NO_FIT;
use hallstage_input::log::{LogError, LogProblem};
use hallstage_input::source::SourceProblem::Interrupted;
use hallstage_simulate::recording::RecordError;
use std::error::Error;
use std::fmt::{self, Display, Formatter};

/// Why a run ended early.
#[derive(Debug)]
pub struct HostError {
    status: u8,
    /// What was not done, before the cause.
    lost: &'static str,
    cause: Box<dyn Error + Send + Sync>,
}

impl HostError {
    fn new(status: u8, message: String) -> Self {
        Self {
            status,
            lost: "",
            cause: message.into(),
        }
    }

    /// An argument makes no sense, in a way that the command line's own parser cannot see.
    pub(super) fn usage(argument: &str, problem: impl Display) -> Self {
        Self::new(2, format!("{argument}: {problem}; see --help"))
    }

    /// An input does not do for the command.
    pub(super) fn input(problem: String) -> Self {
        Self::new(3, problem)
    }

    /// The log, or what was made of it, is not good enough.
    pub(super) fn rejected(problem: String) -> Self {
        Self::new(4, problem)
    }

    /// The user interrupted the run.
    pub(super) fn interrupted(kept: impl Display) -> Self {
        Self::new(interrupt::EXIT_STATUS, format!("interrupted; {kept}"))
    }

    /// The exit status of a run that ends with this error.
    pub const fn exit_status(&self) -> u8 {
        self.status
    }

    /// Whether it says no more than that the reader of a pipe has closed it.
    pub(super) fn is_closed_pipe(&self) -> bool {
        let first: &(dyn Error + 'static) = &*self.cause;
        let mut causes = std::iter::successors(Some(first), |&cause| cause.source());
        causes.any(|cause| {
            let cause = cause.downcast_ref::<std::io::Error>();
            cause.is_some_and(|cause| cause.kind() == std::io::ErrorKind::BrokenPipe)
        })
    }
}

impl Display for HostError {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        write!(f, "{}{}", self.lost, self.cause)
    }
}

impl HostError {
    /// Why a fit was not tried, or not kept.
    pub(super) fn from_calibrate(error: CalibrateError) -> Self {
        match error {
            CalibrateError::Unsupported(error) => Self::usage("--project", error),
            CalibrateError::Interrupted(kept) => Self::interrupted(kept),
        }
    }

    /// Settings of a fit that do not go together.
    pub(super) fn from_mismatch(Mismatch { argument, problem }: Mismatch) -> Self {
        Self::usage(&format!("--{argument}"), problem)
    }
}

impl<E: Error + Send + Sync + 'static> From<E> for HostError {
    fn from(error: E) -> Self {
        let (status, lost) = end_of(&error);
        Self {
            status,
            lost,
            cause: error.into(),
        }
    }
}

/// The status that an error of the library leads to, and what was not done.
fn end_of(error: &(dyn Error + 'static)) -> (u8, &'static str) {
    if is_interrupted(error) {
        return (interrupt::EXIT_STATUS, "");
    }
    if error.is::<FitError>() {
        return (4, NO_FIT);
    }
    if error.is::<PlanError>() {
        return (4, "no run was written: ");
    }
    if let Some(cause) = error.downcast_ref() {
        let status = match cause {
            RecalibrateError::OtherModel { .. }
            | RecalibrateError::NothingKnown
            | RecalibrateError::NoTemperature(_) => 3,
            _ => 4,
        };
        return (
            status,
            "the calibration was not brought up to date, and no parameter blob was written: ",
        );
    }
    if let Some(OutputError {
        problem:
            OutputProblem::IsInput
            | OutputProblem::IsOutput
            | OutputProblem::NotOwn
            | OutputProblem::IsCertificate
            | OutputProblem::OtherSerial(_),
        ..
    }) = error.downcast_ref()
    {
        return (2, "");
    }
    if let Some(RecordError::NoTemperature) = error.downcast_ref() {
        return (2, "");
    }
    match error.downcast_ref() {
        Some(ExportError::NoSlot { .. } | ExportError::Unaligned { .. }) => (2, ""),
        _ => (3, ""),
    }
}

/// Whether Ctrl-C ended the work.
fn is_interrupted(error: &(dyn Error + 'static)) -> bool {
    let import_error = match error.downcast_ref() {
        Some(JoinError::Log(error)) => Some(error),
        _ => None,
    };
    let log: Option<&LogError> = error.downcast_ref().or(import_error);
    let dialog = match error.downcast_ref() {
        Some(UpdateRunError::Dialog { cause, .. }) => Some(cause),
        _ => None,
    };
    log.is_some_and(|error| matches!(error.problem, LogProblem::Source(Interrupted)))
        || matches!(dialog, Some(UpdateError::Interrupted))
}
