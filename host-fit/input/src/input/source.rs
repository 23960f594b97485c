//! A file as bytes, read whole or piece by piece. `-` is standard input.

use crate::interrupt;
use std::fs::File;
use std::io::{Cursor, ErrorKind, Read, Seek, Write};
use std::path::{Path, PathBuf};

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
    /// The gzip stream is damaged, its checksum fails, or something else follows it.
    #[error("{}: the gzip file is damaged (after {bytes} decompressed bytes: {source}); copy or record it again", path.display())]
    GzipDamaged {
        path: PathBuf,
        bytes: usize,
        source: std::io::Error,
    },
}

impl SourceError {
    /// The file.
    pub fn path(&self) -> &Path {
        match self {
            Self::NotFound { path }
            | Self::IsFolder { path }
            | Self::Unreadable { path, .. }
            | Self::TooLarge { path, .. }
            | Self::Binary { path, .. }
            | Self::Utf16 { path, .. }
            | Self::Interrupted { path }
            | Self::GzipCut { path, .. }
            | Self::GzipDamaged { path, .. } => path,
        }
    }
}

/// What an input is called in messages.
pub fn shown_name(path: &Path) -> &Path {
    let (argument, name) = STANDARD_INPUT;
    match path.as_os_str() == argument {
        true => Path::new(name),
        false => path,
    }
}

/// A file of at most `limit_bytes`, as it is.
///
/// # Errors
/// `NotFound`, `IsFolder`, `Unreadable`, `TooLarge`.
pub fn read_whole(path: &Path, limit_bytes: u64) -> Result<Vec<u8>, SourceError> {
    let mut bytes = Vec::new();
    let raw = Raw::open(path)?.take(limit_bytes.saturating_add(1));
    read_to_end(raw, &mut bytes, path)?;
    match bytes.len() as u64 <= limit_bytes {
        true => Ok(bytes),
        false => Err(SourceError::TooLarge {
            path: shown_name(path).to_path_buf(),
            limit_bytes,
        }),
    }
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

/// The bytes of a file as they are, counted. Errors of reading are [`SourceError`]s inside.
pub(super) struct Raw<'a> {
    path: PathBuf,
    file: Box<dyn Read + Send + 'a>,
    /// Takes all that is read.
    copy: Option<File>,
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
            return Ok(Self::of_reader(std::io::stdin(), &shown));
        }
        let file = File::open(path).map_err(|source| refused(&shown, source))?;
        let total = file.metadata().map_or(0, |metadata| metadata.len());
        Ok(Self {
            total,
            ..Self::of_reader(file, &shown)
        })
    }

    /// Opens a file. What is no regular file, as standard input, a pipe or a device, is copied to
    /// an unnamed file while it is read.
    ///
    /// # Errors
    /// As [`Self::open`], and those of making the copy.
    pub(super) fn open_copied(path: &Path) -> Result<(Self, Option<File>), SourceError> {
        let raw = Self::open(path)?;
        // The length is known of regular files alone.
        if raw.total > 0 {
            return Ok((raw, None));
        }
        let make = || {
            let copy = tempfile::tempfile()?;
            Ok((copy.try_clone()?, copy))
        };
        let (copy, again) = make().map_err(|error| refused(&raw.path, error))?;
        let copy = Some(copy);
        Ok((Self { copy, ..raw }, Some(again)))
    }

    /// What a reader gives; `path` is only named in errors.
    pub(super) fn of_reader(reader: impl Read + Send + 'a, path: &Path) -> Self {
        Self {
            path: path.to_path_buf(),
            file: Box::new(reader),
            copy: None,
            read: 0,
            total: 0,
        }
    }

    /// With the bytes that were taken from its start put back.
    ///
    /// # Errors
    /// Those of the copy.
    pub(super) fn preceded_by(mut self, start: Vec<u8>) -> Result<Self, SourceError> {
        if let Some(copy) = &mut self.copy {
            copy.rewind().map_err(|error| refused(&self.path, error))?;
        }
        Ok(Self {
            file: Box::new(Cursor::new(start).chain(self.file)),
            read: 0,
            ..self
        })
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
                    if let (Some(copy), Some(bytes)) = (&mut self.copy, bytes.get(..read)) {
                        copy.write_all(bytes)
                            .map_err(|error| std::io::Error::other(refused(&self.path, error)))?;
                    }
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
