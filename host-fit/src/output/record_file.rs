//! A record: what came is in the file, whatever ends the run.

use super::{OutputError, end_of_links, explain, folder_of, is_standard, is_stream, resolve};
use std::fs::{File, OpenOptions};
use std::io::{Seek, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// The longest time for which a line stays in memory: what is lost with the program.
const UNWRITTEN_MAX: Duration = Duration::from_secs(1);
/// Bytes in memory from which they are written.
const UNWRITTEN_BYTES: usize = 64 * 1024;

/// A file that gains lines as they come. Lines go to it whole, a second after they came at the
/// latest. An earlier record is never replaced. A device or pipe is written to directly, and so is
/// standard output for `-`.
#[derive(Debug)]
pub struct RecordFile {
    path: PathBuf,
    file: File,
    /// Whether there is a file that can be cut and removed.
    is_file: bool,
    /// Lines that are not in the file yet.
    unwritten: Vec<u8>,
    since: Instant,
    /// Bytes of the lines in the file.
    written: u64,
}

impl RecordFile {
    /// An empty record.
    ///
    /// # Errors
    /// [`OutputError::Exists`] for a file that is there, and those of a place that cannot be written.
    pub fn create(path: &Path) -> Result<Self, OutputError> {
        let path = if is_standard(path) {
            Path::new("/dev/stdout")
        } else {
            path
        };
        let (target, existing) = resolve(path)?;
        let is_stream = existing.as_ref().is_some_and(|it| is_stream(path, it));
        if existing.is_some() && !is_stream {
            return Err(OutputError::Exists {
                path: path.to_path_buf(),
            });
        }
        let mut options = OpenOptions::new();
        let file = if is_stream {
            options.append(true).open(path)
        } else {
            options.write(true).create_new(true).open(&target)
        };
        Ok(Self {
            file: file.map_err(|source| explain(source, path, &folder_of(&target), 0))?,
            path: path.to_path_buf(),
            is_file: !is_stream,
            unwritten: Vec::with_capacity(UNWRITTEN_BYTES),
            since: Instant::now(),
            written: 0,
        })
    }

    /// Adds a line.
    ///
    /// # Errors
    /// As [`flush`](Self::flush).
    pub fn line(&mut self, text: impl std::fmt::Display) -> Result<(), OutputError> {
        if self.unwritten.is_empty() {
            self.since = Instant::now();
        }
        // Memory is never full.
        let _ = writeln!(self.unwritten, "{text}");
        if self.unwritten.len() >= UNWRITTEN_BYTES {
            self.flush()?;
        }
        Ok(())
    }

    /// Writes lines that have waited long enough: to be called several times a second.
    ///
    /// # Errors
    /// As [`flush`](Self::flush).
    pub fn keep_up(&mut self) -> Result<(), OutputError> {
        if self.since.elapsed() >= UNWRITTEN_MAX {
            self.flush()?;
        }
        Ok(())
    }

    /// Writes all lines that have come.
    ///
    /// # Errors
    /// `Full`, `Failed`: then the file ends with the last line that is whole, and those not written
    /// are gone.
    pub fn flush(&mut self) -> Result<(), OutputError> {
        let bytes = self.unwritten.len();
        let written = self.file.write_all(&self.unwritten);
        if written.is_err() && self.is_file {
            // What cannot be cut off is a line that no reader takes.
            let _ = self.file.set_len(self.written);
            let _ = self.file.seek(std::io::SeekFrom::Start(self.written));
        } else {
            self.written += bytes as u64;
        }
        self.unwritten.clear();
        written.map_err(|source| explain(source, &self.path, &folder_of(&self.path), bytes))
    }

    /// Writes all lines, and waits until they are on the disk.
    ///
    /// # Errors
    /// As [`flush`](Self::flush).
    pub fn finish(&mut self) -> Result<(), OutputError> {
        self.flush()?;
        if !self.is_file {
            return Ok(());
        }
        let synced = self.file.sync_all();
        synced.map_err(|source| explain(source, &self.path, &folder_of(&self.path), 0))
    }

    /// Removes the file.
    pub fn discard(self) {
        if self.is_file {
            let _ = std::fs::remove_file(end_of_links(&self.path));
        }
    }
}
