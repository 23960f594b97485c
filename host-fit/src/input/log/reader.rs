//! One log into the dataset: header, rows in order, bad rows refused or left out.

use super::error::{CellPlace, LogError};
use super::header::{self, Columns, ReferenceSource};
use super::order::{Order, OrderFault};
use super::rows::{BadCell, RowReader};
use super::sequence;
use super::skipped::Skipped;
use super::text::{Records, Text};
use super::warning::LogWarning;
use super::{BadRows, ReadOptions, SaturatedCodes};
use crate::input::dataset::{Dataset, LogSource, Movement};
use crate::input::stage::Stage;

/// One log on its way into the dataset.
struct LogReader<'a> {
    text: &'a Text<'a>,
    columns: &'a Columns,
    rows: RowReader<'a>,
    bad_rows: BadRows,
    /// Which log this is.
    log: usize,
    /// Its first movement in the dataset.
    first_movement: usize,
    order: Order,
    skipped: Skipped,
}

/// Adds the log to `dataset`; what is odd about it goes to `warnings`. Gives the number of
/// rows that were left out.
pub(super) fn append(
    text: &Text<'_>,
    stage: &Stage,
    options: &ReadOptions,
    dataset: &mut Dataset,
    warnings: &mut Vec<LogWarning>,
) -> Result<usize, LogError> {
    let mut records = text.records()?;
    if !records.advance()? {
        let path = text.path.to_path_buf();
        return Err(LogError::Empty { path });
    }
    let header_line = records.line();
    let columns = header::columns(
        &records.record,
        text.path,
        header_line,
        &stage.log,
        options.reference,
    )?;
    let (first_row, first_movement) = (dataset.rows.len(), dataset.movements.len());
    let mut reader = LogReader {
        text,
        columns: &columns,
        rows: RowReader::new(&columns, stage, options.saturated == SaturatedCodes::Keep),
        bad_rows: options.bad_rows,
        log: dataset.logs.len(),
        first_movement,
        order: Order::default(),
        skipped: Skipped::default(),
    };
    let mut last_byte = records.byte;
    while records.advance()? {
        last_byte = records.byte;
        reader.take(&records, dataset)?;
    }
    let skipped = reader.skipped;
    let skipped_rows = skipped.rows();
    if dataset.rows.len() == first_row {
        return Err(skipped.nothing_left(text.path, header_line));
    }
    let source = LogSource {
        path: text.path.to_path_buf(),
        rows: first_row..dataset.rows.len(),
        has_reference: !matches!(columns.reference, ReferenceSource::Absent),
    };
    let movements = dataset.movements.get(first_movement..).unwrap_or_default();
    if text.is_open() {
        warnings.push(LogWarning::NoFinalLineBreak {
            path: source.path.clone(),
            line: text.line(last_byte),
        });
    }
    warnings.extend(skipped.warnings(text.path, movements));
    let mut single = movements.iter().filter(|movement| movement.rows.len() == 1);
    if let Some(first) = single.next() {
        warnings.push(LogWarning::SingleRow {
            path: source.path.clone(),
            first: first.index,
            others: single.count(),
        });
    }
    sequence::number(
        &mut dataset.rows,
        movements,
        &source,
        stage.servo_period_s,
        warnings,
    );
    dataset.logs.push(source);
    Ok(skipped_rows)
}

impl LogReader<'_> {
    /// Adds the record in hand to the dataset, or leaves it out.
    fn take(&mut self, record: &Records<'_>, dataset: &mut Dataset) -> Result<(), LogError> {
        self.check_cells(record)?;
        let movement = match self.rows.movement(record) {
            Ok(movement) => movement,
            Err(bad) => return self.bad(bad, None, record),
        };
        let t_us = match self.rows.t_us(record) {
            Ok(t_us) => t_us,
            Err(bad) => return self.bad(bad, Some(movement), record),
        };
        self.order
            .take(movement, t_us, record.byte)
            .map_err(|fault| self.out_of_order(fault, movement, t_us, record))?;
        let own = dataset.movements.get(self.first_movement..);
        let begins = own
            .and_then(<[_]>::last)
            .is_none_or(|last| last.index != movement);
        let slot = dataset.movements.len() - usize::from(!begins);
        let row = match self.rows.row(record, slot, t_us) {
            Ok(row) => row,
            Err(bad) => return self.bad(bad, Some(movement), record),
        };
        let start = dataset.rows.len();
        dataset.rows.push(row);
        match dataset.movements.last_mut() {
            Some(last) if !begins => last.rows.end = start + 1,
            _ => dataset.movements.push(Movement {
                log: self.log,
                index: movement,
                rows: start..start + 1,
            }),
        }
        Ok(())
    }

    /// Refuses a row with too few or too many cells.
    fn check_cells(&self, record: &Records<'_>) -> Result<(), LogError> {
        let expected = self.columns.names.len();
        let found = record.record.len();
        let path = || self.text.path.to_path_buf();
        let last_is_empty = record.cell(found.saturating_sub(1)).is_empty();
        let short = found < expected || (found == expected && last_is_empty);
        if short && record.is_open_end() {
            return Err(LogError::CutLine {
                path: path(),
                line: record.line(),
                expected,
                found: found - usize::from(last_is_empty),
            });
        }
        if found == expected {
            return Ok(());
        }
        Err(LogError::CellCount {
            path: path(),
            line: record.line(),
            expected,
            found,
        })
    }

    fn bad(
        &mut self,
        bad: BadCell,
        movement: Option<i64>,
        record: &Records<'_>,
    ) -> Result<(), LogError> {
        let BadCell { cell, fault } = bad;
        match self.bad_rows {
            BadRows::Refuse => Err(LogError::Cell {
                place: self.place(cell, movement, record),
                fault,
            }),
            BadRows::Skip => {
                let mut skipped = core::mem::take(&mut self.skipped);
                skipped.add(fault, movement, || self.place(cell, movement, record));
                self.skipped = skipped;
                Ok(())
            }
        }
    }

    fn out_of_order(
        &self,
        fault: OrderFault,
        movement: i64,
        t_us: i64,
        record: &Records<'_>,
    ) -> LogError {
        let at = |cell| self.place(cell, Some(movement), record);
        let (time, index) = (self.columns.time.cell, self.columns.movement.cell);
        match fault {
            OrderFault::Backwards { before_us } => LogError::TimeBackwards {
                place: at(time),
                before_us,
                t_us,
            },
            OrderFault::Repeated => LogError::DuplicatedRow {
                place: at(time),
                t_us,
            },
            OrderFault::Returns { left_byte } => LogError::MovementReturns {
                place: at(index),
                left_line: self.text.line(left_byte),
            },
        }
    }

    fn place(&self, cell: usize, movement: Option<i64>, record: &Records<'_>) -> Box<CellPlace> {
        Box::new(CellPlace {
            path: self.text.path.to_path_buf(),
            line: record.line(),
            column: cell + 1,
            name: self.columns.names.get(cell).cloned().unwrap_or_default(),
            movement,
        })
    }
}
