//! The text of a log, and how it is read.

use crate::choice::chosen;
use crate::error::wrong;
use crate::source::Source;
use host_fit::input::log::{BadRows, LogError, LogReading, LogRow, ReadOptions};
use host_fit::input::stage::Stage as Designed;
use host_fit::input::watch::Watch;
use pyo3::PyResult;
use std::sync::Arc;

/// The text of a log, and how it is read.
#[derive(Clone)]
pub struct LogText {
    pub source: Arc<Source>,
    pub how: How,
    /// The stage with the columns of this log.
    pub designed: Arc<Designed>,
}

/// How a log is read.
#[derive(Clone, Copy)]
pub struct How {
    bad_rows: BadRows,
    /// Whether only the sample of a long log is held.
    pub is_sample: bool,
}

impl How {
    /// Bad rows are refused, all rows are held.
    pub const WHOLE: Self = Self {
        bad_rows: BadRows::Refuse,
        is_sample: false,
    };

    pub fn new(bad_rows: &str, rows: &str) -> PyResult<Self> {
        let is_sample = match rows {
            "all" => false,
            "sample" => true,
            _ => return Err(wrong("rows", "\"all\" or \"sample\" is needed")),
        };
        let bad_rows = chosen::<BadRows>("bad_rows", bad_rows)?;
        Ok(Self {
            bad_rows,
            is_sample,
        })
    }

    pub const fn words(self) -> (&'static str, &'static str) {
        let bad_rows = match self.bad_rows {
            BadRows::Refuse => "refuse",
            BadRows::Skip => "skip",
        };
        (bad_rows, if self.is_sample { "sample" } else { "all" })
    }
}

impl LogText {
    /// Of a stage, with the columns of the source.
    pub fn new(source: Source, stage: &Designed, how: How) -> Self {
        Self {
            designed: Arc::new(source.designed(stage)),
            source: Arc::new(source),
            how,
        }
    }

    /// Reads the log for a command, with the options of the user; `take` gets every row with the number of its log.
    ///
    /// # Errors
    /// See [`LogError`].
    pub fn read(
        &self,
        command: ReadOptions,
        watch: Watch<'static>,
        take: impl FnMut(usize, &LogRow),
    ) -> Result<LogReading, LogError> {
        let options = ReadOptions {
            bad_rows: self.how.bad_rows,
            watch,
            ..command
        };
        self.source.read(&self.designed, &options, take)
    }
}
