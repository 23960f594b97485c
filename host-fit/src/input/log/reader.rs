//! One log into the dataset.

use super::error::LogError;
use super::gathered::Gathered;
use super::parse::LogRow;
use super::stream::{LogEnd, stream_text};
use super::warning::LogWarning;
use super::{LogReading, ReadOptions};
use crate::input::dataset::LogSource;
use crate::input::stage::Stage;
use crate::input::text::TextReader;
use crate::input::whole::chunk::Sample;
use crate::input::whole::passing::Passing;
use sha2::Sha256;

/// Adds the log to what was read. Gives the hash of the text as far as it is asked for.
pub(super) fn append(
    (reading, gathered): (&mut LogReading, &mut Gathered),
    text: TextReader<'_>,
    stage: &Stage,
    options: &ReadOptions,
) -> Result<Option<Sha256>, LogError> {
    let first_row = gathered.len();
    let path = text.path().to_path_buf();
    let end = stream_text(
        text,
        "reading",
        stage,
        options,
        |sample| *sample,
        |batch| {
            for row in batch.blocks.iter().flatten() {
                gathered.push(row);
            }
            match options.memory_bytes {
                Some(limit_bytes) if gathered.bytes() > limit_bytes => Err(LogError::TooLarge {
                    path: path.clone(),
                    rows: gathered.len(),
                    bytes: gathered.bytes(),
                    limit_bytes,
                }),
                _ => Ok(()),
            }
        },
    )?;
    let LogEnd {
        path,
        skipped_rows,
        has_reference,
        warnings,
        hash,
    } = end;
    gathered.logs.push(LogSource {
        path,
        rows: first_row..gathered.len(),
        has_reference,
    });
    reading.skipped_rows += skipped_rows;
    LogWarning::add(&mut reading.warnings, warnings);
    Ok(hash)
}

/// Lets the log pass: `take` gets what `make` tells of each row. Gives the hash as [`append`] does.
pub(super) fn pass<T: Send>(
    (reading, passing): (&mut LogReading, &mut Passing),
    text: TextReader<'_>,
    stage: &Stage,
    options: &ReadOptions,
    make: impl Fn(&Sample) -> T + Sync,
    mut take: impl FnMut(&LogRow<(Sample, T)>),
) -> Result<Option<Sha256>, LogError> {
    let path = text.path().to_path_buf();
    passing.begin_log();
    let end = stream_text(
        text,
        "reading",
        stage,
        options,
        |sample| (*sample, make(sample)),
        |batch| {
            for row in batch.blocks.iter().flatten() {
                passing.push(row.movement, row.begins, row.sequence, &row.item.0);
                take(row);
            }
            match options.memory_bytes {
                Some(limit_bytes) if passing.bytes() > limit_bytes => Err(LogError::TooLarge {
                    path: path.clone(),
                    rows: passing.passed(),
                    bytes: passing.bytes(),
                    limit_bytes,
                }),
                _ => Ok(()),
            }
        },
    )?;
    reading.skipped_rows += end.skipped_rows;
    LogWarning::add(&mut reading.warnings, end.warnings);
    let source = LogSource {
        path: end.path,
        rows: 0..0,
        has_reference: end.has_reference,
    };
    match passing.end_log(source) {
        Some(first) => Err(LogError::SameLog {
            path,
            first: first.path.clone(),
        }),
        None => Ok(end.hash),
    }
}
