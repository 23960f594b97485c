//! Everything that can end a run, with the exit status that it leads to.
//!
//! | status | meaning |
//! |---|---|
//! | 0 | good |
//! | 2 | usage: the command line is wrong |
//! | 3 | bad input: a stage file, log or blob that is refused, an output that can't be written |
//! | 4 | the fit failed its own checks; no blob was written |
//! | 130 | interrupted; the best so far was kept |
//!
//! Every message says what is wrong, where, and what to do.

use crate::log::LogError;
use crate::output::OutputError;
use crate::pose_file::PoseFileError;
use crate::stage::StageError;
use runtime::BlobError;
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
    /// A parameter blob cannot be read.
    #[error("{}: cannot read the parameter blob: {source}; check the path", path.display())]
    BlobUnreadable {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// A parameter blob is refused.
    #[error("{}: {error}; {}", path.display(), blob_remedy(error))]
    Blob {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        error: BlobError,
    },
    /// An output was not written.
    #[error(transparent)]
    Output(#[from] OutputError),
    /// The fit failed its own checks: nothing was written.
    #[error("the fit failed its own checks: {failure}; no parameter blob was written. {remedy}")]
    Fit {
        /// What failed.
        failure: String,
        /// What is missing, or what to do.
        remedy: String,
    },
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
        match self {
            Self::Usage { .. } => 2,
            Self::Stage(_)
            | Self::Log(_)
            | Self::PoseFile(_)
            | Self::BlobUnreadable { .. }
            | Self::Blob { .. }
            | Self::Output(_) => 3,
            Self::Fit { .. } => 4,
            Self::Interrupted { .. } => 130,
        }
    }
}

/// What to do about a blob that is refused.
const fn blob_remedy(error: &BlobError) -> &'static str {
    match error {
        BlobError::Truncated { .. } | BlobError::BadCrc { .. } | BlobError::BadHeader { .. } => {
            "copy the file again, or fit again"
        }
        BlobError::TrailingBytes { .. } => "cut the file to the blob's length, or copy it again",
        BlobError::UnknownVersion { .. } => "update this program, or fit again with it",
        BlobError::Erased | BlobError::BadMagic { .. } => "name a file that fit wrote",
        BlobError::BadPayload | BlobError::Parameters(_) => "fit again",
        BlobError::OtherStage => "name the blob of this stage",
        BlobError::BufferTooSmall { .. } => "give the buffer more bytes",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_kind_of_end_has_its_exit_status() {
        let blob = HostError::Blob {
            path: "p.bin".into(),
            error: BlobError::Erased,
        };
        assert_eq!(blob.exit_status(), 3);
        assert_eq!(HostError::from(LogError::NoLog).exit_status(), 3);
        assert_eq!(HostError::from(OutputError::NoName).exit_status(), 3);
        let usage = HostError::Usage {
            argument: "--train",
            problem: "0 rows".to_owned(),
        };
        assert_eq!(usage.exit_status(), 2);
        let fit = HostError::Fit {
            failure: "the log is constant".to_owned(),
            remedy: "Record movements.".to_owned(),
        };
        assert_eq!(fit.exit_status(), 4);
        let interrupted = HostError::Interrupted {
            kept: "nothing was written".to_owned(),
        };
        assert_eq!(interrupted.exit_status(), 130);
    }

    #[test]
    fn a_refused_blob_is_named_with_its_remedy() {
        let error = HostError::Blob {
            path: "p.bin".into(),
            error: BlobError::Truncated {
                needed: 12,
                found: 3,
            },
        };
        assert_eq!(
            error.to_string(),
            "p.bin: cut short: 3 bytes where at least 12 are needed; copy the file again, or fit again"
        );
    }
}
