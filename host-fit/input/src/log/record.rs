//! One line of a table, taken apart into cells.
//!
//! A cell that begins with a quotation mark ends with the next one and may hold separators; two
//! marks in it stand for one. No cell goes on in the next line: a mark that is not closed in its
//! line, as a ditto mark, is text.

use super::cell::Cell;
use super::decimal::NumberForm;
use csv_core::{ReadRecordResult, Reader, ReaderBuilder};

/// White space of any length separates cells.
pub(super) const WHITE_SPACE: u8 = b' ';

/// The cells of the line in hand.
pub(super) struct Record {
    pub(super) separator: u8,
    numbers: NumberForm,
    /// The second one takes quotation marks as text.
    readers: [Reader; 2],
    text: Vec<u8>,
    /// Where the first cell starts and where each ends in the text.
    ends: Vec<usize>,
    cells: usize,
}

impl Record {
    /// Of a table, without a line.
    pub(super) fn new(separator: u8, numbers: NumberForm) -> Self {
        let mut builder = ReaderBuilder::new();
        builder.delimiter(separator);
        Self {
            separator,
            numbers,
            readers: [builder.build(), builder.quoting(false).build()],
            text: Vec::new(),
            ends: vec![0; 16],
            cells: 0,
        }
    }

    /// Takes a line without its break in hand.
    pub(super) fn split(&mut self, line: &[u8]) {
        if self.separator == WHITE_SPACE {
            let mut words = line.to_vec();
            words.dedup_by(|next, before| *next == WHITE_SPACE && *before == WHITE_SPACE);
            self.split_at_each(words.trim_ascii());
        } else {
            self.split_at_each(line);
        }
    }

    /// Takes a line apart at each separator.
    fn split_at_each(&mut self, line: &[u8]) {
        if !self.fill(line, 0) {
            self.fill(line, 1);
        }
    }

    /// Whether the record ends with the line: no quotation mark is left open.
    fn fill(&mut self, line: &[u8], reader: usize) -> bool {
        let reader = &mut self.readers[reader];
        if self.text.len() <= line.len() {
            self.text.resize(line.len() + 1, 0);
        }
        let (mut written, mut is_over) = (0, false);
        self.cells = 0;
        for mut rest in [line, b"\n"] {
            while !rest.is_empty() && !is_over {
                let text = self.text.get_mut(written..).unwrap_or_default();
                let ends = self.ends.get_mut(self.cells + 1..).unwrap_or_default();
                let (result, read, wrote, ended) = reader.read_record(rest, text, ends);
                rest = rest.get(read..).unwrap_or_default();
                written += wrote;
                self.cells += ended;
                match result {
                    ReadRecordResult::InputEmpty => {}
                    ReadRecordResult::OutputFull => self.text.resize(2 * self.text.len(), 0),
                    ReadRecordResult::OutputEndsFull => self.ends.resize(2 * self.ends.len(), 0),
                    ReadRecordResult::Record | ReadRecordResult::End => is_over = true,
                }
            }
        }
        reader.reset();
        is_over
    }

    /// How many cells it has.
    pub(super) const fn len(&self) -> usize {
        self.cells
    }

    /// A cell, from 0; empty if there is none.
    #[inline]
    pub(super) fn cell(&self, cell: usize) -> Cell<'_> {
        let text = match self.ends.get(cell..cell + 2) {
            Some([start, end]) if cell < self.cells => self.text.get(*start..*end),
            _ => None,
        };
        Cell {
            text: text.unwrap_or_default(),
            numbers: self.numbers,
        }
    }

    /// All cells.
    pub(super) fn cells(&self) -> impl Iterator<Item = Cell<'_>> {
        (0..self.cells).map(|cell| self.cell(cell))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_may_be_quoted_and_a_mark_that_is_not_closed_is_text() {
        let mut record = Record::new(b',', NumberForm::default());
        for (text, want) in [
            ("a,b", &["a", "b"][..]),
            (",", &["", ""]),
            ("\"a,b\",c", &["a,b", "c"]),
            ("\"a\"\"b\",\"\"", &["a\"b", ""]),
            ("\"a\"b,c", &["ab", "c"]),
            (" \"a,b", &[" \"a", "b"]),
            ("1,\",2", &["1", "\"", "2"]),
            ("\"\"\",2", &["\"\"\"", "2"]),
            ("1,2,\"", &["1", "2", "\""]),
            ("\"1\",\"2", &["\"1\"", "\"2"]),
        ] {
            record.split(text.as_bytes());
            let cells: Vec<&[u8]> = record.cells().map(|cell| cell.text).collect();
            let want: Vec<&[u8]> = want.iter().map(|cell| cell.as_bytes()).collect();
            assert_eq!(cells, want, "{text:?}");
            assert_eq!(record.cell(want.len()).text, b"", "there is none");
        }
        let many = ",".repeat(1000);
        record.split(many.as_bytes());
        assert_eq!(record.len(), 1001);
        let mut spaced = Record::new(WHITE_SPACE, NumberForm::default());
        spaced.split(b"  1  -2   \"a b\" ");
        let cells: Vec<&[u8]> = spaced.cells().map(|cell| cell.text).collect();
        assert_eq!(cells, [&b"1"[..], b"-2", b"a b"]);
    }
}
