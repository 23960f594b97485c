//! A text file, read piece by piece: decompressed if it is gzip, in UTF-8, UTF-16 or another encoding with
//! ASCII in it. A file that is plainly not text is refused by its start, since a device or a damaged file may
//! have no end.

use super::encoding::Utf16;
use super::other_format;
use super::source::{self, SourceError, SourceProblem};
use flate2::bufread::MultiGzDecoder;
use sha2::{Digest, Sha256};
use std::io::{BufReader, Cursor, ErrorKind, Read};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// First bytes of every gzip file, and of every member of one.
const GZIP_MAGIC: [u8; 2] = [0x1f, 0x8b];
/// Written at the start of UTF-8 files by some programs.
const BYTE_ORDER_MARK: &[u8] = b"\xef\xbb\xbf";
/// Compressed bytes that are read at once.
const BUFFER_BYTES: usize = 64 * 1024;

/// Bytes of a text that show its format.
const OPENING_BYTES: usize = 64;

/// A text that is read piece by piece.
pub struct TextReader<'a> {
    path: PathBuf,
    /// The decompressed bytes.
    bytes: Box<dyn Read + Send + 'a>,
    is_gzip: bool,
    /// Number of decompressed bytes that were read.
    decompressed: usize,
    /// Number of bytes of the file that were read, and their total: 0 where it is not known.
    read: Arc<AtomicU64>,
    total: u64,
    utf16: Option<Utf16>,
    /// The first bytes, which were read to recognise the encoding: its mark, and the text after it.
    mark: Vec<u8>,
    start: Vec<u8>,
    /// The first bytes of the text.
    opening: Vec<u8>,
    hashes: Vec<Sha256>,
}

/// Counts the bytes that it passes on.
struct Counted<R> {
    file: R,
    read: Arc<AtomicU64>,
}

impl<R: Read> Read for Counted<R> {
    fn read(&mut self, bytes: &mut [u8]) -> std::io::Result<usize> {
        let read = self.file.read(bytes)?;
        self.read.fetch_add(read as u64, Ordering::Relaxed);
        Ok(read)
    }
}

impl<'a> TextReader<'a> {
    /// Opens a file, plain or gzip.
    ///
    /// # Errors
    /// Every variant of [`SourceError`] but `TooLarge`.
    pub fn open(path: &Path) -> Result<Self, SourceError> {
        let opened = source::open(path).and_then(|(file, total)| Self::new(file, total, path));
        opened.map_err(|problem| problem.in_file(path))
    }

    /// The text that a reader gives, plain or gzip, such as bytes in memory; `path` only names it in errors.
    ///
    /// # Errors
    /// As [`Self::open`], without errors of opening.
    pub fn from_reader(reader: impl Read + Send + 'a, path: &Path) -> Result<Self, SourceError> {
        Self::new(reader, 0, path).map_err(|problem| problem.in_file(path))
    }

    fn new(
        mut file: impl Read + Send + 'a,
        total: u64,
        path: &Path,
    ) -> Result<Self, SourceProblem> {
        // A pipe may give its first two bytes one at a time.
        let mut magic = Vec::new();
        (&mut file).take(2).read_to_end(&mut magic)?;
        let is_gzip = magic == GZIP_MAGIC;
        let read = Arc::new(AtomicU64::new(0));
        let whole = Counted {
            file: Cursor::new(magic).chain(file),
            read: Arc::clone(&read),
        };
        let mut text = Self {
            path: source::shown_name(path).to_path_buf(),
            bytes: match is_gzip {
                true => Box::new(MultiGzDecoder::new(BufReader::with_capacity(
                    BUFFER_BYTES,
                    whole,
                ))),
                false => Box::new(whole),
            },
            is_gzip,
            decompressed: 0,
            read,
            total,
            utf16: None,
            mark: Vec::new(),
            start: Vec::new(),
            opening: Vec::new(),
            hashes: Vec::new(),
        };
        let mut start = text.piece(other_format::PROBE_BYTES)?;
        let utf16 = Utf16::from_start(&start);
        let mark = match &utf16 {
            Some((_, bytes)) => *bytes,
            None if start.starts_with(BYTE_ORDER_MARK) => BYTE_ORDER_MARK.len(),
            None => 0,
        };
        text.start = start.split_off(mark);
        text.mark = start;
        text.utf16 = utf16.map(|(decoder, _)| decoder);
        let decoded = decoded(&mut text.utf16.clone(), &text.start, false)?;
        let opening = decoded.trim_ascii_start();
        text.opening = opening.get(..OPENING_BYTES).unwrap_or(opening).to_vec();
        match other_format::in_binary(&decoded) {
            None => Ok(text),
            Some((offset, looks_like)) => Err(SourceProblem::Binary { offset, looks_like }),
        }
    }

    /// The next decompressed bytes; empty at the end.
    fn piece(&mut self, bytes: usize) -> Result<Vec<u8>, SourceProblem> {
        let mut piece = std::mem::take(&mut self.start);
        if piece.is_empty() {
            piece.reserve(bytes);
            let read = (&mut self.bytes).take(bytes as u64).read_to_end(&mut piece);
            self.decompressed += piece.len();
            read.map_err(|error| self.problem(error))?;
        }
        Ok(piece)
    }

    /// An error of the file, or of the gzip data in it.
    fn problem(&self, source: std::io::Error) -> SourceProblem {
        let bytes = self.decompressed;
        match source.kind() {
            ErrorKind::UnexpectedEof if self.is_gzip => SourceProblem::GzipCut { bytes },
            ErrorKind::InvalidInput | ErrorKind::InvalidData if self.is_gzip => {
                SourceProblem::GzipDamaged { bytes, source }
            }
            _ => source.into(),
        }
    }

    /// Goes on with hashes: of all decompressed bytes, before they are decoded.
    pub fn with_hashes(self, mut hashes: Vec<Sha256>) -> Self {
        for hash in &mut hashes {
            hash.update(&self.mark);
        }
        Self { hashes, ..self }
    }

    /// The hashes of [`Self::with_hashes`].
    pub fn into_hashes(self) -> Vec<Sha256> {
        self.hashes
    }

    /// The name of the file in messages.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The first bytes of the text, without white space before them: they show its format.
    pub fn opening(&self) -> &[u8] {
        &self.opening
    }

    /// Number of bytes of the file that were read, and their total; 0 where it is not known.
    pub fn progress(&self) -> (u64, u64) {
        (self.read.load(Ordering::Relaxed), self.total)
    }

    /// Appends about `bytes` more bytes of text in UTF-8; `false` at the end.
    ///
    /// # Errors
    /// `Unreadable`, `Utf16`, `GzipCut`, `GzipDamaged`.
    pub fn append(&mut self, text: &mut Vec<u8>, bytes: usize) -> Result<bool, SourceError> {
        let piece = self.piece(bytes);
        let piece = piece.map_err(|problem| problem.in_file(&self.path))?;
        for hash in &mut self.hashes {
            hash.update(&piece);
        }
        let is_last = piece.is_empty();
        let decoded = decoded(&mut self.utf16, &piece, is_last);
        text.extend(decoded.map_err(|problem| problem.in_file(&self.path))?);
        Ok(!is_last)
    }
}

/// A piece of a text in UTF-8.
fn decoded(
    utf16: &mut Option<Utf16>,
    piece: &[u8],
    is_last: bool,
) -> Result<Vec<u8>, SourceProblem> {
    let Some(decoder) = utf16 else {
        return Ok(piece.to_vec());
    };
    let mut text = Vec::new();
    let decoded = decoder.append(piece, is_last, &mut text);
    decoded.map_err(|offset| SourceProblem::Utf16 { offset })?;
    Ok(text)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    /// Has no more to give.
    struct Failing(ErrorKind);

    impl Read for Failing {
        fn read(&mut self, _: &mut [u8]) -> std::io::Result<usize> {
            Err(self.0.into())
        }
    }

    #[test]
    fn a_fault_of_the_system_is_not_reported_as_damaged_gzip_data() {
        let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::none());
        encoder.write_all(&[b'a'; 1000]).expect("in memory");
        let packed = encoder.finish().expect("in memory");
        for kind in [ErrorKind::OutOfMemory, ErrorKind::PermissionDenied] {
            let half = packed[..500].chain(Failing(kind));
            let opened = TextReader::from_reader(half, Path::new("log"));
            let problem = opened.map(|_| ()).expect_err("refused").problem;
            assert!(
                matches!(&problem, SourceProblem::Unreadable { source } if source.kind() == kind),
                "{problem}"
            );
        }
    }
}
