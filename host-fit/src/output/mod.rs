//! Writes output files whole or not at all.
//!
//! The bytes go to a new file in the same folder, reach the disk, and then take the place
//! of the target in one step: whoever reads the target sees the old file or the new one.

pub mod blob_file;
pub mod export;
mod place;
pub mod pose_file;
pub mod posterior_file;
pub mod record_file;
pub mod streamed_file;
mod temporary;

pub use place::{Place, is_standard_output};

use place::{end_of_links, names_standard_output};
use temporary::{sweep, temporary};

use std::fs::{self, Metadata, OpenOptions};
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};

/// Why an output was not written. The target is as it was before.
#[derive(Debug, thiserror::Error)]
pub enum OutputError {
    /// No file name was given.
    #[error("the name of the output is empty; name a file")]
    NoName,
    /// The target is a folder.
    #[error("{}: is a folder; name a file in it", path.display())]
    IsFolder {
        /// The target.
        path: PathBuf,
    },
    /// The folder of the target does not exist.
    #[error("{}: the folder {} does not exist; create it or name another", path.display(), folder.display())]
    NoFolder {
        /// The target.
        path: PathBuf,
        /// Its folder.
        folder: PathBuf,
    },
    /// What should be the folder of the target is a file.
    #[error("{}: {} is a file, not a folder; name another folder", path.display(), folder.display())]
    NotAFolder {
        /// The target.
        path: PathBuf,
        /// What should be its folder.
        folder: PathBuf,
    },
    /// A record is there, which is not replaced.
    #[error("{}: is there already, and a record is never replaced; name another file, or move it away", path.display())]
    Exists {
        /// The target.
        path: PathBuf,
    },
    /// The target exists and must not be written.
    #[error("{}: the file is read-only; make it writable or name another", path.display())]
    ReadOnly {
        /// The target.
        path: PathBuf,
    },
    /// The folder must not be written.
    #[error("{}: no permission to write into {}: {source}; change its permissions or name another folder", path.display(), folder.display())]
    NotPermitted {
        /// The target.
        path: PathBuf,
        /// Its folder.
        folder: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// No room is left.
    #[error("{}: no room for {bytes} bytes: {source}; free some space or name another folder", path.display())]
    Full {
        /// The target.
        path: PathBuf,
        /// How many bytes were to be written.
        bytes: usize,
        /// What the system says.
        source: std::io::Error,
    },
    /// Anything else that the system says.
    #[error("{}: cannot be written: {source}; name another file", path.display())]
    Failed {
        /// The target.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
}

/// Writes `bytes` to `path`: all of them, or nothing. An existing file is replaced and
/// keeps its permissions; a link is followed; a device or pipe is written to directly, and so is
/// standard output for `-`.
///
/// # Errors
/// Every variant of [`OutputError`].
pub fn write_atomically(path: &Path, bytes: &[u8]) -> Result<(), OutputError> {
    let mut outputs = Outputs::default();
    outputs.add(path, bytes)?;
    outputs.commit()
}

/// The outputs of one command: all are written, or none. Dropped, it leaves nothing behind.
#[derive(Default)]
pub struct Outputs {
    staged: Vec<Staged>,
}

/// An output on its way.
enum Staged {
    /// What cannot be replaced, as the user named it, and its bytes.
    Stream(PathBuf, Vec<u8>),
    /// A new file beside its target, with all bytes on the disk.
    File {
        named: PathBuf,
        target: PathBuf,
        file: tempfile::NamedTempFile,
    },
}

impl Outputs {
    /// Writes the bytes of `path` beside it, as [`write_atomically`] does before its last step.
    ///
    /// # Errors
    /// Every variant of [`OutputError`].
    pub fn add(&mut self, path: &Path, bytes: &[u8]) -> Result<(), OutputError> {
        let named = path.to_path_buf();
        if names_standard_output(path) {
            self.staged.push(Staged::Stream(named, bytes.to_vec()));
            return Ok(());
        }
        let (target, existing) = resolve(path)?;
        if existing
            .as_ref()
            .is_some_and(|metadata| is_stream(path, metadata))
        {
            self.staged.push(Staged::Stream(named, bytes.to_vec()));
            return Ok(());
        }
        let folder = folder_of(&target);
        let file = written(&folder, bytes, existing)
            .map_err(|source| explain(source, path, &folder, bytes.len()))?;
        self.staged.push(Staged::File {
            named,
            target,
            file,
        });
        Ok(())
    }

    /// Puts everything in its place, in the order in which it was added; streams first, since only
    /// they can still be full. Where one is, nothing has been replaced. The other way round a blob
    /// would be replaced by a command that fails and whose figures are lost; this way a command that
    /// fails may have told figures of files that are not there, and its exit status says so.
    ///
    /// # Errors
    /// Every variant of [`OutputError`].
    pub fn commit(self) -> Result<(), OutputError> {
        for staged in &self.staged {
            match staged {
                Staged::Stream(path, bytes) if names_standard_output(path) => {
                    write_standard(path, bytes)?;
                }
                Staged::Stream(path, bytes) => write_through(path, bytes)
                    .map_err(|source| explain(source, path, &folder_of(path), bytes.len()))?,
                Staged::File { .. } => {}
            }
        }
        for staged in self.staged {
            if let Staged::File {
                named,
                target,
                file,
            } = staged
            {
                persist(file, &target)
                    .map_err(|source| explain(source, &named, &folder_of(&target), 0))?;
            }
        }
        Ok(())
    }
}

/// Whether a name means standard output, or standard input: `-`.
pub fn is_standard(path: &Path) -> bool {
    path.as_os_str() == "-"
}

/// A reader that closes the pipe early, as `head` does, is no error.
fn write_standard(path: &Path, bytes: &[u8]) -> Result<(), OutputError> {
    let mut out = std::io::stdout().lock();
    match out.write_all(bytes).and_then(|()| out.flush()) {
        Err(source) if source.kind() != ErrorKind::BrokenPipe => {
            Err(explain(source, path, Path::new("-"), bytes.len()))
        }
        _ => Ok(()),
    }
}

/// Makes a folder, with those above it, unless it is there.
///
/// # Errors
/// [`OutputError::NotAFolder`], [`OutputError::Failed`].
pub fn make_folder(path: &Path) -> Result<(), OutputError> {
    if path.is_file() {
        return Err(OutputError::NotAFolder {
            path: path.to_path_buf(),
            folder: path.to_path_buf(),
        });
    }
    fs::create_dir_all(path).map_err(|source| OutputError::Failed {
        path: path.to_path_buf(),
        source,
    })
}

/// Whether `path` can be written by [`write_atomically`], as far as can be told without
/// writing: for a check before long work.
///
/// # Errors
/// Every variant of [`OutputError`] but `Full`.
pub fn check_writable(path: &Path) -> Result<(), OutputError> {
    if names_standard_output(path) {
        return Ok(());
    }
    let (target, existing) = resolve(path)?;
    if existing.is_some_and(|metadata| is_stream(path, &metadata)) {
        return Ok(());
    }
    let folder = folder_of(&target);
    match temporary(&folder) {
        Ok(_) => Ok(()),
        Err(source) => Err(explain(source, path, &folder, 0)),
    }
}

/// The file that `path` leads to, and what is there now.
fn resolve(path: &Path) -> Result<(PathBuf, Option<Metadata>), OutputError> {
    if path.as_os_str().is_empty() {
        return Err(OutputError::NoName);
    }
    let named = || path.to_path_buf();
    match fs::metadata(path) {
        Ok(metadata) if metadata.is_dir() => Err(OutputError::IsFolder { path: named() }),
        Ok(metadata) if metadata.is_file() && metadata.permissions().readonly() => {
            Err(OutputError::ReadOnly { path: named() })
        }
        // A link keeps its place: what it leads to is replaced.
        Ok(metadata) => {
            let target = fs::canonicalize(path).unwrap_or_else(|_| named());
            Ok((target, Some(metadata)))
        }
        Err(_) if path.file_name().is_none() || ends_in_separator(path) => {
            Err(OutputError::IsFolder { path: named() })
        }
        Err(source) => match end_of_links(path) {
            // Links in a circle.
            end if end.is_symlink() => Err(OutputError::Failed {
                path: named(),
                source,
            }),
            end => Ok((end, None)),
        },
    }
}

/// Whether `path` is something to write to, not to replace: a device, a pipe, or the
/// standard streams under their names in the file system, which a shell may have led to files.
fn is_stream(path: &Path, metadata: &Metadata) -> bool {
    let names = ["/dev/stdout", "/dev/stderr", "/dev/fd", "/proc/self/fd"];
    let named_stream = cfg!(unix) && names.iter().any(|name| path.starts_with(name));
    named_stream || !metadata.is_file()
}

/// Whether the name asks for a folder, as `out/` does.
fn ends_in_separator(path: &Path) -> bool {
    let last = path.as_os_str().as_encoded_bytes().last();
    last.is_some_and(|last| std::path::is_separator(char::from(*last)))
}

fn folder_of(target: &Path) -> PathBuf {
    match target.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder.to_path_buf(),
        _ => PathBuf::from("."),
    }
}

/// A new file in `folder` with these bytes, on the disk.
fn written(
    folder: &Path,
    bytes: &[u8],
    existing: Option<Metadata>,
) -> std::io::Result<tempfile::NamedTempFile> {
    sweep(folder);
    let mut file = temporary(folder)?;
    file.as_file_mut().write_all(bytes)?;
    complete(&file, existing)?;
    Ok(file)
}

/// Gives a file the permissions of the one that it replaces, and waits until it is on the disk.
fn complete(file: &tempfile::NamedTempFile, existing: Option<Metadata>) -> std::io::Result<()> {
    if let Some(metadata) = existing {
        file.as_file().set_permissions(metadata.permissions())?;
    }
    file.as_file().sync_all()
}

/// Puts a new file in the place of `target`.
fn persist(file: tempfile::NamedTempFile, target: &Path) -> std::io::Result<()> {
    file.persist(target).map_err(|error| error.error)?;
    // The name is on the disk too once its folder is. Not every file system can do it, and
    // the file itself is safe already.
    #[cfg(unix)]
    let _ = fs::File::open(folder_of(target)).and_then(|folder| folder.sync_all());
    Ok(())
}

/// Writes to what cannot be replaced, after what is there.
fn write_through(target: &Path, bytes: &[u8]) -> std::io::Result<()> {
    let mut device = OpenOptions::new().append(true).open(target)?;
    device.write_all(bytes)?;
    device.flush()
}

/// The system's error in the user's terms.
fn explain(source: std::io::Error, path: &Path, folder: &Path, bytes: usize) -> OutputError {
    let path = path.to_path_buf();
    let folder = folder.to_path_buf();
    // What is not the system's own has the name of the temporary file in it.
    let source = match source.raw_os_error() {
        Some(_) => source,
        None => source.kind().into(),
    };
    match source.kind() {
        ErrorKind::NotFound => OutputError::NoFolder { path, folder },
        ErrorKind::NotADirectory => OutputError::NotAFolder { path, folder },
        ErrorKind::PermissionDenied | ErrorKind::ReadOnlyFilesystem => OutputError::NotPermitted {
            path,
            folder,
            source,
        },
        ErrorKind::StorageFull | ErrorKind::QuotaExceeded | ErrorKind::FileTooLarge => {
            OutputError::Full {
                path,
                bytes,
                source,
            }
        }
        _ => OutputError::Failed { path, source },
    }
}

#[cfg(test)]
mod tests;
