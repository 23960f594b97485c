//! A record: what came is in the file, whatever ends the run.

use super::{Output, OutputError};
use std::io::Write;
use std::path::Path;
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
    output: Output,
    /// Lines that are not in the file yet.
    unwritten: Vec<u8>,
    since: Instant,
    /// Bytes of the lines in the file.
    written: u64,
    /// Whether a line is lost, so that none may follow.
    has_ended: bool,
}

impl RecordFile {
    /// An empty record.
    ///
    /// # Errors
    /// [`OutputError`], for a file that is there too.
    pub fn create(path: &Path) -> Result<Self, OutputError> {
        Ok(Self {
            output: Output::create_new(path)?,
            unwritten: Vec::with_capacity(UNWRITTEN_BYTES),
            since: Instant::now(),
            written: 0,
            has_ended: false,
        })
    }

    /// Adds a line, unless one before it is lost.
    ///
    /// # Errors
    /// As [`flush`](Self::flush).
    pub fn line(&mut self, text: impl std::fmt::Display) -> Result<(), OutputError> {
        if self.has_ended {
            return Ok(());
        }
        if self.unwritten.is_empty() {
            self.since = Instant::now();
        }
        // Into memory, which does not fail.
        let _ = writeln!(self.unwritten, "{text}");
        match self.unwritten.len() >= UNWRITTEN_BYTES {
            true => self.flush(),
            false => Ok(()),
        }
    }

    /// Writes lines that have waited long enough: to be called several times a second.
    ///
    /// # Errors
    /// As [`flush`](Self::flush).
    pub fn keep_up(&mut self) -> Result<(), OutputError> {
        match self.since.elapsed() >= UNWRITTEN_MAX {
            true => self.flush(),
            false => Ok(()),
        }
    }

    /// Writes all lines that have come.
    ///
    /// # Errors
    /// Then the file ends with the last line that is whole, those not written are gone, and so are all
    /// that follow.
    pub fn flush(&mut self) -> Result<(), OutputError> {
        let bytes = std::mem::take(&mut self.unwritten);
        let written = self.output.write(&bytes);
        self.written += match &written {
            Ok(()) => bytes.len() as u64,
            Err(_) => self.output.cut_to_whole_lines(self.written, &bytes),
        };
        self.has_ended |= written.is_err();
        self.unwritten = bytes;
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
        self.output.discard();
    }
}
