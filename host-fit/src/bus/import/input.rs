//! An input of text, plain or gzip, read line by line from its start as often as it is needed.

use super::ImportError;
use crate::input::log::LogError;
use crate::input::source::{self, GZIP_MAGIC, SourceError};
use crate::progress::Progress;
use flate2::bufread::MultiGzDecoder;
use std::fs::File;
use std::io::{BufRead, BufReader, ErrorKind, Read, Seek, Write};
use std::path::{Path, PathBuf};

/// Most bytes that are kept of an input that comes only once, such as a pipe: two days of bus.
const SPOOL_BYTES_MAX: u64 = 16 << 30;

/// Most bytes of UTF-16, which is turned into UTF-8 as a whole.
const UTF16_BYTES_MAX: u64 = 1 << 30;

/// Longest line of a block, in bytes.
const LINE_BYTES_MAX: usize = 1 << 20;

/// Bytes that are read at a time.
const BUFFER_BYTES: usize = 1 << 18;

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
    /// Every variant of [`SourceError`] but `Utf16`.
    pub(super) fn new(path: &Path, again: bool) -> Result<Self, SourceError> {
        let path = path.to_path_buf();
        let is_file = std::fs::metadata(&path).is_ok_and(|found| !is_pipe(&found));
        let mut input = Self {
            path,
            spooled: None,
        };
        if again && (!is_file || source::is_standard(&input.path)) {
            let spooled = input.spool()?;
            input.spooled = Some(spooled);
        }
        Ok(input)
    }

    fn spool(&self) -> Result<File, SourceError> {
        let unreadable = |error| self.unreadable(error);
        let mut from = self.raw()?;
        let start = source::probe(&mut from).map_err(unreadable)?;
        if !start.starts_with(&GZIP_MAGIC) {
            source::refuse_binary(&start, &self.path)?;
        }
        let mut copy = tempfile::tempfile().map_err(unreadable)?;
        copy.write_all(&start).map_err(unreadable)?;
        let copied = std::io::copy(&mut from.take(SPOOL_BYTES_MAX), &mut copy);
        if copied.map_err(unreadable)? == SPOOL_BYTES_MAX {
            return Err(self.too_large(SPOOL_BYTES_MAX));
        }
        Ok(copy)
    }

    /// The text from its start, with a bar that says `what` is done. What is plainly no text is
    /// refused by its start: a device may have no end.
    ///
    /// # Errors
    /// Every variant of [`SourceError`] but `Utf16`.
    pub(super) fn open(&self, what: &'static str) -> Result<TextReader, SourceError> {
        let raw = self.raw()?;
        let length = std::fs::metadata(&self.path).map_or(0, |found| found.len());
        let mut raw = Metered {
            raw,
            progress: (length > 0).then(|| Progress::new(what, length)),
            bytes: 0,
        };
        let unreadable = |error| self.unreadable(error);
        let start = source::probe(&mut raw).map_err(unreadable)?;
        let is_gzip = start.starts_with(&GZIP_MAGIC);
        let raw = BufReader::with_capacity(BUFFER_BYTES, std::io::Cursor::new(start).chain(raw));
        let mut text = TextReader {
            path: self.path.clone(),
            text: match is_gzip {
                false => Box::new(raw),
                true => Box::new(BufReader::with_capacity(
                    BUFFER_BYTES,
                    MultiGzDecoder::new(raw),
                )),
            },
            is_gzip,
            line_end: b'\n',
            bytes: 0,
        };
        match text.text.fill_buf() {
            Ok(start) if source::is_utf16(start) => {
                let mut bytes = Vec::new();
                let read = (&mut text.text)
                    .take(UTF16_BYTES_MAX)
                    .read_to_end(&mut bytes);
                if read.map_err(|error| text.fault(error))? as u64 == UTF16_BYTES_MAX {
                    return Err(self.too_large(UTF16_BYTES_MAX));
                }
                let utf8 = source::to_utf8(&bytes, &self.path)?.into_owned();
                text.text = Box::new(std::io::Cursor::new(utf8));
            }
            Ok(start) => source::refuse_binary(start, &self.path)?,
            Err(error) => return Err(text.fault(error)),
        }
        if let Ok(start) = text.text.fill_buf()
            && !start.contains(&b'\n')
            && start.contains(&b'\r')
        {
            text.line_end = b'\r';
        }
        Ok(text)
    }

    /// The bytes as they come.
    fn raw(&self) -> Result<Box<dyn Read>, SourceError> {
        let unreadable = |error| self.unreadable(error);
        if let Some(spooled) = &self.spooled {
            let mut copy = spooled.try_clone().map_err(unreadable)?;
            copy.rewind().map_err(unreadable)?;
            return Ok(Box::new(copy));
        }
        match source::is_standard(&self.path) {
            true => Ok(Box::new(std::io::stdin())),
            false => Ok(Box::new(File::open(&self.path).map_err(unreadable)?)),
        }
    }

    fn too_large(&self, limit_bytes: u64) -> SourceError {
        SourceError::TooLarge {
            path: source::shown_name(&self.path).to_path_buf(),
            limit_bytes,
        }
    }

    fn unreadable(&self, error: std::io::Error) -> SourceError {
        source::unreadable(&self.path, error)
    }
}

/// Whether a second reader would not find what the first one has read.
fn is_pipe(found: &std::fs::Metadata) -> bool {
    !found.is_file() && !found.is_dir()
}

/// Tells how far reading is.
struct Metered {
    raw: Box<dyn Read>,
    progress: Option<Progress>,
    bytes: u64,
}

impl Read for Metered {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        let read = self.raw.read(buffer)?;
        self.bytes += read as u64;
        if let Some(progress) = &self.progress {
            progress.reach(self.bytes);
        }
        Ok(read)
    }
}

/// Text on its way in.
pub(super) struct TextReader {
    path: PathBuf,
    text: Box<dyn BufRead>,
    is_gzip: bool,
    /// A line feed, or a carriage return where there are no line feeds.
    line_end: u8,
    bytes: usize,
}

/// A line of an input.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Line {
    /// It is whole.
    Whole,
    /// It is longer than asked for; what is left of it comes next.
    Long,
    /// There is none.
    End,
}

impl TextReader {
    /// Puts the next line, of at most `bytes_max`, into `line`, with its end.
    ///
    /// # Errors
    /// `Unreadable`, `GzipCut`, `GzipDamaged`.
    pub(super) fn line(
        &mut self,
        line: &mut Vec<u8>,
        bytes_max: usize,
    ) -> Result<Line, SourceError> {
        line.clear();
        let mut limited = (&mut self.text).take(bytes_max as u64);
        let read = limited.read_until(self.line_end, line);
        self.bytes += read.map_err(|error| self.fault(error))?;
        Ok(match line.last() {
            None => Line::End,
            Some(end) if *end == self.line_end => Line::Whole,
            Some(_) if line.len() == bytes_max => Line::Long,
            Some(_) => Line::Whole,
        })
    }

    /// Appends whole lines to `block` until it has so many bytes; `false` if there are none.
    ///
    /// # Errors
    /// `LongLine`, `Unreadable`, `GzipCut`, `GzipDamaged`.
    pub(super) fn block(&mut self, block: &mut Vec<u8>, bytes: usize) -> Result<bool, ImportError> {
        let mut line = Vec::new();
        let before = block.len();
        while block.len() < bytes {
            match self
                .line(&mut line, LINE_BYTES_MAX)
                .map_err(LogError::from)?
            {
                Line::End => break,
                Line::Whole => block.extend_from_slice(&line),
                Line::Long => {
                    return Err(ImportError::LongLine {
                        path: source::shown_name(&self.path).to_path_buf(),
                        byte: self.bytes - line.len(),
                        most: LINE_BYTES_MAX,
                    });
                }
            }
        }
        Ok(block.len() > before)
    }

    fn fault(&self, source: std::io::Error) -> SourceError {
        let (path, bytes) = (source::shown_name(&self.path).to_path_buf(), self.bytes);
        match source.kind() {
            ErrorKind::UnexpectedEof if self.is_gzip => SourceError::GzipCut { path, bytes },
            _ if self.is_gzip => SourceError::GzipDamaged {
                path,
                bytes,
                source,
            },
            _ => source::unreadable(&path, source),
        }
    }
}
