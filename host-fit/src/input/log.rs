//! Reads logs: CSV or CSV.gz, raw codes and reference, into rows in SI units by movement.
//!
//! One row per servo period below a header. Which column holds what is said in
//! [`layout`], in which units in `units.rs`, what else a table may look like at
//! `Head::read` in `table.rs`; a log without a column for the movement is taken apart in `split.rs`.
//! A file is taken for gzip or UTF-16 by its first bytes, not by its name.
//!
//! Anything wrong is refused with file, line and column ([`LogError`]). Bad cells and
//! saturated codes can be left out and counted instead ([`BadRows::Skip`]); a log whose
//! structure is wrong is always refused.

mod blocks;
pub(crate) mod cell;
mod cursor;
mod decimal;
mod error;
mod gathered;
pub(crate) mod guess;
pub(crate) mod header;
pub mod layout;
mod line;
mod order;
mod parse;
mod preamble;
mod reader;
pub(crate) mod rows;
pub(in crate::input) mod sequence;
mod skipped;
mod split;
mod stitch;
mod stream;
pub(crate) mod table;
pub(crate) mod time;
pub(crate) mod units;
mod warning;

pub use cell::CellFault;
pub use error::{CellPlace, LogError};
pub use parse::LogRow;
pub use stream::{Batch, LogEnd, stream};
pub use warning::{LogWarning, SkipReason};

use crate::input::dataset::{Dataset, FIT_ROWS_MAX, LogSource};
use crate::input::stage::Stage;
use crate::input::text::TextReader;
use crate::input::whole::chunk::Sample;
use crate::input::whole::passing::Passing;
use gathered::Gathered;
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

/// How to read logs. The default refuses what is wrong, needs the reference and holds all rows.
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
    /// Most rows that are held; of more the dataset is an excerpt, and the whole is held compactly
    /// beside it. All are held if `None`.
    pub rows_max: Option<usize>,
    /// Most memory that what is held of the logs may take, bytes; any if `None`.
    pub memory_bytes: Option<u64>,
}

impl ReadOptions {
    /// For `fit`: of a long log an excerpt.
    pub const FIT: Self = Self {
        bad_rows: BadRows::Refuse,
        saturated: SaturatedCodes::Bad,
        reference: ReferenceUse::Required,
        split_s: None,
        rows_max: Some(FIT_ROWS_MAX),
        memory_bytes: None,
    };

    /// For `decode`: saturated rows are kept, a reference is not needed.
    pub const DECODE: Self = Self {
        bad_rows: BadRows::Refuse,
        saturated: SaturatedCodes::Keep,
        reference: ReferenceUse::IfPresent,
        split_s: None,
        rows_max: None,
        memory_bytes: None,
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
    let mut gathered = Gathered::new(stage, options.rows_max);
    let mut hash = Sha256::new();
    for path in paths {
        let text = TextReader::open(path.as_ref())?.with_hash(hash);
        let all = (&mut reading, &mut gathered);
        hash = reader::append(all, text, stage, options)?.unwrap_or_default();
        refuse_repeated_log(&gathered)?;
    }
    reading.dataset = gathered.into_dataset(hash.finalize().into(), &mut reading.warnings);
    Ok(reading)
}

/// As [`read`], in little memory however long the logs are: of more than `rows_max` rows the dataset
/// is an excerpt, and the whole is not held. `make` tells what is wanted of each row, on any core, and
/// `take` gets it with the number of its log, row after row.
///
/// # Errors
/// As [`read`].
pub fn read_passing<P: AsRef<Path>, T: Send>(
    paths: &[P],
    stage: &Stage,
    options: &ReadOptions,
    make: impl Fn(&Sample) -> T + Sync,
    mut take: impl FnMut(usize, &LogRow<(Sample, T)>),
) -> Result<LogReading, LogError> {
    if paths.is_empty() {
        return Err(LogError::NoLog);
    }
    let mut reading = LogReading::default();
    let mut passing = Passing::new(stage, options.rows_max.unwrap_or(usize::MAX));
    let mut hash = Sha256::new();
    for (log, path) in paths.iter().enumerate() {
        let text = TextReader::open(path.as_ref())?.with_hash(hash);
        let take = |row: &LogRow<(Sample, T)>| take(log, row);
        let all = (&mut reading, &mut passing);
        hash = reader::pass(all, text, stage, options, &make, take)?.unwrap_or_default();
    }
    let rows = passing.passed();
    reading.dataset = passing.into_dataset(hash.finalize().into());
    let taken = reading.dataset.rows.len();
    if taken < rows {
        let runs = reading.dataset.movements.len();
        reading
            .warnings
            .push(LogWarning::Excerpt { rows, taken, runs });
    }
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
    let text = TextReader::of_bytes(bytes, path)?.with_hash(Sha256::new());
    let mut reading = LogReading::default();
    let mut gathered = Gathered::new(stage, options.rows_max);
    let all = (&mut reading, &mut gathered);
    let hash = reader::append(all, text, stage, options)?.unwrap_or_default();
    reading.dataset = gathered.into_dataset(hash.finalize().into(), &mut reading.warnings);
    Ok(reading)
}

/// Refuses the last log if an earlier one holds the same rows.
fn refuse_repeated_log(gathered: &Gathered) -> Result<(), LogError> {
    let Some((last, earlier)) = gathered.logs.split_last() else {
        return Ok(());
    };
    let samples = |source: &LogSource| gathered.samples_of(source.rows.clone());
    let repeats = |first: &&LogSource| {
        first.rows.len() == last.rows.len() && samples(first).eq(samples(last))
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
