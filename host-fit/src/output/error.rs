//! Why an output is not written.

use super::is_standard;
use std::io::{Error, ErrorKind};
use std::path::{Path, PathBuf};

/// An output that was not written. The target has not changed.
#[derive(Debug, thiserror::Error)]
#[error("{}: {problem}", if is_standard(path) { "standard output".into() } else { path.to_string_lossy() })]
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
    /// An input of the same command.
    #[error("also an input of this command; name another file")]
    IsInput,
    /// Named twice.
    #[error("also another output of this command; name another file")]
    IsOutput,
    /// The target is a folder.
    #[error("is a folder; name a file in it")]
    IsFolder,
    /// The folder of the target does not exist.
    #[error("the folder does not exist; create it or name another")]
    NoFolder,
    /// The folder of the target is a file.
    #[error("is not in a folder but below a file; name another folder")]
    NotAFolder,
    /// A record is never replaced.
    #[error("exists already, and a record is never replaced; name another file, or move it away")]
    Exists,
    /// The target must not be written.
    #[error("the file is read-only; make it writable or name another")]
    ReadOnly,
    /// The folder must not be written.
    #[error("no permission to write: {0}; change the permissions of the folder or name another")]
    NotPermitted(#[source] Error),
    /// The disk is full.
    #[error("no room: {0}; free some space or name another folder")]
    Full(#[source] Error),
    /// Anything else.
    #[error("cannot be written: {0}; name another file")]
    Failed(#[source] Error),
}

impl OutputError {
    /// An error of an output as the user named it.
    pub fn new(path: &Path, problem: OutputProblem) -> Self {
        Self {
            path: path.to_path_buf(),
            problem,
        }
    }

    /// The system's error in the user's terms.
    pub(super) fn from_system(path: &Path, source: Error) -> Self {
        // `tempfile` wraps the system's error and adds the name of the temporary file, which the user does not know.
        let source = match source.raw_os_error() {
            Some(_) => source,
            None => source.kind().into(),
        };
        let problem = match source.kind() {
            ErrorKind::AlreadyExists => OutputProblem::Exists,
            ErrorKind::NotFound => OutputProblem::NoFolder,
            ErrorKind::NotADirectory => OutputProblem::NotAFolder,
            ErrorKind::PermissionDenied | ErrorKind::ReadOnlyFilesystem => {
                OutputProblem::NotPermitted(source)
            }
            ErrorKind::StorageFull | ErrorKind::QuotaExceeded | ErrorKind::FileTooLarge => {
                OutputProblem::Full(source)
            }
            _ => OutputProblem::Failed(source),
        };
        Self::new(path, problem)
    }

    /// Whether the reader of a pipe closed it.
    pub(super) fn is_closed_pipe(&self) -> bool {
        let kind = ErrorKind::BrokenPipe;
        matches!(&self.problem, OutputProblem::Failed(source) if source.kind() == kind)
    }
}
