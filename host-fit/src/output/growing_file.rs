//! An output that is written line by line, and whole or not at all.

use super::{
    OutputError, complete, explain, folder_of, is_standard, is_stream, persist, resolve, temporary,
};
use std::fs::{self, Metadata, OpenOptions};
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

/// An output that grows as long as a run takes. It takes the place of its target when it is
/// [finished](Self::finish), and is gone if it never is. A device or pipe is written to directly,
/// and so is standard output for `-`.
#[derive(Debug)]
pub struct GrowingFile {
    path: PathBuf,
    target: PathBuf,
    existing: Option<Metadata>,
    file: BufWriter<Sink>,
}

#[derive(Debug)]
enum Sink {
    Whole(tempfile::NamedTempFile),
    Stream(fs::File),
}

impl Write for Sink {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        match self {
            Self::Whole(file) => file.write(bytes),
            Self::Stream(file) => file.write(bytes),
        }
    }

    fn flush(&mut self) -> std::io::Result<()> {
        match self {
            Self::Whole(file) => file.flush(),
            Self::Stream(file) => file.flush(),
        }
    }
}

impl GrowingFile {
    /// An empty output.
    ///
    /// # Errors
    /// Every variant of [`OutputError`] but `Full`.
    pub fn create(path: &Path) -> Result<Self, OutputError> {
        let path = if is_standard(path) {
            Path::new("/dev/stdout")
        } else {
            path
        };
        let (target, existing) = resolve(path)?;
        let folder = folder_of(&target);
        let is_stream = existing.as_ref().is_some_and(|it| is_stream(path, it));
        let sink = if is_stream {
            OpenOptions::new().append(true).open(path).map(Sink::Stream)
        } else {
            temporary(&folder).map(Sink::Whole)
        };
        let sink = sink.map_err(|source| explain(source, path, &folder, 0))?;
        Ok(Self {
            path: path.to_path_buf(),
            target,
            existing,
            file: BufWriter::new(sink),
        })
    }

    /// Writes a line.
    ///
    /// # Errors
    /// `Full`, `Failed`.
    pub fn line(&mut self, text: impl std::fmt::Display) -> Result<(), OutputError> {
        writeln!(self.file, "{text}")
            .map_err(|source| explain(source, &self.path, &folder_of(&self.target), 0))
    }

    /// Puts it in the place of its target.
    ///
    /// # Errors
    /// `Full`, `NotPermitted`, `Failed`.
    pub fn finish(self) -> Result<(), OutputError> {
        let folder = folder_of(&self.target);
        let sink = self.file.into_inner().map_err(|error| error.into_error());
        let put = |sink| match sink {
            Sink::Whole(file) => {
                complete(&file, self.existing)?;
                persist(file, &self.target)
            }
            Sink::Stream(mut file) => file.flush(),
        };
        sink.and_then(put)
            .map_err(|source| explain(source, &self.path, &folder, 0))
    }
}
