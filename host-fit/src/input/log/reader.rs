//! One log into the dataset: header, rows in order, bad rows refused or left out.

use super::error::LogError;
use super::gathered::Gathered;
use super::header::{self, Columns, ReferenceSource};
use super::order::{Order, OrderFault};
use super::rows::{BadCell, RowReader};
use super::skipped::Skipped;
use super::split::Steps;
use super::table::Table;
use super::warning::LogWarning;
use super::{BadRows, ReadOptions, SaturatedCodes};
use crate::input::dataset::{LogSource, Movement};
use crate::input::stage::Stage;
use crate::progress::Progress;

/// Mean distance of voltages from whole codes that passes in silence: those that were computed from
/// codes and written with few digits stay below it, those of another instrument have 0.25.
const BETWEEN_CODES: f64 = 0.15;

/// Rows from one step of the progress to the next.
const ROWS_A_STEP: usize = 4096;

/// One log on its way to the rows of all.
struct LogReader<'a> {
    columns: &'a Columns,
    rows: RowReader<'a>,
    bad_rows: BadRows,
    /// Which log this is.
    log: usize,
    /// Its first movement among those of all logs.
    first_movement: usize,
    order: Order,
    /// Of a log without a column for the movement.
    steps: Steps,
    /// How often the time of such a log started again.
    restarts: i64,
    skipped: Skipped,
}

/// Adds the log to `gathered`; what is odd about it goes to `warnings`. Gives the number of
/// rows that were left out.
pub(super) fn append(
    mut table: Table<'_>,
    stage: &Stage,
    options: &ReadOptions,
    gathered: &mut Gathered,
    warnings: &mut Vec<LogWarning>,
) -> Result<usize, LogError> {
    let columns = header::columns(&table, &stage.log, options.reference)?;
    if columns.movement.is_some() && options.split_s.is_some() {
        return Err(LogError::SplitWithMovements {
            path: table.path.to_path_buf(),
        });
    }
    let (first_row, first_movement) = (gathered.len(), gathered.movements.len());
    let mut reader = LogReader {
        columns: &columns,
        rows: RowReader::new(&columns, stage, options.saturated == SaturatedCodes::Keep),
        bad_rows: options.bad_rows,
        log: gathered.logs.len(),
        first_movement,
        order: Order::default(),
        steps: Steps::default(),
        restarts: 0,
        skipped: Skipped::default(),
    };
    let progress = Progress::new("reading", table.bytes());
    while table.next_row()? {
        reader.take(&table, gathered)?;
        if gathered.len().is_multiple_of(ROWS_A_STEP) {
            progress.reach(table.row_byte());
        }
    }
    drop(progress);
    let between_codes = reader.rows.mean_between_codes();
    let (skipped, steps) = (reader.skipped, reader.steps);
    let skipped_rows = skipped.rows();
    if gathered.len() == first_row {
        return Err(skipped.nothing_left(table.path, table.header_line()));
    }
    if columns.movement.is_none() {
        let length_us = options
            .split_s
            .map(|seconds| (seconds * 1e6).round() as i64);
        steps.split(gathered, first_movement, length_us);
    }
    let source = LogSource {
        path: table.path.to_path_buf(),
        rows: first_row..gathered.len(),
        has_reference: !matches!(columns.reference, ReferenceSource::Absent),
    };
    let movements = gathered.movements.get(first_movement..).unwrap_or_default();
    if table.is_open() {
        warnings.push(LogWarning::NoFinalLineBreak {
            path: source.path.clone(),
            line: table.line(table.row_byte()),
        });
    }
    if columns.movement.is_none() {
        LogWarning::add_movements_by_time(warnings, &source.path, movements.len(), options.split_s);
    }
    if between_codes > BETWEEN_CODES {
        warnings.push(LogWarning::BetweenCodes {
            path: source.path.clone(),
            mean: between_codes,
        });
    }
    warnings.extend(skipped.warnings(table.path, movements));
    let mut single = movements.iter().filter(|movement| movement.rows.len() == 1);
    if let Some(first) = single.next() {
        warnings.push(LogWarning::SingleRow {
            path: source.path.clone(),
            first: first.index,
            others: single.count(),
        });
    }
    gathered.end(source, first_movement, warnings);
    Ok(skipped_rows)
}

impl LogReader<'_> {
    /// Adds the row in hand, or leaves it out.
    fn take(&mut self, table: &Table<'_>, gathered: &mut Gathered) -> Result<(), LogError> {
        let named = match self.rows.movement(table) {
            Ok(movement) => movement,
            Err(bad) => return self.bad(bad, None, table),
        };
        let t_us = match self.rows.t_us(table) {
            Ok(t_us) => t_us,
            Err(bad) => return self.bad(bad, named, table),
        };
        let movement = named.unwrap_or_else(|| {
            self.restarts += i64::from(self.steps.take(t_us));
            self.restarts
        });
        self.order
            .take(movement, t_us, table.row_byte())
            .map_err(|fault| self.out_of_order(fault, named, t_us, table))?;
        let own = gathered.movements.get(self.first_movement..);
        let begins = own
            .and_then(<[_]>::last)
            .is_none_or(|last| last.index != movement);
        let slot = gathered.movements.len() - usize::from(!begins);
        let row = match self.rows.row(table, slot, t_us) {
            Ok(row) => row,
            Err(bad) => return self.bad(bad, named, table),
        };
        if named.is_none() {
            self.steps.keep();
        }
        let start = gathered.len();
        gathered.push(row);
        match gathered.movements.last_mut() {
            Some(last) if !begins => last.rows.end = start + 1,
            _ => gathered.movements.push(Movement {
                log: self.log,
                index: movement,
                rows: start..start + 1,
            }),
        }
        Ok(())
    }

    fn bad(
        &mut self,
        bad: BadCell,
        movement: Option<i64>,
        table: &Table<'_>,
    ) -> Result<(), LogError> {
        let BadCell { cell, fault } = bad;
        let place = || table.place(table.row_byte(), cell, movement);
        match self.bad_rows {
            BadRows::Refuse => Err(LogError::Cell {
                place: place(),
                fault,
            }),
            BadRows::Skip => {
                self.skipped.add(fault, movement, place);
                Ok(())
            }
        }
    }

    fn out_of_order(
        &self,
        fault: OrderFault,
        movement: Option<i64>,
        t_us: i64,
        table: &Table<'_>,
    ) -> LogError {
        let at = |cell| table.place(table.row_byte(), cell, movement);
        let time = self.columns.time.cell;
        let index = self.columns.movement.map_or(time, |source| source.cell);
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
                left_line: table.line(left_byte),
            },
        }
    }
}
