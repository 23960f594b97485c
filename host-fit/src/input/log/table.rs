//! A log as a table: named columns, then rows of cells, each with its place in the file.
//!
//! This is the seam for other formats. Whatever reads logs and references sees a table only
//! through [`Head`] and [`Table`]; CSV is the one format behind them today. Columns may be fewer
//! than a log of `fit` has: which of them are needed is decided in [`super::header`].

use super::blocks::{Block, Blocks};
use super::cell::{CellFault, shown};
use super::cursor::{Cursor, RowText};
use super::decimal;
use super::error::{CellPlace, LogError};
use super::line::{Dialect, Line};
use super::preamble;
use super::units;
use crate::input::text::TextReader;
use std::path::{Path, PathBuf};

/// Longest unit in a row of units, in characters, with brackets.
const UNIT_CHARACTERS: usize = 10;

/// Most columns of a table. What has more is damaged or hostile.
pub(super) const COLUMNS_MAX: usize = 4096;

/// What stands above the rows of a table.
#[derive(Debug)]
pub(crate) struct Head {
    pub(crate) path: PathBuf,
    /// The line of the header, from 1.
    pub(crate) line: usize,
    /// Names of the columns, without white space around them.
    pub(crate) names: Vec<String>,
    /// Units of the columns, where a row below the header holds them.
    units: Vec<String>,
    /// The cells of the first row.
    first: Vec<Vec<u8>>,
    /// How its rows are written.
    pub(super) dialect: Dialect,
}

impl Head {
    /// Finds and reads what stands above the rows, which are then the next of `blocks`.
    ///
    /// Cells are separated by commas, semicolons or tabs, whichever the header has most;
    /// lines end in LF, CRLF or CR, a line that starts with `#` is a comment, blank lines are
    /// skipped. Notes may stand above the header, which is told by the names of columns that are
    /// known, and a row of units below it. Numbers may have decimal commas where commas do not
    /// separate cells. All this is told from the first mebibyte of the text.
    ///
    /// # Errors
    /// Those of reading, `Empty`, `NoHeader`, `NoSeparator`, `TooManyColumns`, `LineTooLong`.
    pub(super) fn read(
        blocks: &mut Blocks<'_>,
        path: &Path,
        is_known: impl Fn(&str) -> bool,
    ) -> Result<Self, LogError> {
        let path = path.to_path_buf();
        let opening = blocks.opening()?;
        let Some(header) = preamble::find_header(opening, is_known) else {
            return Err(LogError::Empty { path });
        };
        let rows = opening.get(header.end..).unwrap_or_default();
        let dialect = Dialect {
            separator: header.separator,
            decimal_commas: decimal::has_decimal_commas(rows, header.separator),
        };
        let line = header.line;
        check_names(&header.names, &path, line)?;
        let (mut units, mut first) = (Vec::new(), Vec::new());
        let (mut cursor, mut units_end) = (Cursor::default(), 0);
        while let Some(row) = cursor.next(rows, dialect) {
            let cells = row.cells;
            if units.is_empty() && is_units(&cells) {
                units = texts(&cells);
                units_end = cursor.at;
            } else {
                first = (0..cells.len()).map(|k| cells.cell(k).to_vec()).collect();
                break;
            }
        }
        blocks.skip(header.end + units_end);
        Ok(Self {
            path,
            line,
            names: header.names,
            units,
            first,
            dialect,
        })
    }

    /// The unit that a row below the header gives for a column, from 0; empty if it gives none.
    pub(crate) fn unit(&self, column: usize) -> &str {
        let unit = self.units.get(column).map_or("", String::as_str);
        let inside = unit
            .strip_prefix('[')
            .and_then(|unit| unit.strip_suffix(']'));
        let inside = inside.or_else(|| unit.strip_prefix('(')?.strip_suffix(')'));
        inside.unwrap_or(unit)
    }

    /// A cell of the first row, from 0; empty if there is none.
    pub(crate) fn first_cell(&self, cell: usize) -> &[u8] {
        self.first.get(cell).map_or(&[], Vec::as_slice)
    }

    /// A cell of the row in this line, for messages.
    pub(crate) fn place(&self, line: usize, cell: usize, movement: Option<i64>) -> Box<CellPlace> {
        Box::new(CellPlace {
            path: self.path.clone(),
            line,
            column: cell + 1,
            name: self.names.get(cell).cloned().unwrap_or_default(),
            movement,
        })
    }

    /// Refuses a row with too few or too many cells; `is_open` tells that no line break follows it.
    ///
    /// # Errors
    /// `CellCount`, `CutLine`.
    #[inline]
    pub(super) fn check_row(
        &self,
        row: &Line<'_>,
        line: usize,
        is_open: bool,
    ) -> Result<(), LogError> {
        match row.len() == self.names.len() && !is_open {
            true => Ok(()),
            false => self.check_odd_row(row, line, is_open),
        }
    }

    #[cold]
    fn check_odd_row(&self, row: &Line<'_>, line: usize, is_open: bool) -> Result<(), LogError> {
        let (expected, found) = (self.names.len(), row.len());
        let last_is_empty = row.cell(found.saturating_sub(1)).is_empty();
        let path = self.path.clone();
        if is_open && (found < expected || (found == expected && last_is_empty)) {
            return Err(LogError::CutLine {
                path,
                line,
                expected,
                found: found - usize::from(last_is_empty),
            });
        }
        if found == expected {
            return Ok(());
        }
        Err(LogError::CellCount {
            path,
            line,
            expected,
            found,
        })
    }
}

/// What is wrong with a cell that has a decimal point in a table with decimal commas.
pub(super) fn pointed(cell: &[u8]) -> CellFault {
    CellFault::DecimalPoint { text: shown(cell) }
}

fn check_names(names: &[String], path: &Path, line: usize) -> Result<(), LogError> {
    let path = path.to_path_buf();
    if names.len() > COLUMNS_MAX {
        return Err(LogError::TooManyColumns {
            path,
            line,
            limit: COLUMNS_MAX,
        });
    }
    if preamble::is_numeric(names) {
        return Err(LogError::NoHeader { path, line });
    }
    match names {
        [one] => Err(LogError::NoSeparator {
            path,
            line,
            text: shown(one.as_bytes()),
        }),
        _ => Ok(()),
    }
}

fn texts(row: &Line<'_>) -> Vec<String> {
    let text = |cell| preamble::text(row.cell(cell));
    (0..row.len()).map(text).collect()
}

/// Whether a row holds the units of the columns: no number, at least two units, and nothing as
/// long as a remark.
fn is_units(row: &Line<'_>) -> bool {
    let cells = texts(row);
    let inside = |cell: &str| cell.trim_matches(['[', ']', '(', ')']).to_owned();
    let known = |cell: &&String| units::is_known(&inside(cell));
    let is_number = |cell: &String| cell.parse::<f64>().is_ok();
    !cells.iter().any(is_number)
        && cells
            .iter()
            .all(|cell| cell.chars().count() <= UNIT_CHARACTERS)
        && cells.iter().filter(known).count() >= 2
}

/// A table, one row in hand at a time.
pub(crate) struct Table<'a> {
    pub(crate) head: Head,
    blocks: Blocks<'a>,
    block: Block,
    cursor: Cursor,
    row: Vec<Vec<u8>>,
    row_line: usize,
}

impl<'a> Table<'a> {
    /// Opens a table: see [`Head::read`].
    ///
    /// # Errors
    /// Those of [`Head::read`].
    pub(crate) fn open(
        text: TextReader<'a>,
        is_known: impl Fn(&str) -> bool,
    ) -> Result<Self, LogError> {
        let path = text.path().to_path_buf();
        let mut blocks = Blocks::new(text);
        Ok(Self {
            head: Head::read(&mut blocks, &path, is_known)?,
            blocks,
            block: Block::default(),
            cursor: Cursor::default(),
            row: Vec::new(),
            row_line: 0,
        })
    }

    /// Takes the next row in hand; `false` at the end.
    ///
    /// # Errors
    /// Those of reading, `LineTooLong`, `CellCount`, `CutLine`, and of a number with a decimal
    /// point in a table with decimal commas.
    pub(crate) fn next_row(&mut self) -> Result<bool, LogError> {
        loop {
            if let Some(row) = self.cursor.next(&self.block.text, self.head.dialect) {
                let RowText {
                    cells,
                    line,
                    is_open,
                } = row;
                self.head.check_row(&cells, line, is_open)?;
                if let Some(cell) = cells.pointed {
                    return Err(LogError::Cell {
                        place: self.head.place(line, cell, None),
                        fault: pointed(cells.cell(cell)),
                    });
                }
                self.row = (0..cells.len()).map(|k| cells.cell(k).to_vec()).collect();
                self.row_line = line;
                return Ok(true);
            }
            match self.blocks.next()? {
                None => return Ok(false),
                Some(block) => {
                    self.cursor = Cursor::new(block.line);
                    self.block = block;
                }
            }
        }
    }

    /// A cell of the row in hand, from 0; empty if there is none.
    pub(crate) fn cell(&self, cell: usize) -> &[u8] {
        self.row.get(cell).map_or(&[], Vec::as_slice)
    }

    /// The line of the row in hand, from 1.
    pub(crate) const fn row_line(&self) -> usize {
        self.row_line
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_is_placed_at_its_own_line_whatever_stands_above_it() {
        for end in ["\n", "\r\n", "\r"] {
            let text = [
                "# a note", "", "a,b", "# more", "1,2", "", "", "3,4", "# end",
            ]
            .join(end);
            let reader = TextReader::of_bytes(text.as_bytes(), Path::new("x")).expect("text");
            let mut table = Table::open(reader, |_| false).expect("a table");
            let mut lines = vec![table.head.line];
            while table.next_row().expect("sound") {
                lines.push(table.row_line());
            }
            assert_eq!(lines, [3, 5, 8], "{end:?}");
        }
    }
}
