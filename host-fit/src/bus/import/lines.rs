//! The lines of a text, with a bar of how far reading is.

use crate::input::source::SourceError;
use crate::input::text::TextReader;
use crate::progress::Progress;

/// Bytes that are read at a time.
const PIECE_BYTES: usize = 1 << 17;

/// Longest line: a frame, with spaces to align it, has a hundred bytes. A longer one is cut.
const LINE_BYTES_MAX: usize = 4096;

/// A text that is read line by line.
pub(super) struct Lines {
    text: TextReader<'static>,
    progress: Progress,
    piece: Vec<u8>,
    /// Where the next line starts.
    at: usize,
    is_whole: bool,
}

impl Lines {
    /// Of a text; `what` is being done.
    pub(super) fn new(text: TextReader<'static>, what: &'static str) -> Self {
        Self {
            progress: Progress::new(what, text.progress().1),
            text,
            piece: Vec::new(),
            at: 0,
            is_whole: false,
        }
    }

    /// The next line without its end; `None` after the last one.
    ///
    /// # Errors
    /// Those of reading.
    pub(super) fn next(&mut self) -> Result<Option<&[u8]>, SourceError> {
        loop {
            let rest = self.piece.get(self.at..).unwrap_or_default();
            let end = rest.iter().position(|byte| *byte == b'\n');
            let length = match end {
                None if rest.len() < LINE_BYTES_MAX && !self.is_whole => {
                    self.piece.drain(..self.at);
                    self.at = 0;
                    self.is_whole = !self.text.append(&mut self.piece, PIECE_BYTES)?;
                    self.progress.reach(self.text.progress().0);
                    continue;
                }
                None if rest.is_empty() => return Ok(None),
                end => end.unwrap_or(rest.len()).min(LINE_BYTES_MAX),
            };
            let start = self.at;
            self.at += length + usize::from(end == Some(length));
            return Ok(self.piece.get(start..start + length));
        }
    }
}
