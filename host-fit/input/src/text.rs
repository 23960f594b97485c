//! A file of text, piece by piece: decompressed, in UTF-8 or in another encoding that has ASCII in
//! it, and refused by its start where it is plainly no text: a device or a damaged file may have no
//! end.

use super::binary;
use super::encoding::Utf16;
use super::source::{self, Raw, SourceError, SourceProblem};
use super::unpack::Unpacked;
use sha2::{Digest, Sha256};
use std::io::{Chain, Cursor, Read};
use std::path::{Path, PathBuf};

/// Written at the start of UTF-8 files by some programs.
const BYTE_ORDER_MARK: &[u8] = b"\xef\xbb\xbf";

/// A text that is read piece by piece.
pub struct TextReader<'a> {
    path: PathBuf,
    bytes: Chain<Cursor<Vec<u8>>, Unpacked<'a>>,
    /// Of a text in UTF-16.
    utf16: Option<Utf16>,
    /// The mark of its encoding.
    mark: Vec<u8>,
    hash: Option<Sha256>,
}

impl<'a> TextReader<'a> {
    /// Opens a file, plain or gzip.
    ///
    /// # Errors
    /// Every variant of [`SourceError`] but `TooLarge` and `Utf16`.
    pub fn open(path: &Path) -> Result<Self, SourceError> {
        let raw = Raw::open(path).map_err(|problem| problem.of(path))?;
        Self::new(raw, path)
    }

    /// The text that a reader gives, as bytes in memory do, plain or gzip; `path` is only named in errors.
    ///
    /// # Errors
    /// `Binary`, `Unreadable`, and those of gzip.
    pub fn from_reader(reader: impl Read + Send + 'a, path: &Path) -> Result<Self, SourceError> {
        Self::new(Raw::from_reader(reader), path)
    }

    fn new(raw: Raw<'a>, path: &Path) -> Result<Self, SourceError> {
        Self::probed(raw, path).map_err(|problem| problem.of(path))
    }

    fn probed(raw: Raw<'a>, path: &Path) -> Result<Self, SourceProblem> {
        let mut unpacked = Unpacked::new(raw)?;
        let mut mark = Vec::new();
        (&mut unpacked)
            .take(binary::PROBE_BYTES as u64)
            .read_to_end(&mut mark)?;
        let (utf16, bytes) = Utf16::of_start(&mark).unzip();
        let is_marked = mark.starts_with(BYTE_ORDER_MARK);
        let start =
            mark.split_off(bytes.unwrap_or(if is_marked { BYTE_ORDER_MARK.len() } else { 0 }));
        let mut text = Self {
            path: source::shown_name(path).to_path_buf(),
            bytes: Cursor::new(start.clone()).chain(unpacked),
            utf16: utf16.clone(),
            mark,
            hash: None,
        };
        let start = text.decoded(start, false)?;
        text.utf16 = utf16;
        match binary::in_text(&start) {
            None => Ok(text),
            Some((offset, looks_like)) => Err(SourceProblem::Binary { offset, looks_like }),
        }
    }

    /// The next piece of the text in UTF-8.
    fn decoded(&mut self, piece: Vec<u8>, is_last: bool) -> Result<Vec<u8>, SourceProblem> {
        let Some(decoder) = &mut self.utf16 else {
            return Ok(piece);
        };
        let mut text = Vec::new();
        let decoded = decoder.append(&piece, is_last, &mut text);
        decoded.map_err(|offset| SourceProblem::Utf16 { offset })?;
        Ok(text)
    }

    fn next(&mut self, bytes: usize) -> Result<Option<Vec<u8>>, SourceProblem> {
        let mut piece = Vec::with_capacity(bytes);
        (&mut self.bytes)
            .take(bytes as u64)
            .read_to_end(&mut piece)?;
        if let Some(hash) = &mut self.hash {
            hash.update(&piece);
        }
        let is_last = piece.is_empty();
        Ok(Some(self.decoded(piece, is_last)?).filter(|_| !is_last))
    }

    /// Goes on with the hash of all that is read: of the decompressed file, as it is encoded.
    pub fn with_hash(self, mut hash: Sha256) -> Self {
        hash.update(&self.mark);
        Self {
            hash: Some(hash),
            ..self
        }
    }

    /// The hash of [`Self::with_hash`].
    pub fn into_hash(self) -> Option<Sha256> {
        self.hash
    }

    /// What the file is called in messages.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// How many bytes of the file were read, and how many it has; 0 where that is not known.
    pub fn progress(&self) -> (u64, u64) {
        self.bytes.get_ref().1.progress()
    }

    /// Appends about `bytes` more bytes of text; `false` at the end.
    ///
    /// # Errors
    /// `Unreadable`, `Binary`, `Utf16`, and those of gzip.
    pub fn append(&mut self, text: &mut Vec<u8>, bytes: usize) -> Result<bool, SourceError> {
        let more = self.next(bytes).map_err(|problem| problem.of(&self.path))?;
        text.extend_from_slice(more.as_deref().unwrap_or_default());
        Ok(more.is_some())
    }
}
