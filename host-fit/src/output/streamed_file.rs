//! An output that is written piece by piece, and whole or not at all.

use super::{
    OutputError, complete, explain, folder_of, is_stream, names_standard_output, persist, resolve,
    sweep, temporary,
};
use std::fs::{self, Metadata, OpenOptions};
use std::io::{Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

/// An output of any length. It takes the place of its target when it is [finished](Self::finish),
/// and is gone if it never is. A device or pipe is written to directly, and so is standard output:
/// what was written there before a fault stays.
#[derive(Debug)]
pub struct StreamedFile {
    path: PathBuf,
    target: PathBuf,
    existing: Option<Metadata>,
    sink: Sink,
    /// So far the disk was asked to begin with what was written, bytes.
    begun: u64,
}

/// So many bytes are given to the disk while the next are written: else all of them would wait for
/// the end.
#[cfg(target_os = "linux")]
const WAITING_MAX: u64 = 4 << 20;

#[derive(Debug)]
enum Sink {
    Whole(tempfile::NamedTempFile),
    Device(fs::File),
    Standard(std::io::Stdout),
}

impl StreamedFile {
    /// An empty output.
    ///
    /// # Errors
    /// Every variant of [`OutputError`] but `Full` and `Exists`.
    pub fn create(path: &Path) -> Result<Self, OutputError> {
        let named = path.to_path_buf();
        if names_standard_output(path) {
            return Ok(Self {
                target: named.clone(),
                path: named,
                existing: None,
                sink: Sink::Standard(std::io::stdout()),
                begun: 0,
            });
        }
        let (target, existing) = resolve(path)?;
        let folder = folder_of(&target);
        let sink = match existing.as_ref().is_some_and(|it| is_stream(path, it)) {
            true => OpenOptions::new().append(true).open(path).map(Sink::Device),
            false => {
                sweep(&folder);
                temporary(&folder).map(Sink::Whole)
            }
        };
        Ok(Self {
            sink: sink.map_err(|source| explain(source, path, &folder, 0))?,
            path: named,
            target,
            existing,
            begun: 0,
        })
    }

    /// Whether its start can be written again at the end: a pipe's cannot.
    pub const fn is_file(&self) -> bool {
        matches!(self.sink, Sink::Whole(_))
    }

    /// Adds bytes.
    ///
    /// # Errors
    /// `Full`, `Failed`.
    pub fn write(&mut self, bytes: &[u8]) -> Result<(), OutputError> {
        let written = match &mut self.sink {
            Sink::Whole(file) => {
                (file.write_all(bytes)).map(|()| begin(file.as_file_mut(), &mut self.begun))
            }
            Sink::Device(file) => file.write_all(bytes),
            Sink::Standard(out) => out.write_all(bytes),
        };
        written.map_err(|source| self.explain(source, bytes.len()))
    }

    /// Writes its start again, if it [is a file](Self::is_file); nothing can be added after that.
    ///
    /// # Errors
    /// `Full`, `Failed`.
    pub fn rewrite_start(&mut self, bytes: &[u8]) -> Result<(), OutputError> {
        let Sink::Whole(file) = &mut self.sink else {
            return Ok(());
        };
        let start = file.seek(SeekFrom::Start(0));
        let written = start.and_then(|_| file.write_all(bytes));
        written.map_err(|source| self.explain(source, bytes.len()))
    }

    /// Puts it in the place of its target.
    ///
    /// # Errors
    /// `Full`, `NotPermitted`, `Failed`.
    pub fn finish(self) -> Result<(), OutputError> {
        let folder = folder_of(&self.target);
        let put = match self.sink {
            Sink::Whole(file) => {
                complete(&file, self.existing).and_then(|()| persist(file, &self.target))
            }
            Sink::Device(mut file) => file.flush(),
            Sink::Standard(mut out) => out.flush(),
        };
        put.map_err(|source| explain(source, &self.path, &folder, 0))
    }

    fn explain(&self, source: std::io::Error, bytes: usize) -> OutputError {
        explain(source, &self.path, &folder_of(&self.target), bytes)
    }
}

/// Asks the disk to begin with what was written since the last time, if it is much; the end tells
/// whether it could.
#[cfg(target_os = "linux")]
fn begin(file: &mut fs::File, begun: &mut u64) {
    let end = file.stream_position().unwrap_or_default();
    if end.saturating_sub(*begun) >= WAITING_MAX {
        // So Linux takes it that these bytes are no longer wanted in memory.
        let _ = rustix::fs::fadvise(file, *begun, None, rustix::fs::Advice::DontNeed);
        *begun = end;
    }
}

#[cfg(not(target_os = "linux"))]
fn begin(_: &mut fs::File, _: &mut u64) {}
