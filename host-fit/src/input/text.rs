//! A file of text, piece by piece: decompressed, in UTF-8 or in another encoding that has ASCII in
//! it, and refused by its start where it is plainly no text: a device or a damaged file may have no
//! end.

use super::binary;
use super::encoding::Utf16;
use super::source::{self, Raw, SourceError};
use super::unpack::Unpacked;
use sha2::{Digest, Sha256};
use std::io::Read;
use std::path::{Path, PathBuf};

/// Written at the start of UTF-8 files by some programs.
const BYTE_ORDER_MARK: &[u8] = b"\xef\xbb\xbf";

/// A text that is read piece by piece.
pub(crate) struct TextReader<'a> {
    path: PathBuf,
    unpacked: Unpacked<'a>,
    /// Of a text in UTF-16.
    utf16: Option<Utf16>,
    /// The start of the text as it is encoded, and how many bytes of it are a mark, until it is
    /// given away.
    start: Option<(Vec<u8>, usize)>,
    hash: Option<Sha256>,
}

impl<'a> TextReader<'a> {
    /// Opens a file, plain or gzip.
    ///
    /// # Errors
    /// Every variant of [`SourceError`] but `TooLarge` and `Utf16`.
    pub(crate) fn open(path: &Path) -> Result<Self, SourceError> {
        Self::new(Unpacked::open(path)?, source::shown_name(path))
    }

    /// The text of a file that is in memory, plain or gzip; `path` is only named in errors.
    ///
    /// # Errors
    /// `Binary`, and those of gzip.
    pub(crate) fn of_bytes(bytes: &'a [u8], path: &Path) -> Result<Self, SourceError> {
        Self::new(Unpacked::of_raw(Raw::of_reader(bytes, path), path)?, path)
    }

    fn new(mut unpacked: Unpacked<'a>, path: &Path) -> Result<Self, SourceError> {
        let mut start = Vec::new();
        let probe = (&mut unpacked).take(binary::PROBE_BYTES as u64);
        source::read_to_end(probe, &mut start, path)?;
        let (utf16, mark) = Utf16::of_start(&start).unzip();
        if utf16.is_none() {
            refuse_binary(&start, path)?;
        }
        Ok(Self {
            path: path.to_path_buf(),
            unpacked,
            utf16,
            start: Some((start, mark.unwrap_or(0))),
            hash: None,
        })
    }

    /// Goes on with the hash of all that is read: of the decompressed file, as it is encoded.
    pub(crate) fn with_hash(self, hash: Sha256) -> Self {
        Self {
            hash: Some(hash),
            ..self
        }
    }

    /// The hash of [`Self::with_hash`].
    pub(crate) fn into_hash(self) -> Option<Sha256> {
        self.hash
    }

    /// What the file is called in messages.
    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// How many bytes of the file were read, and how many it has; 0 where that is not known.
    pub(crate) fn progress(&self) -> (u64, u64) {
        self.unpacked.progress()
    }

    /// Appends about `bytes` more bytes of text; `false` at the end.
    ///
    /// # Errors
    /// `Unreadable`, `Binary`, `Utf16`, and those of gzip.
    pub(crate) fn append(&mut self, text: &mut Vec<u8>, bytes: usize) -> Result<bool, SourceError> {
        let (at, mut first) = (text.len(), false);
        let mut mark = 0;
        match self.start.take() {
            Some((start, mark_bytes)) => {
                text.extend_from_slice(&start);
                (first, mark) = (true, mark_bytes);
            }
            None => {
                let piece = (&mut self.unpacked).take(bytes as u64);
                source::read_to_end(piece, text, &self.path)?;
            }
        }
        let piece = text.get(at..).unwrap_or_default();
        let is_last = piece.is_empty();
        if let Some(hash) = &mut self.hash {
            hash.update(piece);
        }
        if let Some(decoder) = &mut self.utf16 {
            let piece = text.split_off(at);
            let after_mark = piece.get(mark..).unwrap_or_default();
            decoder
                .append(after_mark, is_last, text)
                .map_err(|place| SourceError::Utf16 {
                    path: self.path.clone(),
                    offset: place.start,
                })?;
            if first {
                refuse_binary(text.get(at..).unwrap_or_default(), &self.path)?;
            }
        }
        if first
            && text
                .get(at..)
                .unwrap_or_default()
                .starts_with(BYTE_ORDER_MARK)
        {
            text.drain(at..at + BYTE_ORDER_MARK.len());
        }
        Ok(!is_last)
    }
}

/// Refuses what is plainly no text, with a word on what it seems to be.
fn refuse_binary(start: &[u8], path: &Path) -> Result<(), SourceError> {
    match binary::in_text(start) {
        None => Ok(()),
        Some((offset, looks_like)) => Err(SourceError::Binary {
            path: path.to_path_buf(),
            offset,
            looks_like,
        }),
    }
}
