//! Writes output files whole or not at all.
//!
//! The bytes go to a new file in the same folder, reach the disk, and then replace the target in one step. A reader of
//! the target sees the old file or the new one.
//!
//! ```
//! use host_fit::output::Outputs;
//! use std::path::Path;
//!
//! # let folder = tempfile::tempdir()?;
//! # let folder = folder.path();
//! let mut outputs = Outputs::default();
//! outputs.add(&folder.join("params.bin"), b"a blob")?;
//! outputs.add(&folder.join("fit.json"), b"{}")?;
//! assert!(!folder.join("params.bin").exists());
//! outputs.commit()?;
//! assert!(folder.join("params.bin").exists());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod blob_file;
mod error;
pub mod export;
mod file;
pub mod kept;
pub mod pose_file;
pub mod posterior_file;
pub mod record_file;

pub use error::{OutputError, OutputProblem};
pub use file::{Output, check_writable, is_standard, is_standard_output, keep_apart};

use flate2::{Compression, write::GzEncoder};
use std::fs;
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};

/// A text for `path`, whole or in part: compressed if the name ends in `.gz`.
///
/// # Errors
/// [`OutputError`].
pub fn packed(path: &Path, text: String) -> Result<Vec<u8>, OutputError> {
    if path.extension().is_none_or(|extension| extension != "gz") {
        return Ok(text.into_bytes());
    }
    let mut gzip = GzEncoder::new(Vec::new(), Compression::default());
    let packed = gzip.write_all(text.as_bytes());
    let packed = packed.and_then(|()| gzip.finish());
    packed.map_err(|source| OutputError::from_system(path, source))
}

/// Writes `bytes` to `path`: all of them, or nothing. An existing file is replaced and keeps its permissions. A link is
/// followed. A device, a pipe and standard output (`-`) are written to directly.
///
/// # Errors
/// [`OutputError`].
pub fn write_atomically(path: &Path, bytes: &[u8]) -> Result<(), OutputError> {
    let mut outputs = Outputs::default();
    outputs.add(path, bytes)?;
    outputs.commit().map(drop)
}

/// The outputs of one command: all are written, or none. Dropped, it changes nothing.
#[derive(Default)]
pub struct Outputs {
    /// New files with all their bytes on the disk, and streams with the bytes to come.
    all: Vec<(Output, Vec<u8>)>,
    /// Old files that no longer belong to what is written.
    removed: Vec<PathBuf>,
}

impl Outputs {
    /// Adds an output. The bytes of a file go to the disk, beside `path`.
    ///
    /// # Errors
    /// [`OutputError`].
    pub fn add(&mut self, path: &Path, bytes: &[u8]) -> Result<(), OutputError> {
        let mut output = Output::create(path)?;
        let mut to_come = bytes.to_vec();
        if output.is_file() {
            output.write(&std::mem::take(&mut to_come))?;
            output.complete()?;
        }
        self.all.push((output, to_come));
        Ok(())
    }

    /// Removes a file with the commit, if it exists.
    pub fn remove(&mut self, path: PathBuf) {
        self.removed.push(path);
    }

    /// Writes the streams, then replaces the files in the order of `add`. Only a stream can still be
    /// full, and then no file has changed. A reader that closes standard output early, as `head` does, is no error.
    /// Returns the paths of all outputs.
    ///
    /// # Errors
    /// [`OutputError`].
    pub fn commit(self) -> Result<Vec<PathBuf>, OutputError> {
        let paths = self.all.iter().map(|(output, _)| output.path().to_owned());
        let paths = paths.collect();
        let (files, streams): (Vec<_>, Vec<_>) =
            (self.all.into_iter()).partition(|(output, _)| output.is_file());
        for (mut output, bytes) in streams {
            match output.write(&bytes).and_then(|()| output.finish()) {
                Err(error) if !error.is_closed_pipe() => return Err(error),
                _ => {}
            }
        }
        for path in self.removed.iter().filter(|path| path.exists()) {
            fs::remove_file(path).map_err(|source| OutputError::from_system(path, source))?;
        }
        files.into_iter().try_for_each(|(file, _)| file.finish())?;
        Ok(paths)
    }
}

/// Makes a folder and its parents, unless it exists.
///
/// # Errors
/// [`OutputError`].
pub fn make_folder(path: &Path) -> Result<(), OutputError> {
    if path.is_file() {
        return Err(OutputError::from_system(
            path,
            ErrorKind::NotADirectory.into(),
        ));
    }
    fs::create_dir_all(path).map_err(|source| OutputError::from_system(path, source))
}

#[cfg(test)]
mod tests;
