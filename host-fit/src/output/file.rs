//! An output of any length, written piece by piece.

use super::error::{OutputError, OutputProblem};
use super::file_identity::{folder_of, is_stream, names_standard_output, resolve};
use super::temporary::{sweep, temporary};
use std::fs::{self, File, Metadata, OpenOptions};
use std::io::{Seek, SeekFrom, Stdout, Write};
use std::path::{Path, PathBuf};
use tempfile::NamedTempFile;

/// An output on its way. A device or pipe is written to directly, and so is standard output: what was
/// written there before a fault stays.
#[derive(Debug)]
pub struct Output {
    path: PathBuf,
    target: PathBuf,
    existing: Option<Metadata>,
    sink: Sink,
    /// So far the disk was asked to begin with what was written, bytes.
    begun: u64,
}

/// Where bytes go.
#[derive(Debug)]
enum Sink {
    /// A new file beside its target, whose place it takes at the end.
    Beside(NamedTempFile),
    /// A new file in its place from the start.
    Placed(File),
    Device(File),
    Standard(Stdout),
}

impl Output {
    /// An empty output. It takes the place of its target when it is [finished](Self::finish), and is
    /// gone if it never is.
    ///
    /// # Errors
    /// [`OutputError`].
    pub fn create(path: &Path) -> Result<Self, OutputError> {
        Self::open(path, |_, target| {
            let folder = folder_of(target);
            sweep(&folder);
            let file = temporary(&folder).map(Sink::Beside);
            file.map_err(|source| OutputError::of_system(source, path, &folder, 0))
        })
    }

    /// An empty file, in its place from now on; one that is there is never replaced.
    ///
    /// # Errors
    /// [`OutputError`], for a file that is there too.
    pub(super) fn create_new(path: &Path) -> Result<Self, OutputError> {
        Self::open(path, |existing, target| {
            if existing.is_some() {
                return Err(OutputError::new(path, OutputProblem::Exists));
            }
            let file = File::create_new(target).map(Sink::Placed);
            file.map_err(|source| OutputError::of_system(source, path, &folder_of(target), 0))
        })
    }

    fn open(
        path: &Path,
        file: impl FnOnce(Option<&Metadata>, &Path) -> Result<Sink, OutputError>,
    ) -> Result<Self, OutputError> {
        let (target, existing, sink);
        if names_standard_output(path) {
            (target, existing) = (path.to_path_buf(), None);
            sink = Sink::Standard(std::io::stdout());
        } else {
            (target, existing) = resolve(path)?;
            sink = match existing.as_ref().is_some_and(|it| is_stream(path, it)) {
                true => {
                    let device = OpenOptions::new().append(true).open(path);
                    let refused =
                        |source| OutputError::of_system(source, path, &folder_of(&target), 0);
                    Sink::Device(device.map_err(refused)?)
                }
                false => file(existing.as_ref(), &target)?,
            };
        }
        Ok(Self {
            path: path.to_path_buf(),
            target,
            existing,
            sink,
            begun: 0,
        })
    }

    /// How the user named it.
    pub(super) fn name(&self) -> &Path {
        &self.path
    }

    /// Whether its start can be written again at the end: a pipe's cannot.
    pub const fn is_file(&self) -> bool {
        matches!(self.sink, Sink::Beside(_))
    }

    /// Adds bytes.
    ///
    /// # Errors
    /// [`OutputError`].
    pub fn write(&mut self, bytes: &[u8]) -> Result<(), OutputError> {
        let written = match &mut self.sink {
            Sink::Beside(file) => {
                (file.write_all(bytes)).map(|()| begin(file.as_file_mut(), &mut self.begun))
            }
            Sink::Placed(file) | Sink::Device(file) => file.write_all(bytes),
            Sink::Standard(out) => out.write_all(bytes),
        };
        written.map_err(|source| self.failed(source, bytes.len()))
    }

    /// Writes its start again, if it [is a file](Self::is_file); nothing can be added after that.
    ///
    /// # Errors
    /// [`OutputError`].
    pub fn rewrite_start(&mut self, bytes: &[u8]) -> Result<(), OutputError> {
        let Sink::Beside(file) = &mut self.sink else {
            return Ok(());
        };
        let start = file.seek(SeekFrom::Start(0));
        let written = start.and_then(|_| file.write_all(bytes));
        written.map_err(|source| self.failed(source, bytes.len()))
    }

    /// Gives it the permissions of the file that it replaces, and waits until all bytes are on the
    /// disk, or with the reader of a stream.
    ///
    /// # Errors
    /// [`OutputError`].
    pub(super) fn complete(&mut self) -> Result<(), OutputError> {
        let done = match &mut self.sink {
            Sink::Beside(file) => {
                let permissions = self.existing.as_ref().map(Metadata::permissions);
                let set = permissions.map_or(Ok(()), |it| file.as_file().set_permissions(it));
                set.and_then(|()| file.as_file().sync_all())
            }
            Sink::Placed(file) => file.sync_all(),
            Sink::Device(file) => file.flush(),
            Sink::Standard(out) => out.flush(),
        };
        done.map_err(|source| self.failed(source, 0))
    }

    /// Puts it in the place of its target.
    ///
    /// # Errors
    /// [`OutputError`].
    pub fn finish(mut self) -> Result<(), OutputError> {
        self.complete()?;
        let folder = folder_of(&self.target);
        if let Sink::Beside(file) = self.sink {
            let put = file.persist(&self.target).map_err(|error| error.error);
            put.map_err(|source| OutputError::of_system(source, &self.path, &folder, 0))?;
            // The name is on the disk too once its folder is. Not every file system can do it, and
            // the file itself is safe already.
            #[cfg(unix)]
            let _ = File::open(folder).and_then(|folder| folder.sync_all());
        }
        Ok(())
    }

    /// Cuts a file that is in its place to the last line end after `kept` bytes, no further than
    /// `bytes`, which were to follow: how many of those stay.
    pub(super) fn cut_to_whole_lines(&mut self, kept: u64, bytes: &[u8]) -> u64 {
        let Sink::Placed(file) = &mut self.sink else {
            return 0;
        };
        let length = file.metadata().map_or(0, |metadata| metadata.len());
        let room = usize::try_from(length.saturating_sub(kept)).unwrap_or(0);
        let fits = bytes.get(..room).unwrap_or_default();
        let whole = fits.iter().rposition(|byte| *byte == b'\n');
        let stay = whole.map_or(0, |end| end as u64 + 1);
        let _ = file.set_len(kept + stay);
        stay
    }

    /// Removes a file that is in its place.
    pub(super) fn discard(self) {
        if let Sink::Placed(_) = self.sink {
            let _ = fs::remove_file(&self.target);
        }
    }

    fn failed(&self, source: std::io::Error, bytes: usize) -> OutputError {
        OutputError::of_system(source, &self.path, &folder_of(&self.target), bytes)
    }
}

/// Asks the disk to begin with what was written since the last time, if it is much: else all of it would
/// wait for the end. The end tells whether it could.
#[cfg(target_os = "linux")]
fn begin(file: &mut File, begun: &mut u64) {
    const WAITING_MAX: u64 = 4 << 20;
    let end = file.stream_position().unwrap_or_default();
    if end.saturating_sub(*begun) >= WAITING_MAX {
        // So Linux takes it that these bytes are no longer wanted in memory.
        let _ = rustix::fs::fadvise(file, *begun, None, rustix::fs::Advice::DontNeed);
        *begun = end;
    }
}

#[cfg(not(target_os = "linux"))]
fn begin(_: &mut File, _: &mut u64) {}
