//! The text of a log: its records, and the line of each.

use super::error::LogError;
use csv::ByteRecord;
use std::path::Path;

/// Starts a comment, as the first byte of a line.
const COMMENT: u8 = b'#';
/// Written at the start of UTF-8 files by some programs.
const BYTE_ORDER_MARK: &[u8] = b"\xef\xbb\xbf";

/// The text of one log.
pub(super) struct Text<'a> {
    pub(super) path: &'a Path,
    bytes: &'a [u8],
}

impl<'a> Text<'a> {
    pub(super) fn new(path: &'a Path, bytes: &'a [u8]) -> Self {
        let bytes = bytes.strip_prefix(BYTE_ORDER_MARK).unwrap_or(bytes);
        Self { path, bytes }
    }

    /// The records, header first.
    pub(super) fn records(&'a self) -> Result<Records<'a>, LogError> {
        let line = |line: &&[u8]| !line.trim_ascii().is_empty() && !line.starts_with(&[COMMENT]);
        let mut lines = self.bytes.split(|b| *b == b'\n' || *b == b'\r');
        let header = lines.find(line).ok_or_else(|| LogError::Empty {
            path: self.path.to_path_buf(),
        })?;
        let reader = csv::ReaderBuilder::new()
            .has_headers(false)
            .flexible(true)
            .comment(Some(COMMENT))
            .delimiter(separator(header))
            .from_reader(self.bytes);
        Ok(Records {
            text: self,
            reader,
            record: ByteRecord::new(),
            byte: 0,
        })
    }

    /// The line, from 1, of the first record at or after `byte`. The CSV reader's own place
    /// of a record lies before the blank lines and comments above it.
    pub(super) fn line(&self, byte: u64) -> usize {
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

    /// Whether the last line is a record and no line break follows it.
    pub(super) fn is_open(&self) -> bool {
        let mut lines = self.bytes.rsplit(|b| *b == b'\n' || *b == b'\r');
        let last = lines.next().unwrap_or_default();
        !last.trim_ascii().is_empty() && !last.starts_with(&[COMMENT])
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

/// The records of a text, one at a time.
pub(super) struct Records<'a> {
    text: &'a Text<'a>,
    reader: csv::Reader<&'a [u8]>,
    /// The record in hand: cells as bytes, of any number.
    pub(super) record: ByteRecord,
    /// Where it starts, for [`Text::line`].
    pub(super) byte: u64,
}

impl Records<'_> {
    /// Reads the next record that is not blank; `false` at the end.
    pub(super) fn advance(&mut self) -> Result<bool, LogError> {
        loop {
            let more = self.reader.read_byte_record(&mut self.record);
            let more = more.map_err(|error| LogError::Unreadable {
                path: self.text.path.to_path_buf(),
                source: error.into(),
            })?;
            if !more {
                return Ok(false);
            }
            let blank = self.record.len() == 1 && self.cell(0).trim_ascii().is_empty();
            if !blank {
                self.byte = self.record.position().map_or(0, csv::Position::byte);
                return Ok(true);
            }
        }
    }

    /// A cell of the record in hand; empty if there is none.
    pub(super) fn cell(&self, cell: usize) -> &[u8] {
        self.record.get(cell).unwrap_or_default()
    }

    /// The line of the record in hand.
    pub(super) fn line(&self) -> usize {
        self.text.line(self.byte)
    }

    /// Whether the record in hand is the last, and no line break follows it.
    pub(super) fn is_open_end(&self) -> bool {
        self.text.is_open() && self.reader.position().byte() >= self.text.bytes.len() as u64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_record_is_placed_at_its_own_line_whatever_stands_above_it() {
        for end in ["\n", "\r\n", "\r"] {
            let text = ["# a note", "", "a,b", "# more", "1,2", "", "", "3,4"].join(end);
            let text = Text::new(Path::new("x"), text.as_bytes());
            let mut records = text.records().expect("not empty");
            let mut lines = Vec::new();
            while records.advance().expect("in memory") {
                lines.push(records.line());
            }
            // A comment ends only at a line feed, so in a text without any there is none.
            let expected: &[usize] = if end == "\r" { &[] } else { &[3, 5, 8] };
            assert_eq!(lines, expected, "{end:?}");
        }
    }
}
