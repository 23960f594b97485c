//! Writes output files whole or not at all.
//!
//! The bytes go to a new file in the same folder, reach the disk, and then take the place
//! of the target in one step: whoever reads the target sees the old file or the new one.
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
mod file_identity;
pub mod pose_file;
pub mod posterior_file;
pub mod record_file;
mod temporary;

pub use error::{OutputError, OutputProblem};
pub use file::Output;
pub use file_identity::{FileIdentity, is_standard, is_standard_output};

use file_identity::{is_stream, names_standard_output, resolve};
use std::fs;
use std::path::{Path, PathBuf};

/// Writes `bytes` to `path`: all of them, or nothing. An existing file is replaced and
/// keeps its permissions; a link is followed; a device or pipe is written to directly, and so is
/// standard output for `-`.
///
/// # Errors
/// [`OutputError`].
pub fn write_atomically(path: &Path, bytes: &[u8]) -> Result<(), OutputError> {
    let mut outputs = Outputs::default();
    outputs.add(path, bytes)?;
    outputs.commit().map(drop)
}

/// The outputs of one command: all are written, or none. Dropped, it leaves nothing behind.
#[derive(Default)]
pub struct Outputs {
    /// New files, with all their bytes on the disk; what cannot be replaced, with the bytes to come.
    all: Vec<(Output, Vec<u8>)>,
}

impl Outputs {
    /// Writes the bytes of `path` beside it, as [`write_atomically`] does before its last step.
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

    /// Puts everything in its place, in the order in which it was added; streams first, since only
    /// they can still be full. Where one is, nothing has been replaced. The other way round a blob
    /// would be replaced by a command that fails and whose figures are lost. A reader of standard
    /// output that closes it early, as `head` does, is no error. Gives the names of all.
    ///
    /// # Errors
    /// [`OutputError`].
    pub fn commit(self) -> Result<Vec<PathBuf>, OutputError> {
        let names = self.all.iter().map(|(output, _)| output.name().to_owned());
        let names = names.collect();
        let (files, streams): (Vec<_>, Vec<_>) =
            (self.all.into_iter()).partition(|(output, _)| output.is_file());
        for (mut output, bytes) in streams {
            match output.write(&bytes).and_then(|()| output.finish()) {
                Err(error) if !error.is_closed_pipe() => return Err(error),
                _ => {}
            }
        }
        files.into_iter().try_for_each(|(file, _)| file.finish())?;
        Ok(names)
    }
}

/// Makes a folder, with those above it, unless it is there.
///
/// # Errors
/// [`OutputError`].
pub fn make_folder(path: &Path) -> Result<(), OutputError> {
    if path.is_file() {
        let folder = path.to_path_buf();
        return Err(OutputError::new(path, OutputProblem::NotAFolder { folder }));
    }
    fs::create_dir_all(path)
        .map_err(|source| OutputError::new(path, OutputProblem::Failed { source }))
}

/// Whether `path` can be written by [`write_atomically`], without writing it: for a check before long
/// work.
///
/// # Errors
/// [`OutputError`].
pub fn check_writable(path: &Path) -> Result<(), OutputError> {
    if names_standard_output(path) {
        return Ok(());
    }
    let (target, existing) = resolve(path)?;
    if existing.is_some_and(|metadata| is_stream(path, &metadata)) {
        return Ok(());
    }
    let folder = file_identity::folder_of(&target);
    let tried = temporary::temporary(&folder);
    tried.map_or_else(
        |source| Err(OutputError::of_system(source, path, &folder, 0)),
        |_| Ok(()),
    )
}

#[cfg(test)]
mod tests;
