//! An input of text, plain or gzip, read from its start as often as it is needed, and its lines.

use crate::input::source::{self, SourceError};
use crate::input::text::TextReader;
use crate::progress::Progress;
use std::fs::File;
use std::io::{Seek, Write};
use std::path::{Path, PathBuf};

/// Most bytes that are kept of an input that comes only once, such as a pipe: days of bus.
const SPOOL_BYTES_MAX: u64 = 16 << 30;

/// Bytes that are read at a time.
const PIECE_BYTES: usize = 1 << 17;

/// A file or a pipe, `-` for standard input.
#[derive(Debug)]
pub(super) struct Input {
    path: PathBuf,
    /// What came out of a pipe.
    spooled: Option<File>,
}

impl Input {
    /// What cannot be read `again` is copied to a temporary file if it must be.
    ///
    /// # Errors
    /// Those of reading, and `TooLarge`.
    pub(super) fn new(path: &Path, again: bool) -> Result<Self, SourceError> {
        let is_file = std::fs::metadata(path).is_ok_and(|found| found.is_file());
        Ok(Self {
            path: path.to_path_buf(),
            spooled: match again && !is_file {
                true => Some(spooled(path)?),
                false => None,
            },
        })
    }

    /// The text from its start.
    ///
    /// # Errors
    /// Those of reading.
    pub(super) fn open(&self) -> Result<TextReader<'static>, SourceError> {
        let Some(spooled) = &self.spooled else {
            return TextReader::open(&self.path);
        };
        let copy = spooled.try_clone().and_then(|mut copy| {
            copy.rewind()?;
            Ok(copy)
        });
        let path = source::shown_name(&self.path);
        let copy = copy.map_err(|source| source::refused(path, source))?;
        TextReader::of_reader(copy, path)
    }
}

/// All of a text that comes only once, in a temporary file without a name.
fn spooled(path: &Path) -> Result<File, SourceError> {
    let mut text = TextReader::open(path)?;
    let refused = |source| source::refused(source::shown_name(path), source);
    let mut copy = tempfile::tempfile().map_err(refused)?;
    let (mut piece, mut bytes) = (Vec::new(), 0);
    while text.append(&mut piece, PIECE_BYTES)? {
        copy.write_all(&piece).map_err(refused)?;
        bytes += piece.len() as u64;
        piece.clear();
        if bytes > SPOOL_BYTES_MAX {
            return Err(SourceError::TooLarge {
                path: source::shown_name(path).to_path_buf(),
                limit_bytes: SPOOL_BYTES_MAX,
            });
        }
    }
    Ok(copy)
}

/// The lines of a text, with a bar of how far reading is.
pub(super) struct Lines {
    text: TextReader<'static>,
    progress: Progress,
    piece: Vec<u8>,
    /// Where the next line starts.
    at: usize,
    is_whole: bool,
}

/// A line of a text, without its end.
pub(super) enum Line<'l> {
    /// It is whole.
    Whole(&'l [u8]),
    /// It is longer than it may be, and left out.
    Long,
}

/// Longest line, in bytes: a frame, with spaces to align it, has a hundred.
pub(super) const LINE_BYTES_MAX: usize = 4096;

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

    /// The next line; `None` at the end.
    ///
    /// # Errors
    /// Those of reading.
    pub(super) fn next(&mut self) -> Result<Option<Line<'_>>, SourceError> {
        let mut is_long = false;
        loop {
            let rest = self.piece.get(self.at..).unwrap_or_default();
            let end = rest.iter().position(|byte| *byte == b'\n');
            is_long |= end.unwrap_or(rest.len()) > LINE_BYTES_MAX;
            let start = self.at;
            match end {
                Some(length) => {
                    self.at += length + 1;
                    let line = self.piece.get(start..start + length).unwrap_or_default();
                    return Ok(Some(if is_long {
                        Line::Long
                    } else {
                        Line::Whole(line)
                    }));
                }
                None if self.is_whole => {
                    let is_over = rest.is_empty() && !is_long;
                    self.at = self.piece.len();
                    let line = self.piece.get(start..).unwrap_or_default();
                    return Ok(match (is_over, is_long) {
                        (true, _) => None,
                        (_, true) => Some(Line::Long),
                        _ => Some(Line::Whole(line)),
                    });
                }
                None => {
                    // Nothing of a line that is too long is needed.
                    let done = if is_long { self.piece.len() } else { start };
                    self.piece.drain(..done);
                    self.at = 0;
                    self.is_whole = !self.text.append(&mut self.piece, PIECE_BYTES)?;
                    self.progress.reach(self.text.progress().0);
                }
            }
        }
    }
}
