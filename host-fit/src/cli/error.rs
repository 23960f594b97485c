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
//! Every message says what is wrong, where, and what to do.

use crate::bus::import::ImportError;
use crate::bus::live::LiveError;
use crate::bus::recorder::RecorderError;
use crate::bus::replay::ReplayError;
use crate::bus::update::{UpdateError, UpdateRunError};
use crate::fit::FitError;
use crate::input::log::LogError;
use crate::input::source::SourceError;
use crate::input::stage::StageError;
use crate::interrupt;
use crate::output::OutputError;
use crate::output::blob_file::BlobFileError;
use crate::output::export::ExportError;
use crate::output::pose_file::PoseFileError;
use crate::output::posterior_file::PosteriorFileError;
use crate::plan::PlanError;
use crate::recalibrate::RecalibrateError;
use crate::report::html::PageError;
use crate::report::plots::PlotError;
use crate::simulate::plan_file::PlanFileError;
use crate::simulate::recording::RecordError;
use std::path::PathBuf;

/// Why a run ended early.
#[derive(Debug, thiserror::Error)]
pub enum HostError {
    /// An argument makes no sense, in a way that the command line's own parser cannot see.
    #[error("{argument}: {problem}; see --help")]
    Usage {
        /// The argument.
        argument: &'static str,
        /// What is wrong with it.
        problem: String,
    },
    /// `stage.toml` is refused.
    #[error(transparent)]
    Stage(#[from] StageError),
    /// A log is refused.
    #[error(transparent)]
    Log(#[from] LogError),
    /// A pose file is refused.
    #[error(transparent)]
    PoseFile(#[from] PoseFileError),
    /// A parameter blob is refused.
    #[error(transparent)]
    Blob(#[from] BlobFileError),
    /// A blob was made for other scales than the stage file gives.
    #[error(
        "{}: {key} is {stage:e}, but the parameter blob was made for {blob:e}: name the stage.toml that the blob was \
         fitted with", path.display()
    )]
    OtherScale {
        /// The stage file.
        path: PathBuf,
        /// The key in it.
        key: &'static str,
        /// Its value, m per code.
        stage: f64,
        /// That of the blob, m per code.
        blob: f64,
    },
    /// A blob cannot tell the uncertainty of its poses.
    #[error(
        "{} is of model ({model}), which does not know its errors in service: they are several times those on the log that \
         it was fitted to. Fit the field model (--model field), or leave --uncertainty out", path.display()
    )]
    NoUncertainty {
        /// The blob.
        path: PathBuf,
        /// Name of its model.
        model: &'static str,
    },
    /// A plot could not be drawn.
    #[error(transparent)]
    Plot(#[from] PlotError),
    /// The page of a report could not be made.
    #[error("cannot write the report: {0}")]
    Page(#[from] PageError),
    /// A report could not be turned into JSON.
    #[error("cannot write the figures as JSON: {0}")]
    Json(#[from] serde_json::Error),
    /// There is no place for temporary files.
    #[error("cannot make a temporary folder: {0}; name one with --out")]
    NoTemporaryFolder(std::io::Error),
    /// Standard output cannot be written.
    #[error("cannot write to standard output: {0}")]
    Standard(std::io::Error),
    /// An output was not written.
    #[error(transparent)]
    Output(#[from] OutputError),
    /// The fit failed its own checks: nothing was written.
    #[error("the fit failed its own checks, and no parameter blob was written: {0}")]
    Fit(#[from] FitError),
    /// The same, with what a diagnosis of the log found.
    #[error(
        "the fit failed its own checks, and no parameter blob was written: {error}. {findings}"
    )]
    FitDiagnosed {
        /// Why there is no fit.
        error: FitError,
        /// The messages of the findings.
        findings: String,
    },
    /// The calibration would be wrong: nothing was written.
    #[error("the log is refused, and no parameter blob was written: {findings}")]
    Refused {
        /// The messages of the findings.
        findings: String,
    },
    /// There is a fit, which must not be used or is not as good as was asked for.
    #[error("{cause}. No parameter blob was written; --force writes one that says so")]
    NotWritten {
        /// Why.
        cause: String,
    },
    /// A blob does not describe a log as well as those that it was fitted to.
    #[error(
        "the parameter blob does not describe this log: {error:.2} {unit} rms in {axis}, where it had {own:.2} {unit} in \
         the logs that it was fitted to, more than {limit} times as much (--limit){cause}"
    )]
    BeyondLimit {
        /// The axis.
        axis: &'static str,
        /// um or urad.
        unit: &'static str,
        /// rms error, um or urad.
        error: f64,
        /// That of the blob's own logs, um or urad.
        own: f64,
        /// The largest factor between the two.
        limit: f64,
        /// What a diagnosis of the log found, after a full stop.
        cause: String,
    },
    /// The posterior beside a blob is refused.
    #[error(transparent)]
    Posterior(#[from] PosteriorFileError),
    /// A blob was not brought up to date: nothing was written.
    #[error("the calibration was not brought up to date, and no parameter blob was written: {0}")]
    Recalibrate(#[from] RecalibrateError),
    /// `import` refused its input.
    #[error(transparent)]
    Import(#[from] ImportError),
    /// A blob cannot be exported.
    #[error(transparent)]
    Export(#[from] ExportError),
    /// `live` ended early.
    #[error(transparent)]
    Live(#[from] LiveError),
    /// There is no record of the bus, or none to calibrate by.
    #[error(transparent)]
    Recorder(#[from] RecorderError),
    /// `replay` ended early.
    #[error(transparent)]
    Replay(#[from] ReplayError),
    /// A controller was not identified, updated or read.
    #[error(transparent)]
    Update(#[from] UpdateRunError),
    /// A key is refused.
    #[error("{}: {problem}; name the file with the key of this stage", path.display())]
    Key {
        /// The file.
        path: PathBuf,
        /// What is wrong with it, without showing it.
        problem: String,
    },
    /// No run leads to a calibration within the limits: nothing was written.
    #[error("no run was written: {0}")]
    Plan(#[from] PlanError),
    /// A planned run is refused.
    #[error(transparent)]
    PlanFile(#[from] PlanFileError),
    /// A run cannot be simulated.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// The user interrupted the run.
    #[error("interrupted; {kept}")]
    Interrupted {
        /// What was kept.
        kept: String,
    },
}

impl HostError {
    /// The exit status of a run that ends with this error.
    pub const fn exit_status(&self) -> u8 {
        use SourceError::Interrupted;
        match self {
            Self::Update(UpdateRunError::Dialog {
                cause: UpdateError::Interrupted,
                ..
            })
            | Self::Log(LogError::Source(Interrupted { .. }))
            | Self::Import(
                ImportError::Bus(Interrupted { .. })
                | ImportError::Reference(LogError::Source(Interrupted { .. })),
            )
            | Self::Interrupted { .. } => interrupt::EXIT_STATUS,
            Self::Usage { .. }
            | Self::Export(ExportError::NoSlot { .. } | ExportError::Unaligned { .. }) => 2,
            Self::Stage(_)
            | Self::Log(_)
            | Self::PoseFile(_)
            | Self::Blob(_)
            | Self::Posterior(_)
            | Self::Recalibrate(
                RecalibrateError::OtherModel { .. } | RecalibrateError::NothingKnown,
            )
            | Self::OtherScale { .. }
            | Self::NoUncertainty { .. }
            | Self::Plot(_)
            | Self::Page(_)
            | Self::Json(_)
            | Self::NoTemporaryFolder(_)
            | Self::Standard(_)
            | Self::Import(_)
            | Self::Export(_)
            | Self::Live(_)
            | Self::Recorder(_)
            | Self::Replay(_)
            | Self::Update(_)
            | Self::Key { .. }
            | Self::PlanFile(_)
            | Self::Record(_)
            | Self::Output(_) => 3,
            Self::Fit(_)
            | Self::FitDiagnosed { .. }
            | Self::Refused { .. }
            | Self::NotWritten { .. }
            | Self::BeyondLimit { .. }
            | Self::Plan(_)
            | Self::Recalibrate(_) => 4,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solve::SolveError;

    #[test]
    fn each_kind_of_end_has_its_exit_status() {
        let blob = BlobFileError::Unusable {
            path: "p.bin".into(),
            cause: runtime::BlobError::Erased,
        };
        assert_eq!(HostError::from(blob).exit_status(), 3);
        assert_eq!(HostError::from(LogError::NoLog).exit_status(), 3);
        assert_eq!(HostError::from(OutputError::NoName).exit_status(), 3);
        let usage = HostError::Usage {
            argument: "--train",
            problem: "0 rows".to_owned(),
        };
        assert_eq!(usage.exit_status(), 2);
        let fit = FitError::from(SolveError::NoPlanarMotion);
        assert_eq!(HostError::from(fit).exit_status(), 4);
        let plan = PlanError::TooFewFrequencies { seconds: 2.0 };
        assert_eq!(HostError::from(plan).exit_status(), 4);
        let interrupted = HostError::Interrupted {
            kept: "nothing was written".to_owned(),
        };
        assert_eq!(interrupted.exit_status(), 130);
    }
}
