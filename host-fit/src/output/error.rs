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
    /// The command did not write the file that is there.
    #[error(
        "is there and may hold a measurement; name another file, or move it away (fit, plan, simulate and decode replace it with --force)"
    )]
    NotOwn,
    /// A page that is a certificate.
    #[error(
        "is a calibration certificate; name another folder, or move it away (fit replaces it with --force)"
    )]
    IsCertificate,
    /// A blob of another stage.
    #[error(
        "is the blob of stage {0}; name another file, or move it away (fit replaces it with --force)"
    )]
    OtherSerial(String),
    /// The system does not write it.
    #[error("{}", in_words(.0))]
    System(#[source] Error),
}

/// The error of the system and its remedy.
fn in_words(error: &Error) -> String {
    match error.kind() {
        ErrorKind::IsADirectory => "is a folder; name a file in it".to_owned(),
        ErrorKind::NotFound => "the folder does not exist; create it or name another".to_owned(),
        ErrorKind::NotADirectory => {
            "is not in a folder but below a file; name another folder".to_owned()
        }
        ErrorKind::AlreadyExists => {
            "exists already, and a record is never replaced; name another file, or move it away"
                .to_owned()
        }
        ErrorKind::PermissionDenied | ErrorKind::ReadOnlyFilesystem => format!(
            "no permission to write: {error}; change the permissions of file and folder, or name another"
        ),
        ErrorKind::StorageFull | ErrorKind::QuotaExceeded | ErrorKind::FileTooLarge => {
            format!("no room: {error}; free some space or name another folder")
        }
        _ => format!("cannot be written: {error}; name another file"),
    }
}

impl OutputError {
    /// An error of an output as the user named it.
    pub fn new(path: &Path, problem: OutputProblem) -> Self {
        Self {
            path: path.to_path_buf(),
            problem,
        }
    }

    /// The system's error.
    pub(super) fn from_system(path: &Path, source: Error) -> Self {
        // `tempfile` wraps the system's error and adds the name of the temporary file, which the user does not know.
        let source = match source.raw_os_error() {
            Some(_) => source,
            None => source.kind().into(),
        };
        Self::new(path, OutputProblem::System(source))
    }

    /// Whether the reader of a pipe closed it.
    pub(super) fn is_closed_pipe(&self) -> bool {
        let kind = ErrorKind::BrokenPipe;
        matches!(&self.problem, OutputProblem::System(source) if source.kind() == kind)
    }
}
