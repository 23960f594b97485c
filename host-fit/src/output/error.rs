//! Why an output is not written.

use std::io::{Error, ErrorKind};
use std::path::{Path, PathBuf};

/// Why an output was not written. The target is as it was before.
#[derive(Debug, thiserror::Error)]
#[error("{}: {problem}", path.display())]
pub struct OutputError {
    /// The output as the user named it.
    pub path: PathBuf,
    /// What is wrong.
    #[source]
    pub problem: OutputProblem,
}

/// What is wrong with an output.
#[derive(Debug, thiserror::Error)]
pub enum OutputProblem {
    /// No file name was given.
    #[error("the name of the output is empty; name a file")]
    NoName,
    /// The target is a folder.
    #[error("is a folder; name a file in it")]
    IsFolder,
    /// The folder of the target does not exist.
    #[error("the folder {} does not exist; create it or name another", folder.display())]
    NoFolder {
        /// The folder.
        folder: PathBuf,
    },
    /// What should be the folder of the target is a file.
    #[error("{} is a file, not a folder; name another folder", folder.display())]
    NotAFolder {
        /// What should be the folder.
        folder: PathBuf,
    },
    /// A record is there, which is not replaced.
    #[error("is there already, and a record is never replaced; name another file, or move it away")]
    Exists,
    /// The target exists and must not be written.
    #[error("the file is read-only; make it writable or name another")]
    ReadOnly,
    /// The folder must not be written.
    #[error("no permission to write into {}: {source}; change its permissions or name another folder", folder.display())]
    NotPermitted {
        /// The folder.
        folder: PathBuf,
        /// What the system says.
        source: Error,
    },
    /// No room is left.
    #[error("no room for {bytes} bytes: {source}; free some space or name another folder")]
    Full {
        /// How many bytes were to be written.
        bytes: usize,
        /// What the system says.
        source: Error,
    },
    /// Anything else that the system says.
    #[error("cannot be written: {source}; name another file")]
    Failed {
        /// What the system says.
        source: Error,
    },
}

impl OutputError {
    /// Of an output as the user named it.
    pub fn new(path: &Path, problem: OutputProblem) -> Self {
        Self {
            path: path.to_path_buf(),
            problem,
        }
    }

    /// The system's error in the user's terms.
    pub(super) fn of_system(source: Error, path: &Path, folder: &Path, bytes: usize) -> Self {
        let folder = folder.to_path_buf();
        // What is not the system's own has the name of the temporary file in it.
        let source = match source.raw_os_error() {
            Some(_) => source,
            None => source.kind().into(),
        };
        let problem = match source.kind() {
            ErrorKind::NotFound => OutputProblem::NoFolder { folder },
            ErrorKind::NotADirectory => OutputProblem::NotAFolder { folder },
            ErrorKind::PermissionDenied | ErrorKind::ReadOnlyFilesystem => {
                OutputProblem::NotPermitted { folder, source }
            }
            ErrorKind::StorageFull | ErrorKind::QuotaExceeded | ErrorKind::FileTooLarge => {
                OutputProblem::Full { bytes, source }
            }
            _ => OutputProblem::Failed { source },
        };
        Self::new(path, problem)
    }

    /// Whether the reader of a pipe closed it.
    pub(super) fn is_closed_pipe(&self) -> bool {
        let kind = ErrorKind::BrokenPipe;
        matches!(&self.problem, OutputProblem::Failed { source } if source.kind() == kind)
    }
}
