//! The lines of a text with their numbers, in little memory however long it is.

use super::error::{LogError, LogProblem, Place};
use crate::source::SourceProblem;
use crate::text::TextReader;
use crate::watch::{Progress, Watch};
use sha2::Sha256;

/// Bytes that are read at once.
const PIECE_BYTES: usize = 128 * 1024;

/// Longest line, bytes. A longer line is damaged or hostile.
pub(crate) const LINE_BYTES_MAX: usize = 1 << 20;

/// Number of bytes that decide the form of a table.
pub(crate) const OPENING_BYTES: usize = 1 << 20;

/// The lines of a text; they end in LF, CRLF or CR.
pub struct Lines<'a> {
    text: TextReader<'a>,
    buffer: Vec<u8>,
    /// The first byte of the next line in the buffer.
    at: usize,
    /// Number of the last line, from 1.
    pub line: usize,
    /// Whether all of the text was read.
    is_whole: bool,
    watch: Watch<'static>,
    progress: Progress,
}

/// A line of a text that is in memory.
pub(super) struct TextLine<'a> {
    /// Without its break.
    pub(super) text: &'a [u8],
    /// Its number, from 1.
    pub(super) line: usize,
    /// The first byte after its break.
    pub(super) end: usize,
}

impl<'a> Lines<'a> {
    /// The lines of a text.
    pub const fn new(text: TextReader<'a>) -> Self {
        Self {
            text,
            buffer: Vec::new(),
            at: 0,
            line: 0,
            is_whole: false,
            watch: Watch::NONE,
            progress: Watch::NONE.begin("", 0),
        }
    }

    /// The same, watched while it is read; `work` is being done with it.
    #[must_use]
    pub fn watched(self, watch: Watch<'static>, work: &'static str) -> Self {
        let (_, bytes) = self.text.progress();
        Self {
            watch,
            progress: watch.begin(work, bytes),
            ..self
        }
    }

    /// The next lines, about a mebibyte, without taking them.
    ///
    /// # Errors
    /// Errors of reading, `LineTooLong`.
    pub(super) fn opening(&mut self) -> Result<&[u8], LogError> {
        while !self.is_whole && self.buffer.len() - self.at < OPENING_BYTES {
            self.fill(OPENING_BYTES)?;
        }
        let rest = self.buffer.get(self.at..).unwrap_or_default();
        if self.is_whole {
            return Ok(rest);
        }
        let last = rest.iter().rposition(|byte| matches!(byte, b'\n' | b'\r'));
        let end = last.ok_or_else(|| self.too_long())? + 1;
        Ok(rest.get(..end).unwrap_or_default())
    }

    /// The next line, without its break; `None` at the end.
    ///
    /// # Errors
    /// Errors of reading, `LineTooLong`.
    pub fn next_line(&mut self) -> Result<Option<&[u8]>, LogError> {
        let line = loop {
            let rest = self.buffer.get(self.at..).unwrap_or_default();
            if let Some((length, taken)) = first_line(rest, self.is_whole) {
                let start = self.at;
                self.at += taken;
                self.line += 1;
                break start..start + length;
            }
            if self.is_whole {
                return Ok(None);
            }
            if rest.len() > LINE_BYTES_MAX {
                return Err(self.too_long());
            }
            self.fill(PIECE_BYTES)?;
        };
        Ok(self.buffer.get(line))
    }

    /// Whether the last line was taken and has no line break.
    pub(super) fn is_open(&self) -> bool {
        let is_break = |byte: &u8| matches!(byte, b'\n' | b'\r');
        self.is_whole && self.at == self.buffer.len() && !self.buffer.last().is_some_and(is_break)
    }

    pub(super) fn into_hashes(self) -> Vec<Sha256> {
        self.text.into_hashes()
    }

    /// Reads on, and drops the lines that were taken.
    fn fill(&mut self, bytes: usize) -> Result<(), LogError> {
        self.buffer.drain(..self.at);
        self.at = 0;
        self.is_whole = !self.text.append(&mut self.buffer, bytes)?;
        self.progress.reach(self.text.progress().0);
        match self.watch.is_stopped() {
            true => {
                Err(Place::new(self.text.path(), None).refuse(SourceProblem::Interrupted.into()))
            }
            false => Ok(()),
        }
    }

    fn too_long(&self) -> LogError {
        Place::new(self.text.path(), self.line + 1).refuse(LogProblem::LineTooLong {
            limit_bytes: LINE_BYTES_MAX,
        })
    }
}

/// The lines of a text.
pub(super) fn lines_of(text: &[u8]) -> impl Iterator<Item = TextLine<'_>> {
    let (mut at, mut line) = (0, 0);
    std::iter::from_fn(move || {
        let rest = text.get(at..)?;
        let (length, taken) = first_line(rest, true)?;
        (at, line) = (at + taken, line + 1);
        Some(TextLine {
            text: rest.get(..length)?,
            line,
            end: at,
        })
    })
}

/// The length of the first line, without and with its break; `None` if it may go on after the text,
/// which is the whole rest or not, or if there is none.
fn first_line(text: &[u8], is_whole: bool) -> Option<(usize, usize)> {
    let Some(end) = memchr::memchr2(b'\n', b'\r', text) else {
        return (is_whole && !text.is_empty()).then_some((text.len(), text.len()));
    };
    match text.get(end..) {
        Some([b'\r', b'\n', ..]) => Some((end, end + 2)),
        // The first half of a line break, perhaps.
        Some([b'\r']) if !is_whole => None,
        _ => Some((end, end + 1)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    #[test]
    fn lines_have_their_numbers_across_pieces_whatever_ends_them() {
        for end in ["\n", "\r\n", "\r"] {
            let text: String = (1..=90_000).map(|k| format!("{k}{end}")).collect();
            let reader = TextReader::from_reader(text.as_bytes(), Path::new("x")).expect("text");
            let mut lines = Lines::new(reader);
            let opening = lines.opening().expect("text").to_vec();
            assert!(text.as_bytes().starts_with(&opening));
            for k in 1..=90_000 {
                let line = lines.next_line().expect("text").map(<[u8]>::to_vec);
                assert_eq!(line, Some(k.to_string().into_bytes()));
                assert_eq!(lines.line, k);
            }
            assert!(matches!(lines.next_line(), Ok(None)) && !lines.is_open());
        }
    }
}
