//! The parameter blob as a file.

use crate::output::{OutputError, write_atomically};
use runtime::blob::MAX_BYTES;
use runtime::{BlobError, ParameterSet};
use std::io::Read;
use std::path::{Path, PathBuf};

/// Why a file is not a usable parameter blob.
#[derive(Debug, thiserror::Error)]
pub enum BlobFileError {
    /// The file cannot be read.
    #[error("cannot read the parameter blob {}: {cause}. Name a file that `host-fit fit` wrote", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system says.
        cause: std::io::Error,
    },
    /// The file is no usable blob.
    #[error("{}: {cause}. {}", path.display(), remedy(cause))]
    Unusable {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        cause: BlobError,
    },
}

const fn remedy(cause: &BlobError) -> &'static str {
    match cause {
        BlobError::BadMagic { .. } => "Name a file that `host-fit fit` wrote",
        BlobError::UnknownVersion { .. } => "Use the version of host-fit that wrote it, or a newer one",
        BlobError::TrailingBytes { .. } => {
            "Use the file as `host-fit fit` wrote it, or cut the padding off"
        }
        _ => "Copy the file again from where it was made, or fit again",
    }
}

/// Reads a blob, whose file must hold exactly that, and checks it.
///
/// # Errors
/// See [`BlobFileError`].
pub fn read(path: &Path) -> Result<ParameterSet, BlobFileError> {
    let failed = |cause| BlobFileError::Read {
        path: path.to_owned(),
        cause,
    };
    let mut bytes = Vec::with_capacity(2 * MAX_BYTES);
    let file = std::fs::File::open(path).map_err(failed)?;
    // A wrong file may be huge; what lies behind twice the largest blob changes no verdict.
    file.take(2 * MAX_BYTES as u64)
        .read_to_end(&mut bytes)
        .map_err(failed)?;
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
    let mut buffer = [0; MAX_BYTES];
    match set.to_bytes(&mut buffer) {
        Ok(bytes) => write_atomically(path, bytes),
        // The buffer has the size that every blob fits into.
        Err(cause) => Err(OutputError::other(path, cause.to_string())),
    }
}
