//! A record of a bus: the file holds what has come, however the run ends.

use super::file::is_stream;
use super::{Output, OutputError};
use std::io::Write;
use std::path::Path;
use std::time::{Duration, Instant};

/// The longest time that a line stays in memory, where a killed program loses it.
const UNWRITTEN_MAX: Duration = Duration::from_secs(1);
/// Bytes in memory that are written at once.
const UNWRITTEN_BYTES: usize = 64 * 1024;

/// A file that gains lines, each within a second. An existing file is never replaced. A device, a pipe and
/// standard output (`-`) are written to directly. Where a write fails, the file keeps the lines before.
#[derive(Debug)]
pub struct RecordFile {
    output: Output,
    /// Lines that are not yet in the file.
    unwritten: Vec<u8>,
    since: Instant,
    /// Bytes of whole lines in the file.
    whole: u64,
}

impl RecordFile {
    /// An empty record.
    ///
    /// # Errors
    /// [`OutputError`], also for a file that exists.
    pub fn create(path: &Path) -> Result<Self, OutputError> {
        Ok(Self {
            output: Output::create_new(path)?,
            unwritten: Vec::with_capacity(UNWRITTEN_BYTES),
            since: Instant::now(),
            whole: 0,
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
        // Memory does not fail.
        let _ = writeln!(self.unwritten, "{text}");
        match self.unwritten.len() >= UNWRITTEN_BYTES {
            true => self.flush(),
            false => Ok(()),
        }
    }

    /// Writes lines that have waited long enough. Call it several times a second.
    ///
    /// # Errors
    /// As [`flush`](Self::flush).
    pub fn keep_up(&mut self) -> Result<(), OutputError> {
        match self.since.elapsed() >= UNWRITTEN_MAX {
            true => self.flush(),
            false => Ok(()),
        }
    }

    /// Writes all lines.
    ///
    /// # Errors
    /// [`OutputError`]; write no more lines then.
    pub fn flush(&mut self) -> Result<(), OutputError> {
        let written = self.output.write(&self.unwritten);
        match written {
            Ok(()) => self.whole += self.unwritten.len() as u64,
            Err(_) => self.whole = self.output.cut_to_lines(self.whole, &self.unwritten),
        }
        self.unwritten.clear();
        written
    }

    /// Writes all lines, and waits until they are on the disk.
    ///
    /// # Errors
    /// As [`flush`](Self::flush).
    pub fn finish(&mut self) -> Result<(), OutputError> {
        self.flush()?;
        self.output.complete()
    }

    /// Removes the file.
    pub fn discard(self) {
        if !is_stream(self.output.path()) {
            let _ = std::fs::remove_file(self.output.path());
        }
    }
}
