//! A text in blocks of whole lines, so that lines can be read by several cores, and a file of any
//! length in little memory.

use super::error::LogError;
use crate::input::text::TextReader;
use sha2::Sha256;

/// Length of a block, in bytes, if its lines are not longer: some milliseconds of work.
const BLOCK_BYTES: usize = 128 * 1024;

/// Longest line. What is longer is damaged or hostile.
pub(crate) const LINE_BYTES_MAX: usize = 1 << 20;

/// So much of a text is looked at to tell what its table is like.
pub(crate) const OPENING_BYTES: usize = 1 << 20;

/// Whole lines of a text.
#[derive(Debug, Default)]
pub(super) struct Block {
    pub(super) text: Vec<u8>,
    /// The number of its first line, from 1.
    pub(super) line: usize,
    /// How many bytes of the file were read so far.
    pub(super) file_bytes: u64,
}

/// Cuts a text into blocks.
pub(super) struct Blocks<'a> {
    text: TextReader<'a>,
    /// Text that is not yet given away.
    rest: Vec<u8>,
    /// The number of its first line.
    line: usize,
    /// Whether all of the text was read.
    is_whole: bool,
}

impl<'a> Blocks<'a> {
    pub(super) const fn new(text: TextReader<'a>) -> Self {
        Self {
            text,
            rest: Vec::new(),
            line: 1,
            is_whole: false,
        }
    }

    /// The start of the text, in whole lines.
    ///
    /// # Errors
    /// Those of reading, `LineTooLong`.
    pub(super) fn opening(&mut self) -> Result<&[u8], LogError> {
        let mut rest = std::mem::take(&mut self.rest);
        let cut = self.fill(&mut rest, OPENING_BYTES)?;
        self.rest = rest;
        Ok(self.rest.get(..cut).unwrap_or_default())
    }

    /// Goes on after so many bytes of the opening.
    pub(super) fn skip(&mut self, bytes: usize) {
        let after = self.rest.split_off(bytes.min(self.rest.len()));
        self.line += line_breaks(&self.rest);
        self.rest = after;
    }

    /// The next block; `None` after the last.
    ///
    /// # Errors
    /// Those of reading, `LineTooLong`.
    pub(super) fn next(&mut self) -> Result<Option<Block>, LogError> {
        let mut text = std::mem::take(&mut self.rest);
        let cut = self.fill(&mut text, BLOCK_BYTES)?;
        if text.is_empty() {
            return Ok(None);
        }
        self.rest = text.split_off(cut);
        let line = self.line;
        self.line += line_breaks(&text);
        Ok(Some(Block {
            text,
            line,
            file_bytes: self.text.progress().0,
        }))
    }

    /// The file as a whole, in bytes; 0 where that is not known.
    pub(super) fn file_bytes(&self) -> u64 {
        self.text.progress().1
    }

    pub(super) fn into_hash(self) -> Option<Sha256> {
        self.text.into_hash()
    }

    /// Reads on until `text` has `wanted` bytes, or more where lines are long, or ends; tells after
    /// how many bytes its last whole line of those ends.
    fn fill(&mut self, text: &mut Vec<u8>, mut wanted: usize) -> Result<usize, LogError> {
        loop {
            text.reserve_exact(wanted.saturating_sub(text.len()));
            while text.len() < wanted && !self.is_whole {
                self.is_whole = !self.text.append(text, wanted - text.len())?;
            }
            if self.is_whole && text.len() <= wanted {
                return Ok(text.len());
            }
            let start = text.get(..wanted).unwrap_or(text);
            match end_of_lines(start) {
                Some(end) => return Ok(end),
                None if wanted < LINE_BYTES_MAX => wanted *= 2,
                None => {
                    return Err(LogError::LineTooLong {
                        path: self.text.path().to_path_buf(),
                        line: self.line,
                        limit_bytes: LINE_BYTES_MAX,
                    });
                }
            }
        }
    }
}

/// The first byte after the last whole line of a text that goes on.
fn end_of_lines(text: &[u8]) -> Option<usize> {
    // A carriage return at the end may be the first half of a line break.
    let whole = text.split_last().map_or(text, |(_, before)| before);
    let feed = text.iter().rposition(|byte| *byte == b'\n');
    let end = feed.or_else(|| whole.iter().rposition(|byte| *byte == b'\r'))?;
    Some(end + 1)
}

/// How many line breaks there are: line feeds, and carriage returns without one.
fn line_breaks(text: &[u8]) -> usize {
    // In pieces of which a byte holds the count, so that a SIMD register holds many.
    let in_piece = |wanted: u8, piece: &[u8]| {
        let found = piece.iter().map(|byte| u8::from(*byte == wanted));
        usize::from(found.fold(0u8, u8::wrapping_add))
    };
    let count = |wanted: u8| -> usize {
        let pieces = text.chunks(usize::from(u8::MAX));
        pieces.map(|piece| in_piece(wanted, piece)).sum()
    };
    let feeds = count(b'\n');
    if !text.contains(&b'\r') {
        return feeds;
    }
    let both = text.windows(2).filter(|pair| *pair == b"\r\n").count();
    feeds + count(b'\r') - both
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    #[test]
    fn blocks_are_whole_lines_and_together_the_text() {
        for end in ["\n", "\r\n", "\r"] {
            let lines: Vec<String> = (0..90_000).map(|k| format!("{k}{end}")).collect();
            let text = lines.concat();
            let reader = TextReader::of_bytes(text.as_bytes(), Path::new("x")).expect("text");
            let mut blocks = Blocks::new(reader);
            let (mut whole, mut line) = (Vec::new(), 1);
            while let Some(block) = blocks.next().expect("text") {
                assert_eq!(block.line, line);
                assert!(block.text.ends_with(end.as_bytes()));
                line += String::from_utf8_lossy(&block.text).matches(end).count();
                whole.extend(block.text);
            }
            assert_eq!((whole == text.as_bytes(), line), (true, 90_001));
        }
    }

    #[test]
    fn a_line_without_end_is_refused_with_its_number() {
        let text = format!("a\nb\n{}", "c".repeat(LINE_BYTES_MAX + 1));
        let reader = TextReader::of_bytes(text.as_bytes(), Path::new("x")).expect("text");
        let mut blocks = Blocks::new(reader);
        assert_eq!(
            blocks.next().expect("lines").map(|block| block.line),
            Some(1)
        );
        let error = blocks.next().expect_err("too long");
        assert!(
            matches!(error, LogError::LineTooLong { line: 3, .. }),
            "{error}"
        );
    }
}
