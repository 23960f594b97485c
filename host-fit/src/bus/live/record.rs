//! The record of a bus: a file in the form of `candump -L`.

use super::LiveError;
use hal_adapters::can::{BusFrame, StampedFrame};
use hal_adapters::candump::LogLine;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

/// Writes frames as they come.
#[derive(Debug)]
pub(super) struct Record {
    path: PathBuf,
    file: BufWriter<File>,
    interface: String,
}

impl Record {
    pub(super) fn create(path: &Path, interface: &str) -> Result<Self, LiveError> {
        let file = File::create(path).map_err(|cause| LiveError::Record {
            path: path.to_owned(),
            cause,
        })?;
        Ok(Self {
            path: path.to_owned(),
            file: BufWriter::new(file),
            interface: interface.to_owned(),
        })
    }

    pub(super) fn frame(&mut self, stamped: &StampedFrame) -> Result<(), LiveError> {
        let line = LogLine {
            time_us: stamped.time_us,
            interface: &self.interface,
            frame: stamped.frame,
        };
        writeln!(self.file, "{line}").map_err(|cause| self.failed(cause))
    }

    pub(super) fn sent(&mut self, frame: BusFrame, time_us: u64) -> Result<(), LiveError> {
        self.frame(&StampedFrame { time_us, frame })
    }

    pub(super) fn flush(&mut self) -> Result<(), LiveError> {
        self.file.flush().map_err(|cause| self.failed(cause))
    }

    fn failed(&self, cause: std::io::Error) -> LiveError {
        LiveError::Record {
            path: self.path.clone(),
            cause,
        }
    }
}
