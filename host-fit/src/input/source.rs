//! A file as bytes, read whole or piece by piece. `-` is standard input.

use super::unpack::Unpacked;
use crate::interrupt;
use std::io::{Cursor, ErrorKind, Read};
use std::path::{Path, PathBuf};

/// Largest file that is read whole, in decompressed bytes. A file that unpacks to more is damaged
/// or hostile.
const BYTES_MAX: u64 = 2 << 30;

/// The name of standard input on the command line, and in messages.
const STANDARD_INPUT: (&str, &str) = ("-", "standard input");

/// Why a file cannot be read.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the messages say what the fields are")]
pub enum SourceError {
    /// There is no such file.
    #[error("{}: no such file; check the path", path.display())]
    NotFound { path: PathBuf },
    /// A folder was named.
    #[error("{}: is a folder; name a file in it", path.display())]
    IsFolder { path: PathBuf },
    /// The system refuses to read it.
    #[error("{}: cannot be read: {source}; check its permissions and the disk", path.display())]
    Unreadable {
        path: PathBuf,
        source: std::io::Error,
    },
    /// More bytes than any file of its kind has.
    #[error("{}: more than {limit_bytes} bytes, the most that is read; name another file, or split it", path.display())]
    TooLarge { path: PathBuf, limit_bytes: u64 },
    /// Not text: the first byte that no text has, from 0, after decompression.
    #[error("{}: not a text file (byte {offset}): it looks like {looks_like}", path.display())]
    Binary {
        path: PathBuf,
        offset: usize,
        looks_like: &'static str,
    },
    /// Text in UTF-16 with bytes that are no character: where, from 0, after decompression.
    #[error("{}: the UTF-16 text is damaged (byte {offset}); save it again, as UTF-8", path.display())]
    Utf16 { path: PathBuf, offset: usize },
    /// Ctrl-C, where the program watches for it.
    #[error("interrupted while {} was read; nothing was written", path.display())]
    Interrupted { path: PathBuf },
    /// The gzip stream ends too early.
    #[error("{}: the gzip file is cut short (after {bytes} decompressed bytes); copy or record it again", path.display())]
    GzipCut { path: PathBuf, bytes: usize },
    /// The gzip stream is damaged, or its checksum fails.
    #[error("{}: the gzip file is damaged (after {bytes} decompressed bytes: {source}); copy or record it again", path.display())]
    GzipDamaged {
        path: PathBuf,
        bytes: usize,
        source: std::io::Error,
    },
    /// Something follows the gzip stream.
    #[error("{}: {bytes} bytes that are not gzip follow the gzip data; copy the file again, or decompress it and check its end", path.display())]
    GzipTrailing { path: PathBuf, bytes: usize },
}

/// What an input is called in messages.
pub fn shown_name(path: &Path) -> &Path {
    let (argument, name) = STANDARD_INPUT;
    match path.as_os_str() == argument {
        true => Path::new(name),
        false => path,
    }
}

/// A file of any bytes, plain or gzip.
///
/// # Errors
/// Every variant of [`SourceError`] but `Binary` and `Utf16`.
pub fn read_bytes(path: &Path) -> Result<Vec<u8>, SourceError> {
    let mut bytes = Vec::new();
    let unpacked = Unpacked::open(path)?.take(BYTES_MAX + 1);
    read_to_end(unpacked, &mut bytes, path)?;
    refuse_large(&bytes, BYTES_MAX, path)?;
    Ok(bytes)
}

/// A file of at most `limit_bytes`, as it is.
///
/// # Errors
/// `NotFound`, `IsFolder`, `Unreadable`, `TooLarge`.
pub fn read_whole(path: &Path, limit_bytes: u64) -> Result<Vec<u8>, SourceError> {
    let mut bytes = Vec::new();
    let raw = Raw::open(path)?.take(limit_bytes.saturating_add(1));
    read_to_end(raw, &mut bytes, path)?;
    refuse_large(&bytes, limit_bytes, path)?;
    Ok(bytes)
}

/// Appends all that is left of a source of this module; `path` is named where memory is out.
pub(super) fn read_to_end(
    mut source: impl Read,
    bytes: &mut Vec<u8>,
    path: &Path,
) -> Result<(), SourceError> {
    let read = source.read_to_end(bytes).map(|_| ());
    // Sources of this module wrap errors of their own.
    read.map_err(|error| {
        let path = shown_name(path).to_path_buf();
        let unreadable = |source| SourceError::Unreadable { path, source };
        error.downcast().unwrap_or_else(unreadable)
    })
}

fn refuse_large(bytes: &[u8], limit_bytes: u64, path: &Path) -> Result<(), SourceError> {
    if bytes.len() as u64 <= limit_bytes {
        return Ok(());
    }
    Err(SourceError::TooLarge {
        path: shown_name(path).to_path_buf(),
        limit_bytes,
    })
}

/// The bytes of a file as they are, counted. Errors of reading are [`SourceError`]s inside.
pub(super) struct Raw<'a> {
    path: PathBuf,
    file: Box<dyn Read + Send + 'a>,
    /// Bytes that were read.
    pub(super) read: u64,
    /// Bytes of the file; 0 where that is not known.
    pub(super) total: u64,
}

impl<'a> Raw<'a> {
    /// Opens a file.
    ///
    /// # Errors
    /// `NotFound`, `IsFolder`, `Unreadable`.
    pub(super) fn open(path: &Path) -> Result<Self, SourceError> {
        let shown = shown_name(path).to_path_buf();
        if path.as_os_str() == STANDARD_INPUT.0 {
            return Ok(Self {
                path: shown,
                file: Box::new(std::io::stdin()),
                read: 0,
                total: 0,
            });
        }
        let file = std::fs::File::open(path).map_err(|source| refused(&shown, source))?;
        Ok(Self {
            path: shown,
            total: file.metadata().map_or(0, |metadata| metadata.len()),
            file: Box::new(file),
            read: 0,
        })
    }

    /// What a reader gives; `path` is only named in errors.
    pub(super) fn of_reader(reader: impl Read + Send + 'a, path: &Path) -> Self {
        Self {
            path: path.to_path_buf(),
            file: Box::new(reader),
            read: 0,
            total: 0,
        }
    }

    /// With bytes that were taken from its start put back.
    pub(super) fn preceded_by(self, start: Vec<u8>) -> Self {
        Self {
            file: Box::new(Cursor::new(start).chain(self.file)),
            read: 0,
            ..self
        }
    }
}

impl Read for Raw<'_> {
    fn read(&mut self, bytes: &mut [u8]) -> std::io::Result<usize> {
        loop {
            match self.file.read(bytes) {
                // After a read, which may have waited for long.
                _ if interrupt::requested() => {
                    let path = self.path.clone();
                    return Err(std::io::Error::other(SourceError::Interrupted { path }));
                }
                Ok(read) => {
                    self.read += read as u64;
                    return Ok(read);
                }
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => return Err(std::io::Error::other(refused(&self.path, error))),
            }
        }
    }
}

/// What the system says of a file, in the user's terms.
pub(crate) fn refused(path: &Path, source: std::io::Error) -> SourceError {
    let path = path.to_path_buf();
    match source.kind() {
        ErrorKind::NotFound => SourceError::NotFound { path },
        ErrorKind::IsADirectory => SourceError::IsFolder { path },
        _ if path.is_dir() => SourceError::IsFolder { path },
        _ => SourceError::Unreadable { path, source },
    }
}
