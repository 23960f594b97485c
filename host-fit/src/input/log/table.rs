//! A log as a table: named columns, then rows of cells, each with its place in the file.
//!
//! This is the seam for other formats. Whatever reads logs and references sees a table only
//! through [`Table`]; CSV is the one format behind it today. Columns may be fewer than a log
//! of `fit` has: which of them are needed is decided in [`super::header`].

use super::cell::shown;
use super::decimal;
use super::error::{CellPlace, LogError};
use super::preamble::{self, COMMENT};
use super::units;
use crate::input::source::SourceError;
use csv::ByteRecord;
use std::path::Path;

/// Written at the start of UTF-8 files by some programs.
pub(crate) const BYTE_ORDER_MARK: &[u8] = b"\xef\xbb\xbf";

/// Longest unit in a row of units, in characters, with brackets.
const UNIT_CHARACTERS: usize = 10;

/// A table, one row in hand at a time.
pub(crate) struct Table<'a> {
    pub(crate) path: &'a Path,
    bytes: &'a [u8],
    names: Vec<String>,
    /// Units of the columns, where a row below the header holds them.
    units: Vec<String>,
    header_byte: u64,
    /// Where the rows begin.
    rows_byte: u64,
    reader: csv::Reader<&'a [u8]>,
    decimal_commas: bool,
    row: ByteRecord,
    row_byte: u64,
    /// Whether the row in hand was read ahead and is still to be taken.
    ahead: bool,
}

impl<'a> Table<'a> {
    /// Finds and reads the header; `bytes` are UTF-8 or at least hold ASCII as such, `path` is only
    /// named in errors.
    ///
    /// Cells are separated by commas, semicolons or tabs, whichever the header has most;
    /// lines end in LF or CRLF, a line that starts with `#` is a comment, blank lines are
    /// skipped. Notes may stand above the header, which is told by the names of columns that are known, and a
    /// row of units below it. Numbers may have decimal commas where commas do not separate cells.
    ///
    /// # Errors
    /// `Empty`, `NoHeader`, `NoSeparator`.
    pub(crate) fn open(
        path: &'a Path,
        bytes: &'a [u8],
        is_known: impl Fn(&str) -> bool,
    ) -> Result<Self, LogError> {
        let bytes = bytes.strip_prefix(BYTE_ORDER_MARK).unwrap_or(bytes);
        let header = preamble::find_header(bytes, is_known).ok_or_else(|| LogError::Empty {
            path: path.to_path_buf(),
        })?;
        let rows = bytes.get(header.end..).unwrap_or_default();
        let reader = csv::ReaderBuilder::new()
            .has_headers(false)
            .flexible(true)
            // Without line feeds a comment would go on to the end.
            .comment(bytes.contains(&b'\n').then_some(COMMENT))
            .delimiter(header.separator)
            .from_reader(rows);
        let mut table = Self {
            path,
            bytes,
            names: header.names,
            units: Vec::new(),
            header_byte: header.start as u64,
            rows_byte: header.end as u64,
            reader,
            decimal_commas: decimal::has_decimal_commas(rows, header.separator),
            row: ByteRecord::new(),
            row_byte: 0,
            ahead: false,
        };
        table.check_names()?;
        table.ahead = table.advance()?;
        if table.ahead && units_row(&table.row) {
            table.units = table.row.iter().map(preamble::text).collect();
            table.ahead = false;
            table.ahead = table.advance()?;
        }
        Ok(table)
    }

    fn check_names(&self) -> Result<(), LogError> {
        let (path, line) = (self.path.to_path_buf(), self.header_line());
        if preamble::is_numeric(&self.names) {
            return Err(LogError::NoHeader { path, line });
        }
        match self.names.as_slice() {
            [one] => Err(LogError::NoSeparator {
                path,
                line,
                text: shown(one.as_bytes()),
            }),
            _ => Ok(()),
        }
    }

    /// Whether its numbers have decimal commas.
    pub(crate) const fn has_decimal_commas(&self) -> bool {
        self.decimal_commas
    }

    /// For a part of a text whose other parts tell that.
    pub(crate) const fn set_decimal_commas(&mut self, known: bool) {
        self.decimal_commas |= known;
    }

    /// Names of the columns, without white space around them.
    pub(crate) fn names(&self) -> &[String] {
        &self.names
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

    /// A cell of the first row, from 0; empty if there is none, or if it is past.
    pub(crate) fn first_cell(&self, cell: usize) -> &[u8] {
        match self.ahead {
            true => self.cell(cell),
            false => &[],
        }
    }

    /// The line of the header, from 1.
    pub(crate) fn header_line(&self) -> usize {
        self.line_at(usize::try_from(self.header_byte).unwrap_or(usize::MAX))
    }

    /// Takes the next row in hand; `false` at the end.
    ///
    /// # Errors
    /// `CellCount`, `CutLine`.
    pub(crate) fn next_row(&mut self) -> Result<bool, LogError> {
        if !self.advance()? {
            return Ok(false);
        }
        let (expected, found) = (self.names.len(), self.row.len());
        let last_is_empty = self.cell(found.saturating_sub(1)).is_empty();
        let short = found < expected || (found == expected && last_is_empty);
        let (path, line) = (self.path, || self.line(self.row_byte));
        if short && self.is_open_end() {
            return Err(LogError::CutLine {
                path: path.to_path_buf(),
                line: line(),
                expected,
                found: found - usize::from(last_is_empty),
            });
        }
        if found == expected {
            return Ok(true);
        }
        Err(LogError::CellCount {
            path: path.to_path_buf(),
            line: line(),
            expected,
            found,
        })
    }

    /// A cell of the row in hand, from 0; empty if there is none.
    pub(crate) fn cell(&self, cell: usize) -> &[u8] {
        self.row.get(cell).unwrap_or_default()
    }

    /// Where the row in hand starts, for [`Table::place`] and [`Table::line`].
    pub(crate) const fn row_byte(&self) -> u64 {
        self.row_byte
    }

    /// The length of the whole text.
    pub(crate) const fn bytes(&self) -> u64 {
        self.bytes.len() as u64
    }

    /// A cell of the row that starts at `byte`, for messages.
    pub(crate) fn place(&self, byte: u64, cell: usize, movement: Option<i64>) -> Box<CellPlace> {
        Box::new(CellPlace {
            path: self.path.to_path_buf(),
            line: self.line(byte),
            column: cell + 1,
            name: self.names.get(cell).cloned().unwrap_or_default(),
            movement,
        })
    }

    /// The line, from 1, of the first row at or after `byte`. The CSV reader's own place
    /// of a row lies before the blank lines and comments above it.
    pub(crate) fn line(&self, byte: u64) -> usize {
        let mut at = usize::try_from(byte)
            .unwrap_or(usize::MAX)
            .min(self.bytes.len());
        while let Some(first) = self.bytes.get(at) {
            match *first {
                b'\n' | b'\r' => at += 1,
                COMMENT => {
                    let rest = self.bytes.get(at..).unwrap_or_default();
                    match rest.iter().position(|b| *b == b'\n') {
                        Some(end) => at += end,
                        // No comment: see `open`.
                        None => break,
                    }
                }
                _ => break,
            }
        }
        self.line_at(at)
    }

    /// The line of a byte, from 1.
    fn line_at(&self, at: usize) -> usize {
        let before = self.bytes.get(..at).unwrap_or_default();
        // A lone carriage return ends a line too.
        let breaks = before.iter().enumerate().filter(|(k, b)| match **b {
            b'\n' => true,
            b'\r' => self.bytes.get(k + 1) != Some(&b'\n'),
            _ => false,
        });
        1 + breaks.count()
    }

    /// Whether the last line is a row and no line break follows it.
    pub(crate) fn is_open(&self) -> bool {
        let mut lines = self.bytes.rsplit(|b| *b == b'\n' || *b == b'\r');
        let last = lines.next().unwrap_or_default();
        !last.trim_ascii().is_empty() && !last.starts_with(&[COMMENT])
    }

    /// Whether the row in hand is the last, and no line break follows it.
    fn is_open_end(&self) -> bool {
        let end = self.rows_byte + self.reader.position().byte();
        self.is_open() && end >= self.bytes.len() as u64
    }

    /// Reads the next record that is not blank; `false` at the end.
    fn advance(&mut self) -> Result<bool, LogError> {
        if std::mem::take(&mut self.ahead) {
            return Ok(true);
        }
        loop {
            let more = self.reader.read_byte_record(&mut self.row);
            let more = more.map_err(|error| SourceError::Unreadable {
                path: self.path.to_path_buf(),
                source: error.into(),
            })?;
            if !more {
                return Ok(false);
            }
            let blank = self.row.len() == 1 && self.cell(0).trim_ascii().is_empty();
            if !blank {
                let byte = self.row.position().map_or(0, csv::Position::byte);
                self.row_byte = self.rows_byte + byte;
                if self.decimal_commas {
                    self.row = self.row.iter().map(decimal::with_point).collect();
                }
                return Ok(true);
            }
        }
    }
}

/// Whether a row holds the units of the columns: no number, at least two units, and nothing as
/// long as a remark.
fn units_row(row: &ByteRecord) -> bool {
    let cells: Vec<String> = row.iter().map(preamble::text).collect();
    let inside = |cell: &str| cell.trim_matches(['[', ']', '(', ')']).to_owned();
    let known = |cell: &&String| units::is_known(&inside(cell));
    let is_number = |cell: &String| cell.parse::<f64>().is_ok();
    !cells.iter().any(is_number)
        && cells
            .iter()
            .all(|cell| cell.chars().count() <= UNIT_CHARACTERS)
        && cells.iter().filter(known).count() >= 2
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_is_placed_at_its_own_line_whatever_stands_above_it() {
        for end in ["\n", "\r\n"] {
            let text = ["# a note", "", "a,b", "# more", "1,2", "", "", "3,4"].join(end);
            let mut table =
                Table::open(Path::new("x"), text.as_bytes(), |_| false).expect("a table");
            let mut lines = vec![table.header_line()];
            while table.next_row().expect("sound") {
                lines.push(table.line(table.row_byte()));
            }
            assert_eq!(lines, [3, 5, 8], "{end:?}");
        }
        // The last line of a table without line feeds is no comment, and no row.
        let text = "# a note\r\ra,b\r1,2\r# more\r".as_bytes();
        let mut table = Table::open(Path::new("x"), text, |_| false).expect("a table");
        assert_eq!(
            (table.header_line(), table.next_row().ok()),
            (3, Some(true))
        );
        assert!(matches!(
            table.next_row(),
            Err(LogError::CellCount { line: 5, .. })
        ));
    }
}
