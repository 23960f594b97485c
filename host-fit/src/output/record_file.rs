//! A record: what came is in the file, whatever ends the run.

use super::{
    OutputError, end_of_links, explain, folder_of, is_stream, names_standard_output, resolve,
};
use std::fs::{File, OpenOptions};
use std::io::{Seek, SeekFrom, Stdout, Write};
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
    sink: Sink,
    /// Lines that are not in the file yet.
    unwritten: Vec<u8>,
    since: Instant,
    /// Bytes of the lines in the file.
    written: u64,
}

#[derive(Debug)]
enum Sink {
    /// A file of its own, which can be cut and removed.
    New(File),
    Device(File),
    Standard(Stdout),
}

impl Sink {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<()> {
        match self {
            Self::New(file) | Self::Device(file) => file.write_all(bytes),
            Self::Standard(out) => out.write_all(bytes).and_then(|()| out.flush()),
        }
    }
}

impl RecordFile {
    /// An empty record.
    ///
    /// # Errors
    /// [`OutputError::Exists`] for a file that is there, and those of a place that cannot be written.
    pub fn create(path: &Path) -> Result<Self, OutputError> {
        let sink = if names_standard_output(path) {
            Sink::Standard(std::io::stdout())
        } else {
            let (target, existing) = resolve(path)?;
            let opened = match existing {
                None => {
                    let mut new = OpenOptions::new();
                    new.write(true)
                        .create_new(true)
                        .open(&target)
                        .map(Sink::New)
                }
                Some(metadata) if is_stream(path, &metadata) => {
                    let device = OpenOptions::new().append(true).open(path);
                    device.map(Sink::Device)
                }
                Some(_) => {
                    return Err(OutputError::Exists {
                        path: path.to_path_buf(),
                    });
                }
            };
            opened.map_err(|source| explain(source, path, &folder_of(&target), 0))?
        };
        Ok(Self {
            path: path.to_path_buf(),
            sink,
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
        let written = self.sink.write(&self.unwritten);
        match (&written, &mut self.sink) {
            (Ok(()), _) => self.written += bytes as u64,
            (Err(_), Sink::New(file)) => {
                // A part of a line that cannot be cut off is one that `import` names.
                let _ = file.set_len(self.written);
                let _ = file.seek(SeekFrom::Start(self.written));
            }
            (Err(_), _) => {}
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
        match &self.sink {
            Sink::New(file) => file
                .sync_all()
                .map_err(|source| explain(source, &self.path, &folder_of(&self.path), 0)),
            Sink::Device(_) | Sink::Standard(_) => Ok(()),
        }
    }

    /// Removes the file.
    pub fn discard(self) {
        if let Sink::New(_) = self.sink {
            let _ = std::fs::remove_file(end_of_links(&self.path));
        }
    }
}
