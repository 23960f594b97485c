//! A log row by row, in little memory however long it is.

use super::error::LogError;
use super::header;
use super::order::{GAP_PERIODS, Order, OrderCells};
use super::rows::{BadCell, RowReader};
use super::skipped::Skipped;
use super::table::Table;
use super::{BadRows, ReadOptions, SaturatedCodes};
use crate::dataset::Row;
use crate::finding::{Finding, Kind};
use crate::stage::Stage;
use crate::text::TextReader;
use sha2::Sha256;
use std::path::{Path, PathBuf};

/// Largest mean difference of voltages from whole codes without a warning. Voltages that were computed from codes
/// and written with few digits stay below it; another instrument gives 0.25.
const BETWEEN_CODES: f64 = 0.15;

/// A row of a log.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LogRow {
    /// Number of its movement in the log.
    pub movement: i64,
    /// Whether a movement begins with it.
    pub begins: bool,
    /// The row; its own number of the movement is 0.
    pub row: Row,
}

/// The rows of a log from start to end. Memory grows only by some bytes for each movement.
pub struct LogRows<'a> {
    pub(super) table: Table<'a>,
    pub(super) reader: RowReader<'a>,
    pub(super) order: Order,
    skipped: Skipped,
    options: ReadOptions,
}

/// A log at its end.
#[derive(Debug)]
pub struct LogEnd {
    /// The name of the file in messages.
    pub path: PathBuf,
    /// Number of rows that were left out; the warnings give the reasons.
    pub skipped_rows: usize,
    /// Whether it holds the interferometers' reference.
    pub has_reference: bool,
    /// Its warnings.
    pub warnings: Vec<Finding>,
    pub(super) hashes: Vec<Sha256>,
}

impl<'a> LogRows<'a> {
    /// Opens a log; `what` is being done with it, for the progress.
    ///
    /// # Errors
    /// Errors up to the first row: see [`LogError`].
    pub fn open(
        path: &Path,
        what: &'static str,
        stage: &'a Stage,
        options: &ReadOptions,
    ) -> Result<Self, LogError> {
        Self::new(TextReader::open(path)?, what, stage, options)
    }

    /// As [`Self::open`], of a text that is open.
    ///
    /// # Errors
    /// As [`Self::open`].
    pub fn new(
        text: TextReader<'a>,
        what: &'static str,
        stage: &'a Stage,
        options: &ReadOptions,
    ) -> Result<Self, LogError> {
        let table = Table::open(text, |name| stage.log.knows(name))?;
        let mut table = table.watched(options.watch, what);
        let columns = header::columns(&table.head, stage, options.reference)?;
        let servo_us = stage.servo_period_s * 1e6;
        let period_us = table.period_us(columns.time, columns.movement)?;
        let cells = OrderCells {
            time: columns.time,
            movement: columns.movement.map(|source| source.cell),
        };
        let keep_saturated = options.saturated == SaturatedCodes::Keep;
        Ok(Self {
            order: Order::new(cells, period_us.unwrap_or(servo_us)),
            reader: RowReader::new(columns, stage, keep_saturated),
            skipped: Skipped::default(),
            options: *options,
            table,
        })
    }

    /// Whether it holds the interferometers' reference, or the pose in its place.
    pub const fn has_reference(&self) -> bool {
        self.reader.columns.reference.is_some()
    }

    /// The median time between the first rows, us.
    pub const fn period_us(&self) -> f64 {
        self.order.period_us
    }

    /// The next row; `None` at the end.
    ///
    /// # Errors
    /// The first fault of the log: see [`LogError`].
    pub fn next_row(&mut self) -> Result<Option<LogRow>, LogError> {
        self.row().map_err(|error| self.named_by_pattern(error))
    }

    fn row(&mut self) -> Result<Option<LogRow>, LogError> {
        while self.table.next_row()? {
            if self.table.begins_anew {
                self.order.begin_anew();
            }
            let (cells, line) = (&self.table.row, self.table.lines.line);
            let movement = self.reader.movement(cells);
            let known = movement.as_ref().map_or(None, |movement| *movement);
            let row = match movement.and_then(|_| self.reader.t_us(cells)) {
                Ok(t_us) => {
                    self.order.take(&self.table.head, line, known, t_us)?;
                    self.reader.row(cells, t_us as i64)
                }
                Err(bad) => Err(bad),
            };
            match row {
                Ok(row) => {
                    let place = self.order.keep();
                    if place.begins {
                        self.skipped.keep(place.movement);
                    }
                    return Ok(Some(LogRow {
                        movement: place.movement,
                        begins: place.begins,
                        row: Row {
                            frame: row.frame.with_sequence(place.sequence),
                            ..row
                        },
                    }));
                }
                Err(bad) => self.leave_out(bad, known)?,
            }
        }
        Ok(None)
    }

    fn leave_out(&mut self, bad: BadCell, movement: Option<i64>) -> Result<(), LogError> {
        let (table, BadCell { cell, fault }) = (&self.table, bad);
        let place = || table.head.place(table.row_line(), cell, movement);
        match self.options.bad_rows {
            BadRows::Refuse => Err(place().refuse(fault.into())),
            BadRows::Skip => {
                self.skipped.add(fault, movement, place);
                Ok(())
            }
        }
    }

    /// The warnings of a log that was read to its end.
    ///
    /// # Errors
    /// `HeaderOnly`, `NoGoodRows`.
    pub fn end(mut self) -> Result<LogEnd, LogError> {
        let (head, order) = (self.table.head, &mut self.order);
        let path = head.path.as_path();
        let skipped_rows = self.skipped.rows();
        if order.movements == 0 {
            return Err(self.skipped.nothing_left(path, head.line));
        }
        let columns = &self.reader.columns;
        let mut warnings = Vec::new();
        let file = path.display().to_string();
        if let Some(line) = self.table.open_line {
            let file = file.clone();
            warnings.push(Finding::new(Kind::FileCut { file, line }));
        }
        if !columns.unknown.is_empty() {
            warnings.push(Finding::new(Kind::ColumnsLeftOut {
                file: file.clone(),
                columns: columns.unknown.clone(),
            }));
        }
        if columns.movement.is_none() {
            warnings.push(Finding::new(Kind::MovementsByTime {
                file: file.clone(),
                movements: order.movements,
                gap_rows: GAP_PERIODS as i64,
            }));
        }
        let mean_codes = self.reader.between_codes();
        if mean_codes > BETWEEN_CODES {
            let file = file.clone();
            warnings.push(Finding::new(Kind::BetweenCodes { file, mean_codes }));
        }
        warnings.extend(self.skipped.findings(&file));
        if let Some((first, movements)) = order.end_movement() {
            warnings.push(Finding::new(Kind::SingleRows {
                file,
                first,
                movements,
            }));
        }
        Ok(LogEnd {
            skipped_rows,
            has_reference: columns.reference.is_some(),
            warnings,
            hashes: self.table.lines.into_hashes(),
            path: head.path,
        })
    }
}
