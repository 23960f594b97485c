//! A block of a log into rows, apart from what the rows above it say.

use super::BadRows;
use super::blocks::Block;
use super::cursor::Cursor;
use super::error::LogError;
use super::rows::{BadCell, BetweenCodes, RowReader};
use super::table::{Head, pointed};
use super::time::Clock;
use crate::input::whole::chunk::Sample;

/// A row of a log, with what is asked for of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LogRow<T> {
    /// Number of its movement.
    pub movement: i64,
    /// Time within the log, us.
    pub t_us: i64,
    /// What is asked for.
    pub item: T,
    /// Number of the servo period within the movement, from 0: by time, so a gap in the log shows as
    /// frames missed.
    pub sequence: u32,
    /// Whether a movement begins with it.
    pub begins: bool,
    /// Its line, from the first of its block.
    pub(super) line: u32,
}

/// A row that has a bad cell.
pub(super) struct BadRow {
    /// How many good rows of the block stand above it.
    pub(super) at: usize,
    /// Its line, from 1.
    pub(super) line: usize,
    /// Its movement, if it could be read and the log has a column for it.
    pub(super) movement: Option<i64>,
    /// Its time, if it could be read.
    pub(super) t_us: Option<i64>,
    pub(super) bad: BadCell,
}

/// The rows of a block. Where the log has no column for the movement, that of all rows is 0.
pub(super) struct Parsed<T> {
    pub(super) block: Block,
    pub(super) rows: Vec<LogRow<T>>,
    pub(super) bad: Vec<BadRow>,
    /// What is wrong with the line after these rows.
    pub(super) fault: Option<LogError>,
    /// The line of a row at the end of the log that no line break follows.
    pub(super) open_line: Option<usize>,
    pub(super) between_codes: BetweenCodes,
    /// How the times are written.
    pub(super) clock: Clock,
}

/// Bytes of a short row, for the memory that is set apart.
const ROW_BYTES: usize = 32;

/// Reads a block, up to the first bad row if such rows are refused.
pub(super) fn parse<T>(
    block: Block,
    head: &Head,
    mut reader: RowReader<'_>,
    bad_rows: BadRows,
    make: impl Fn(&Sample) -> T,
) -> Parsed<T> {
    let mut rows = Vec::with_capacity(block.text.len() / ROW_BYTES);
    let (mut bad_found, mut open_line, mut fault) = (Vec::new(), None, None);
    let mut cursor = Cursor::new(block.line);
    while let Some(found) = cursor.next(&block.text, head.dialect) {
        let (cells, line) = (found.cells, found.line);
        if found.is_open {
            open_line = Some(line);
        }
        if let Err(error) = head.check_row(&cells, line, found.is_open) {
            fault = Some(error);
            break;
        }
        let (mut movement, mut t_us) = (None, None);
        let mut read = || {
            if let Some(cell) = cells.pointed {
                let fault = pointed(cells.cell(cell));
                return Err(BadCell { cell, fault });
            }
            movement = reader.movement(&cells)?;
            let time_us = reader.t_us(&cells)?;
            t_us = Some(time_us);
            let sample = reader.sample(&cells, time_us)?;
            Ok(LogRow {
                movement: movement.unwrap_or(0),
                t_us: time_us,
                item: make(&sample),
                sequence: 0,
                begins: false,
                line: (line - block.line) as u32,
            })
        };
        match read() {
            Ok(row) => rows.push(row),
            Err(bad) => {
                bad_found.push(BadRow {
                    at: rows.len(),
                    line,
                    movement,
                    t_us,
                    bad,
                });
                if bad_rows == BadRows::Refuse {
                    break;
                }
            }
        }
    }
    Parsed {
        rows,
        bad: bad_found,
        fault,
        open_line,
        between_codes: reader.between_codes,
        clock: reader.clock,
        block,
    }
}
