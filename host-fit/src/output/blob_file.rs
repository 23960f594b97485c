//! The parameter blob as a file.

use crate::output::{OutputError, OutputProblem, write_atomically};
use hallstage_input::source::{SourceError, read_start};
use runtime::blob::MAX_BYTES;
use runtime::{BlobError, ParameterSet};
use std::path::{Path, PathBuf};

/// Why a file is not a usable parameter blob.
#[derive(Debug, thiserror::Error)]
pub enum BlobFileError {
    /// The file cannot be read.
    #[error("{0}. Name a file that `host-fit fit` wrote")]
    Read(#[from] SourceError),
    /// The file is no usable blob.
    #[error("{}: {cause}; {}", path.display(), remedy(cause))]
    Unusable {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        cause: BlobError,
    },
}

/// What to do about a blob that is refused.
const fn remedy(cause: &BlobError) -> &'static str {
    match cause {
        BlobError::Truncated { .. } | BlobError::BadCrc { .. } | BlobError::BadHeader { .. } => {
            "copy the file again, or fit again"
        }
        BlobError::TrailingBytes { .. } => "cut the file to the blob's length, or copy it again",
        BlobError::UnknownVersion { .. } => "use a newer version of this program, or fit again",
        BlobError::Erased | BlobError::BadMagic { .. } => "name a file that `host-fit fit` wrote",
        BlobError::OtherStage => "name the blob of this stage",
        _ => "fit again",
    }
}

/// Reads and checks a blob; its file must hold nothing else. `-` is standard input.
///
/// # Errors
/// See [`BlobFileError`].
pub fn read(path: &Path) -> Result<ParameterSet, BlobFileError> {
    // A wrong file may be huge; what lies behind twice the largest blob changes no verdict.
    let bytes = read_start(path, 2 * MAX_BYTES as u64)?;
    ParameterSet::from_bytes(&bytes).map_err(|cause| BlobFileError::Unusable {
        path: path.to_owned(),
        cause,
    })
}

/// Writes a set as a blob, whole or not at all.
///
/// # Errors
/// [`OutputError`] when the file cannot be written.
pub fn write(path: &Path, set: &ParameterSet) -> Result<(), OutputError> {
    write_atomically(path, &to_bytes(path, set)?)
}

/// The blob of a set, to be written to `path`.
///
/// # Errors
/// [`OutputProblem::System`], which no set that [`write()`] would take leads to.
pub fn to_bytes(path: &Path, set: &ParameterSet) -> Result<Vec<u8>, OutputError> {
    let mut buffer = [0; MAX_BYTES];
    // The buffer has the size that every blob fits into.
    let bytes = set.to_bytes(&mut buffer).map_err(std::io::Error::other);
    let failed = |source| OutputError::new(path, OutputProblem::System(source));
    bytes.map(<[u8]>::to_vec).map_err(failed)
}
