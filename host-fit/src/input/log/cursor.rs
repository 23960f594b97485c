//! Goes from row to row of a text.

use super::line::{Dialect, Line, Splitter};
use super::preamble::COMMENT;

/// Where the next row is looked for.
#[derive(Debug, Default)]
pub(super) struct Cursor {
    /// The first byte of the next line, or of the end of the last.
    pub(super) at: usize,
    /// Its number, from 1.
    pub(super) line: usize,
    splitter: Splitter,
}

/// A line that is neither blank nor a comment.
pub(super) struct RowText<'a> {
    pub(super) cells: Line<'a>,
    /// The number of its line, from 1.
    pub(super) line: usize,
    /// Whether the text ends with it, without a line break.
    pub(super) is_open: bool,
}

impl Cursor {
    /// At the start of a text whose first line has this number.
    pub(super) fn new(line: usize) -> Self {
        Self {
            line,
            ..Self::default()
        }
    }

    /// The next row of `text`; `None` at its end.
    pub(super) fn next<'a>(&'a mut self, text: &'a [u8], dialect: Dialect) -> Option<RowText<'a>> {
        loop {
            let rest = text.get(self.at..)?;
            match rest {
                [] => return None,
                [b'\n', ..] => (self.at, self.line) = (self.at + 1, self.line + 1),
                [b'\r', after, ..] => {
                    self.line += usize::from(*after != b'\n');
                    self.at += 1;
                }
                [b'\r'] => (self.at, self.line) = (self.at + 1, self.line + 1),
                [COMMENT, ..] => self.at += length_of_line(rest),
                [b' ' | b'\t' | 0x0b | 0x0c, ..] => {
                    let length = length_of_line(rest);
                    let line = rest.get(..length).unwrap_or(rest);
                    if !line.trim_ascii().is_empty() || line.contains(&dialect.separator) {
                        break;
                    }
                    self.at += length;
                }
                _ => break,
            }
        }
        let (cells, length) = self.splitter.split(text.get(self.at..)?, dialect);
        self.at += length;
        Some(RowText {
            cells,
            line: self.line,
            is_open: self.at == text.len(),
        })
    }
}

fn length_of_line(text: &[u8]) -> usize {
    let ends = |byte: &u8| matches!(byte, b'\n' | b'\r');
    text.iter().position(ends).unwrap_or(text.len())
}
