//! One output file, written piece by piece, whole or absent; and which file a path means.

use super::error::{OutputError, OutputProblem};
use std::fs::{self, File, OpenOptions};
use std::io::{ErrorKind, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use tempfile::NamedTempFile;

/// An output while it is written.
///
/// A regular file is written beside its target and replaces it when it is [finished](Self::finish). If it never is,
/// nothing has changed. A hidden file `.host-fit-…` of a killed program can be deleted. A device, a
/// pipe and standard output are written to directly.
#[derive(Debug)]
pub struct Output {
    /// As the user named it.
    path: PathBuf,
    target: PathBuf,
    sink: Sink,
}

/// Where the bytes go.
#[derive(Debug)]
enum Sink {
    /// A new file beside the target.
    Beside(NamedTempFile),
    /// A device, a pipe, or a new file at the target from the start.
    Placed(File),
    StandardOutput,
}

impl Output {
    /// An empty output that replaces a file when it is finished.
    ///
    /// # Errors
    /// [`OutputError`].
    pub fn create(path: &Path) -> Result<Self, OutputError> {
        Self::open(path, |target| temporary(target).map(Sink::Beside))
    }

    /// An empty file, visible from now on. An existing file is refused.
    ///
    /// # Errors
    /// [`OutputError`].
    pub(super) fn create_new(path: &Path) -> Result<Self, OutputError> {
        Self::open(path, |target| File::create_new(target).map(Sink::Placed))
    }

    fn open(
        path: &Path,
        create: impl FnOnce(&Path) -> std::io::Result<Sink>,
    ) -> Result<Self, OutputError> {
        let (target, sink) = if is_standard_output(path) {
            (path.to_owned(), Ok(Sink::StandardOutput))
        } else if is_stream(path) {
            let device = OpenOptions::new().append(true).open(path);
            (path.to_owned(), device.map(Sink::Placed))
        } else {
            let target = target(path)?;
            let sink = create(&target);
            (target, sink)
        };
        Ok(Self {
            sink: sink.map_err(|source| OutputError::from_system(path, source))?,
            path: path.to_owned(),
            target,
        })
    }

    /// The path as the user named it.
    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// Whether it replaces a file when it is finished, so that its start can still be rewritten.
    pub const fn is_file(&self) -> bool {
        matches!(self.sink, Sink::Beside(_))
    }

    /// Adds bytes.
    ///
    /// # Errors
    /// [`OutputError`].
    pub fn write(&mut self, bytes: &[u8]) -> Result<(), OutputError> {
        let written = match &mut self.sink {
            Sink::Beside(file) => file.write_all(bytes),
            Sink::Placed(file) => file.write_all(bytes),
            Sink::StandardOutput => std::io::stdout().write_all(bytes),
        };
        written.map_err(|source| self.failed(source))
    }

    /// Leaves whole lines alone in a new file at the target that holds `whole` bytes of them and a part of `lines`, and
    /// returns their bytes; a device keeps what it has.
    pub(super) fn cut_to_lines(&self, mut whole: u64, lines: &[u8]) -> u64 {
        if let Sink::Placed(file) = &self.sink
            && let Ok(found) = file.metadata()
        {
            let part = (found.len().saturating_sub(whole) as usize).min(lines.len());
            let kept = lines[..part].iter().rposition(|byte| *byte == b'\n');
            whole += kept.map_or(0, |last| last as u64 + 1);
            let _ = file.set_len(whole);
        }
        whole
    }

    /// Rewrites the first bytes of a [file](Self::is_file). These must be its last bytes.
    ///
    /// # Errors
    /// [`OutputError`].
    pub fn rewrite_start(&mut self, bytes: &[u8]) -> Result<(), OutputError> {
        let Sink::Beside(file) = &mut self.sink else {
            return Ok(());
        };
        let start = file.seek(SeekFrom::Start(0));
        let written = start.and_then(|_| file.write_all(bytes));
        written.map_err(|source| self.failed(source))
    }

    /// Waits until all bytes are on the disk, or with the reader of a stream. A replacement gets the permissions
    /// of the old file.
    ///
    /// # Errors
    /// [`OutputError`].
    pub(super) fn complete(&mut self) -> Result<(), OutputError> {
        let done = match &mut self.sink {
            Sink::Beside(file) => {
                let file = file.as_file();
                let old = fs::metadata(&self.target).map(|metadata| metadata.permissions());
                let set = old.map_or(Ok(()), |permissions| file.set_permissions(permissions));
                set.and_then(|()| file.sync_all())
            }
            // A pipe has no disk.
            Sink::Placed(file) => file.sync_all().or_else(|error| match error.kind() {
                ErrorKind::InvalidInput => Ok(()),
                _ => Err(error),
            }),
            Sink::StandardOutput => std::io::stdout().flush(),
        };
        done.map_err(|source| self.failed(source))
    }

    /// Replaces the target.
    ///
    /// # Errors
    /// [`OutputError`].
    pub fn finish(mut self) -> Result<(), OutputError> {
        self.complete()?;
        if let Sink::Beside(file) = self.sink {
            let put = file.persist(&self.target);
            put.map_err(|failed| OutputError::from_system(&self.path, failed.error))?;
            // The new name reaches the disk with its folder. Some file systems refuse; the bytes are safe already.
            #[cfg(unix)]
            let _ = File::open(folder(&self.target)).and_then(|folder| folder.sync_all());
        }
        Ok(())
    }

    fn failed(&self, source: std::io::Error) -> OutputError {
        OutputError::from_system(&self.path, source)
    }
}

/// Checks that an output can be created, and creates nothing: for use before long work.
///
/// # Errors
/// [`OutputError`].
pub fn check_writable(path: &Path) -> Result<(), OutputError> {
    if is_stream(path) {
        return Ok(());
    }
    let tried = temporary(&target(path)?);
    tried.map_or_else(|e| Err(OutputError::from_system(path, e)), |_| Ok(()))
}

/// Refuses an output that is an input or another output of the same command. Paths are compared in canonical form.
///
/// # Errors
/// [`OutputProblem::IsInput`] and [`OutputProblem::IsOutput`].
pub fn keep_apart<'p>(
    outputs: impl IntoIterator<Item = &'p Path>,
    inputs: impl IntoIterator<Item = &'p Path>,
) -> Result<(), OutputError> {
    let stdin = |path| {
        if is_standard(path) {
            Path::new("/dev/stdin")
        } else {
            path
        }
    };
    let inputs = inputs.into_iter().map(|path| canonical(stdin(path)));
    // A terminal can be both.
    let inputs: Vec<PathBuf> = inputs.filter(|path| path.is_file()).collect();
    let mut taken = Vec::new();
    for output in outputs {
        let file = canonical(output);
        let problem = if inputs.contains(&file) {
            OutputProblem::IsInput
        } else if taken.contains(&file) {
            OutputProblem::IsOutput
        } else {
            taken.push(file);
            continue;
        };
        return Err(OutputError::new(output, problem));
    }
    Ok(())
}

/// The canonical form of a path, also where the file does not exist yet. Two paths to one file have the same form.
fn canonical(path: &Path) -> PathBuf {
    let path = match is_standard_output(path) {
        true => Path::new("/dev/stdout"),
        false => path,
    };
    let new = || Some(folder(path).canonicalize().ok()?.join(path.file_name()?));
    let there = path.canonicalize().ok().or_else(new);
    there.unwrap_or_else(|| path.to_owned())
}

/// Whether a path is `-`: standard input of a command, or its standard output.
pub fn is_standard(path: &Path) -> bool {
    path.as_os_str() == "-"
}

/// Whether an output path is one of the names of standard output. It is not opened anew, because opening a pipe
/// that nobody reads waits forever.
pub fn is_standard_output(path: &Path) -> bool {
    let names = ["-", "/dev/stdout", "/dev/fd/1", "/proc/self/fd/1"];
    names.into_iter().any(|name| path.as_os_str() == name)
}

/// Whether a path is written to and not replaced: a device, a pipe, or a standard stream that a shell may have
/// redirected to a file.
pub(super) fn is_stream(path: &Path) -> bool {
    let names = ["/dev/stdout", "/dev/stderr", "/dev/fd", "/proc/self/fd"];
    let is_special = || fs::metadata(path).is_ok_and(|it| !it.is_file() && !it.is_dir());
    is_standard(path) || names.iter().any(|name| path.starts_with(name)) || is_special()
}

/// The file that an output replaces. Of a link it is the linked file, so that the link stays.
fn target(path: &Path) -> Result<PathBuf, OutputError> {
    if path.as_os_str().is_empty() {
        return Err(OutputError::new(path, OutputProblem::NoName));
    }
    let kind = match fs::metadata(path) {
        Ok(metadata) if metadata.is_dir() => ErrorKind::IsADirectory,
        Ok(metadata) if metadata.permissions().readonly() => ErrorKind::PermissionDenied,
        Ok(_) => return Ok(path.canonicalize().unwrap_or_else(|_| path.to_owned())),
        // `out/` asks for a folder.
        Err(_) if path.as_os_str().as_encoded_bytes().ends_with(b"/") => ErrorKind::IsADirectory,
        Err(_) => return Ok(path.to_owned()),
    };
    Err(OutputError::from_system(path, kind.into()))
}

/// A new file in the folder of `target`, with the permissions of any new file.
fn temporary(target: &Path) -> std::io::Result<NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(".host-fit-");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        // Less the user's umask.
        builder.permissions(fs::Permissions::from_mode(0o666));
    }
    builder.tempfile_in(folder(target))
}

/// The folder of a file.
fn folder(target: &Path) -> &Path {
    match target.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}
