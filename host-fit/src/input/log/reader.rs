//! One log into the dataset.

use super::error::LogError;
use super::parse::LogRow;
use super::stream::{LogEnd, stream_text};
use super::warning::LogWarning;
use super::{LogReading, ReadOptions};
use crate::input::dataset::{Dataset, LogSource, Movement, Row};
use crate::input::stage::Stage;
use crate::input::text::TextReader;
use sha2::Sha256;

/// Adds the log to what was read. Gives the hash of the text as far as it is asked for.
pub(super) fn append(
    reading: &mut LogReading,
    text: TextReader<'_>,
    stage: &Stage,
    options: &ReadOptions,
) -> Result<Option<Sha256>, LogError> {
    let dataset = &mut reading.dataset;
    let (first_row, log) = (dataset.rows.len(), dataset.logs.len());
    let end = stream_text(
        text,
        "reading",
        stage,
        options,
        |row| *row,
        |batch| {
            for row in batch.blocks.iter().flatten() {
                push(dataset, log, row);
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
    dataset.logs.push(LogSource {
        path,
        rows: first_row..dataset.rows.len(),
        has_reference,
    });
    reading.skipped_rows += skipped_rows;
    LogWarning::add(&mut reading.warnings, warnings);
    Ok(hash)
}

/// Adds a row of a log to the dataset.
fn push(dataset: &mut Dataset, log: usize, row: &LogRow<Row>) {
    let at = dataset.rows.len();
    match dataset.movements.last_mut() {
        Some(last) if !row.begins => last.rows.end = at + 1,
        _ => dataset.movements.push(Movement {
            log,
            index: row.movement,
            rows: at..at + 1,
        }),
    }
    dataset.rows.push(Row {
        movement: dataset.movements.len() - 1,
        frame: row.item.frame.with_sequence(row.sequence),
        ..row.item
    });
}
