//! One log into the dataset.

use super::error::LogError;
use super::gathered::Gathered;
use super::stream::{LogEnd, stream_text};
use super::warning::LogWarning;
use super::{LogReading, ReadOptions};
use crate::input::dataset::LogSource;
use crate::input::stage::Stage;
use crate::input::text::TextReader;
use sha2::Sha256;

/// Adds the log to what was read. Gives the hash of the text as far as it is asked for.
pub(super) fn append(
    (reading, gathered): (&mut LogReading, &mut Gathered),
    text: TextReader<'_>,
    stage: &Stage,
    options: &ReadOptions,
) -> Result<Option<Sha256>, LogError> {
    let first_row = gathered.len();
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
            Ok::<(), LogError>(())
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
