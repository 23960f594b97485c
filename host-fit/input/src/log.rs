//! Reads logs: CSV or CSV.gz, raw codes and reference, into rows in SI units by movement.
//!
//! A log has one row per servo period below a header. [`layout`] names the columns, `units.rs` their units,
//! [`table::Table::open`] the forms of a table. [`order`] separates movements in a log without a column for them.
//! The first bytes of a file say whether it is gzip or UTF-16; its name does not matter.
//!
//! Faults are refused with file, line and column ([`LogError`]). Bad cells and saturated codes can be left out and
//! counted instead ([`BadRows::Skip`]); a wrong structure is always refused.

pub mod cell;
mod decimal;
mod error;
pub mod header;
pub mod layout;
pub mod lines;
pub mod order;
mod pattern;
mod preamble;
mod record;
pub mod rows;
mod skipped;
mod stream;
pub mod table;
pub mod time;
pub mod units;
mod words;

pub use cell::CellFault;
pub use error::{LogError, LogProblem, Place};
pub use pattern::Pattern;
pub use stream::{LogEnd, LogRow, LogRows};

use crate::channel::Channel;
use crate::dataset::{Dataset, FIT_ROWS_MAX, LogSource};
use crate::finding::{Finding, Kind, Severity};
use crate::sample::Sampler;
use crate::stage::Stage;
use crate::text::TextReader;
use crate::watch::Watch;
use sha2::{Digest, Sha256};
use std::path::Path;

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
    /// The row is kept, and the decoder marks it.
    Keep,
}

/// Whether a log must hold the interferometers' reference.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ReferenceUse {
    /// It must hold it.
    #[default]
    Required,
    /// It may hold it; see [`crate::dataset::LogSource::has_reference`].
    IfPresent,
    /// It may hold the commanded pose, which stands in the place of the reference.
    Commanded,
}

/// How to read logs.
#[derive(Clone, Copy, Debug)]
pub struct ReadOptions {
    /// What to do with bad rows.
    pub bad_rows: BadRows,
    /// What to do with saturated codes.
    pub saturated: SaturatedCodes,
    /// Whether the reference is needed.
    pub reference: ReferenceUse,
    /// Largest number of rows that are held; from longer logs a sample.
    pub rows_max: usize,
    /// Shows how far the reading is, and can end it.
    pub watch: Watch<'static>,
}

impl Default for ReadOptions {
    fn default() -> Self {
        Self::FIT
    }
}

impl ReadOptions {
    /// For `fit`.
    pub const FIT: Self = Self {
        bad_rows: BadRows::Refuse,
        saturated: SaturatedCodes::Bad,
        reference: ReferenceUse::Required,
        rows_max: FIT_ROWS_MAX,
        watch: Watch::NONE,
    };

    /// For a record of the sensors: a reference is not needed.
    pub const SENSORS: Self = Self {
        reference: ReferenceUse::IfPresent,
        ..Self::FIT
    };

    /// For `decode`: saturated rows are kept, a reference is not needed.
    pub const DECODE: Self = Self {
        saturated: SaturatedCodes::Keep,
        ..Self::SENSORS
    };
}

/// Logs that were read.
#[derive(Debug, Default)]
pub struct LogReading {
    /// The rows of all logs, or a sample of them.
    pub dataset: Dataset,
    /// Warnings of the logs, in their order.
    pub warnings: Vec<Finding>,
    /// Number of rows that were left out; the warnings say why.
    pub skipped_rows: usize,
}

/// Reads the logs, in this order, into one dataset. Memory does not grow with the logs.
///
/// # Errors
/// Every variant of [`LogError`]; the first fault of the first bad log.
pub fn read<P: AsRef<Path>>(
    paths: &[P],
    stage: &Stage,
    options: &ReadOptions,
) -> Result<LogReading, LogError> {
    read_each(paths, stage, options, |_, _| ())
}

/// The same; `take` gets every row, with the number of its log.
///
/// # Errors
/// As [`read`].
pub fn read_each<P: AsRef<Path>>(
    paths: &[P],
    stage: &Stage,
    options: &ReadOptions,
    take: impl FnMut(usize, &LogRow),
) -> Result<LogReading, LogError> {
    let open = |path: &P| Ok(TextReader::open(path.as_ref())?);
    read_texts(paths.iter().map(open), stage, options, take)
}

/// Reads one log that is in memory, plain or gzip; `path` only names it in errors.
///
/// # Errors
/// As [`read`], without errors of opening the file.
pub fn read_bytes(
    bytes: &[u8],
    path: &Path,
    stage: &Stage,
    options: &ReadOptions,
) -> Result<LogReading, LogError> {
    let text = TextReader::from_reader(bytes, path).map_err(LogError::from);
    read_texts([text], stage, options, |_, _| ())
}

/// As [`read_each`], of logs that are in memory with their names.
///
/// # Errors
/// As [`read_bytes`].
pub fn read_each_of_bytes<P: AsRef<Path>>(
    logs: &[(P, Vec<u8>)],
    stage: &Stage,
    options: &ReadOptions,
    take: impl FnMut(usize, &LogRow),
) -> Result<LogReading, LogError> {
    let texts = logs
        .iter()
        .map(|(path, bytes)| Ok(TextReader::from_reader(bytes.as_slice(), path.as_ref())?));
    read_texts(texts, stage, options, take)
}

fn read_texts<'t>(
    texts: impl IntoIterator<Item = Result<TextReader<'t>, LogError>>,
    stage: &'t Stage,
    options: &ReadOptions,
    mut take: impl FnMut(usize, &LogRow),
) -> Result<LogReading, LogError> {
    let mut reading = LogReading::default();
    let mut sampler = Sampler::new(options.rows_max);
    let mut hash = Sha256::new();
    let mut files = Vec::new();
    for (log, text) in texts.into_iter().enumerate() {
        // Of all logs so far, and of this one.
        let text = text?.with_hashes(match log {
            0 => vec![hash],
            _ => vec![hash, Sha256::new()],
        });
        let path = text.path().to_path_buf();
        let file = path.canonicalize().unwrap_or_else(|_| path.clone());
        if files.contains(&file) {
            return Err(Place::new(path, None).refuse(LogProblem::SameLog));
        }
        files.push(file);
        sampler.begin_log();
        let mut rows = LogRows::new(text, "reading", stage, options)?;
        while let Some(row) = rows.next_row()? {
            sampler.push(row.movement, row.begins, &row.row);
            take(log, &row);
        }
        let end = rows.end()?;
        reading.skipped_rows += end.skipped_rows;
        reading.warnings.extend(end.warnings);
        let own = end.hashes.last().cloned().unwrap_or_default();
        let source = LogSource {
            path: end.path,
            sha256: own.finalize().into(),
            rows: 0..0,
            rows_read: 0,
            movements_read: 0,
            has_reference: end.has_reference,
        };
        sampler.end_log(source);
        hash = end.hashes.into_iter().next().unwrap_or_default();
    }
    if files.is_empty() {
        return Err(Place::new("", None).refuse(LogProblem::NoLog));
    }
    reading.dataset = sampler.into_dataset(hash.finalize().into());
    let resets = reading.dataset.split_at_resets(&stage.interferometer);
    if let Some(&first) = resets.first() {
        let kind = Kind::Resets {
            resets: resets.len(),
        };
        let found = Finding::new(kind)
            .with_severity(Severity::Note)
            .with_channel(Channel::Beams);
        let (row, dataset) = (&reading.dataset.rows[first], &reading.dataset);
        let name = dataset.movement_name(&dataset.movements[row.movement]);
        reading.warnings.push(found.with_place(name, row.t_us));
    }
    reading.dataset.compensate_as_expected(&stage.temperature);
    let (rows, _) = reading.dataset.read();
    let (taken, runs) = (reading.dataset.rows.len(), reading.dataset.movements.len());
    if taken < rows {
        let excerpt = Kind::Excerpt { rows, taken, runs };
        reading.warnings.push(Finding::new(excerpt));
    }
    Ok(reading)
}

#[cfg(test)]
mod tests;
