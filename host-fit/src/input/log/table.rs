//! A log as a table: named columns, then rows of cells, each with its place in the file.
//!
//! This is the seam for other formats. Whatever reads logs and references sees a table only
//! through [`Table`]; CSV is the one format behind it today. Columns may be fewer than a log
//! of `fit` has: which of them are needed is decided in [`super::header`].

use super::cell::shown;
use super::error::{CellPlace, LogError};
use crate::input::source::SourceError;
use csv::ByteRecord;
use std::path::Path;

/// Starts a comment, as the first byte of a line.
const COMMENT: u8 = b'#';
/// Written at the start of UTF-8 files by some programs.
const BYTE_ORDER_MARK: &[u8] = b"\xef\xbb\xbf";

/// A table, one row in hand at a time.
pub(crate) struct Table<'a> {
    pub(crate) path: &'a Path,
    bytes: &'a [u8],
    names: Vec<String>,
    header_line: usize,
    reader: csv::Reader<&'a [u8]>,
    row: ByteRecord,
    row_byte: u64,
}

impl<'a> Table<'a> {
    /// Reads the header; `path` is only named in errors.
    ///
    /// Cells are separated by commas, semicolons or tabs, whichever the header has most;
    /// lines end in LF or CRLF, a line that starts with `#` is a comment, blank lines are
    /// skipped.
    ///
    /// # Errors
    /// `Empty`, `NoHeader`, `NoSeparator`.
    pub(crate) fn open(path: &'a Path, bytes: &'a [u8]) -> Result<Self, LogError> {
        let bytes = bytes.strip_prefix(BYTE_ORDER_MARK).unwrap_or(bytes);
        let empty = || LogError::Empty {
            path: path.to_path_buf(),
        };
        let is_row = |line: &&[u8]| !line.trim_ascii().is_empty() && !line.starts_with(&[COMMENT]);
        let mut lines = bytes.split(|b| *b == b'\n' || *b == b'\r');
        let header = lines.find(is_row).ok_or_else(empty)?;
        let reader = csv::ReaderBuilder::new()
            .has_headers(false)
            .flexible(true)
            .comment(Some(COMMENT))
            .delimiter(separator(header))
            .from_reader(bytes);
        let mut table = Self {
            path,
            bytes,
            names: Vec::new(),
            header_line: 0,
            reader,
            row: ByteRecord::new(),
            row_byte: 0,
        };
        if !table.advance()? {
            return Err(empty());
        }
        table.header_line = table.line(table.row_byte);
        table.take_names()?;
        Ok(table)
    }

    fn take_names(&mut self) -> Result<(), LogError> {
        let name = |cell: &[u8]| String::from_utf8_lossy(cell.trim_ascii()).into_owned();
        self.names = self.row.iter().map(name).collect();
        let (path, line) = (self.path.to_path_buf(), self.header_line);
        if self.names.iter().all(|name| name.parse::<f64>().is_ok()) {
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

    /// Names of the columns, without white space around them.
    pub(crate) fn names(&self) -> &[String] {
        &self.names
    }

    /// The line of the header, from 1.
    pub(crate) const fn header_line(&self) -> usize {
        self.header_line
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
                    let end = rest.iter().position(|b| *b == b'\n');
                    at = end.map_or(self.bytes.len(), |end| at + end);
                }
                _ => break,
            }
        }
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
        self.is_open() && self.reader.position().byte() >= self.bytes.len() as u64
    }

    /// Reads the next record that is not blank; `false` at the end.
    fn advance(&mut self) -> Result<bool, LogError> {
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
                self.row_byte = self.row.position().map_or(0, csv::Position::byte);
                return Ok(true);
            }
        }
    }
}

/// The separator of the cells: of comma, semicolon and tab, the one that the header has most.
fn separator(header: &[u8]) -> u8 {
    let count = |separator: u8| header.iter().filter(|b| **b == separator).count();
    let mut best = b',';
    for candidate in [b';', b'\t'] {
        if count(candidate) > count(best) {
            best = candidate;
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_is_placed_at_its_own_line_whatever_stands_above_it() {
        for end in ["\n", "\r\n"] {
            let text = ["# a note", "", "a,b", "# more", "1,2", "", "", "3,4"].join(end);
            let mut table = Table::open(Path::new("x"), text.as_bytes()).expect("a table");
            let mut lines = vec![table.header_line()];
            while table.next_row().expect("sound") {
                lines.push(table.line(table.row_byte()));
            }
            assert_eq!(lines, [3, 5, 8], "{end:?}");
        }
        // A comment ends only at a line feed, so in a text without any there is nothing else.
        let text = "# a note\r\ra,b\r1,2".as_bytes();
        assert!(matches!(
            Table::open(Path::new("x"), text),
            Err(LogError::Empty { .. })
        ));
    }
}
