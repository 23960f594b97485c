//! Reads logs: CSV or CSV.gz, raw codes and reference, into rows in SI units by movement.
//!
//! One row per servo period below a header. Which column holds what is said in
//! [`layout`], in which units in `units.rs`, what else a table may look like at
//! `Table::open` in `table.rs`; a log without a column for the movement is taken apart in `split.rs`.
//! A file is taken for gzip or UTF-16 by its first bytes, not by its name.
//!
//! Anything wrong is refused with file, line and column ([`LogError`]). Bad cells and
//! saturated codes can be left out and counted instead ([`BadRows::Skip`]); a log whose
//! structure is wrong is always refused.

pub(crate) mod cell;
mod decimal;
mod error;
pub(crate) mod guess;
pub(crate) mod header;
pub mod layout;
mod order;
mod preamble;
mod reader;
pub(crate) mod rows;
mod sequence;
mod skipped;
mod split;
pub(crate) mod table;
pub(crate) mod time;
pub(crate) mod units;
mod warning;

pub use cell::CellFault;
pub use error::{CellPlace, LogError};
pub use warning::{LogWarning, SkipReason};

use crate::input::dataset::{Dataset, LogSource, Row};
use crate::input::source;
use crate::input::stage::Stage;
use sha2::{Digest, Sha256};
use std::path::Path;
use table::Table;

/// What to do with a row that has a bad cell.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum BadRows {
    /// Refuse the log.
    #[default]
    Refuse,
    /// Leave the row out and count it.
    Skip,
}

/// What to do with a code at a rail of its converter.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SaturatedCodes {
    /// The row is bad: see [`BadRows`].
    #[default]
    Bad,
    /// The row is kept: the decoder marks it.
    Keep,
}

/// Whether a log must hold the interferometers' reference.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ReferenceUse {
    /// It must.
    #[default]
    Required,
    /// It is read where it is there; [`crate::input::dataset::LogSource::has_reference`] tells.
    IfPresent,
}

/// How to read logs. The default is that of `fit`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ReadOptions {
    /// What to do with bad rows.
    pub bad_rows: BadRows,
    /// What to do with saturated codes.
    pub saturated: SaturatedCodes,
    /// Whether the reference is needed.
    pub reference: ReferenceUse,
    /// Length of the movements of logs that have no column for them, s; without it they end at gaps
    /// alone.
    pub split_s: Option<f64>,
}

impl ReadOptions {
    /// For `decode`: saturated rows are kept, a reference is not needed.
    pub const DECODE: Self = Self {
        bad_rows: BadRows::Refuse,
        saturated: SaturatedCodes::Keep,
        reference: ReferenceUse::IfPresent,
        split_s: None,
    };
}

/// What [`read`] gives.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LogReading {
    /// The rows of all logs.
    pub dataset: Dataset,
    /// What is odd about the logs, in their order.
    pub warnings: Vec<LogWarning>,
    /// How many rows were left out; the warnings say why.
    pub skipped_rows: usize,
}

/// Reads the logs, in this order, into one dataset.
///
/// # Errors
/// Every variant of [`LogError`]; the first fault of the first bad log.
pub fn read<P: AsRef<Path>>(
    paths: &[P],
    stage: &Stage,
    options: &ReadOptions,
) -> Result<LogReading, LogError> {
    if paths.is_empty() {
        return Err(LogError::NoLog);
    }
    let mut reading = LogReading::default();
    let mut hash = Sha256::new();
    for path in paths {
        let path = path.as_ref();
        let text = source::read_text(path)?;
        hash.update(&text);
        append(
            &mut reading,
            source::shown_name(path),
            &text,
            stage,
            options,
        )?;
    }
    reading.dataset.sha256 = hash.finalize().into();
    Ok(reading)
}

/// Reads one log that is in memory, plain or gzip; `path` is only named in errors.
///
/// # Errors
/// As [`read`], without those of opening the file.
pub fn read_bytes(
    bytes: &[u8],
    path: &Path,
    stage: &Stage,
    options: &ReadOptions,
) -> Result<LogReading, LogError> {
    let text = source::unpack_text(bytes.into(), path)?;
    let mut reading = LogReading::default();
    append(&mut reading, path, &text, stage, options)?;
    reading.dataset.sha256 = Sha256::digest(&text).into();
    Ok(reading)
}

fn append(
    reading: &mut LogReading,
    path: &Path,
    text: &[u8],
    stage: &Stage,
    options: &ReadOptions,
) -> Result<(), LogError> {
    let text = source::to_utf8(text, path)?;
    let table = Table::open(path, &text, |name| stage.log.knows(name))?;
    let (dataset, warnings) = (&mut reading.dataset, &mut reading.warnings);
    reading.skipped_rows += reader::append(table, stage, options, dataset, warnings)?;
    refuse_repeated_log(&reading.dataset)
}

/// Refuses the last log if an earlier one holds the same rows.
fn refuse_repeated_log(dataset: &Dataset) -> Result<(), LogError> {
    let Some((last, earlier)) = dataset.logs.split_last() else {
        return Ok(());
    };
    let rows = |source: &LogSource| dataset.rows.get(source.rows.clone()).unwrap_or_default();
    let same = |a: &Row, b: &Row| (a.t_us, a.frame, a.reference) == (b.t_us, b.frame, b.reference);
    let repeats = |first: &&LogSource| {
        let (first, last) = (rows(first), rows(last));
        first.len() == last.len() && first.iter().zip(last).all(|(a, b)| same(a, b))
    };
    match earlier.iter().find(repeats) {
        None => Ok(()),
        Some(first) => Err(LogError::SameLog {
            path: last.path.clone(),
            first: first.path.clone(),
        }),
    }
}

#[cfg(test)]
mod tests;
