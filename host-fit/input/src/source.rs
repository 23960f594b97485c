//! A file as bytes, read whole or piece by piece. `-` is standard input.

use std::fs::File;
use std::io::{Cursor, ErrorKind, Read};
use std::path::{Path, PathBuf};

/// The name of standard input on the command line, and in messages.
const STANDARD_INPUT: (&str, &str) = ("-", "standard input");

/// Why a file cannot be read, and which.
#[derive(Debug, thiserror::Error)]
#[error("{}: {problem}", path.display())]
pub struct SourceError {
    /// The file.
    pub path: PathBuf,
    /// What is wrong with it.
    pub problem: SourceProblem,
}

/// Why a file cannot be read.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the messages say what the fields are")]
pub enum SourceProblem {
    /// There is no such file.
    #[error("no such file; check the path")]
    NotFound,
    /// A folder was named.
    #[error("is a folder; name a file in it")]
    IsFolder,
    /// The system refuses to read it.
    #[error("cannot be read: {source}; check its permissions and the disk")]
    Unreadable { source: std::io::Error },
    /// More bytes than any file of its kind has.
    #[error("more than {limit_bytes} bytes, the most that is read; name another file, or split it")]
    TooLarge { limit_bytes: u64 },
    /// Not text: the first byte that no text has, from 0, after decompression.
    #[error("not a text file (byte {offset}): it looks like {looks_like}")]
    Binary {
        offset: usize,
        looks_like: &'static str,
    },
    /// Text in UTF-16 with bytes that are no character: where, from 0, after decompression.
    #[error("the UTF-16 text is damaged (byte {offset}); save it again, as UTF-8")]
    Utf16 { offset: usize },
    /// Ctrl-C, where the program watches for it.
    #[error("interrupted while it was read; nothing was written")]
    Interrupted,
    /// The gzip stream ends too early.
    #[error(
        "the gzip file is cut short (after {bytes} decompressed bytes); copy or record it again"
    )]
    GzipCut { bytes: usize },
    /// The gzip stream is damaged, its checksum fails, or something else follows it.
    #[error(
        "the gzip file is damaged (after {bytes} decompressed bytes: {source}); copy or record it again"
    )]
    GzipDamaged {
        bytes: usize,
        source: std::io::Error,
    },
}

impl SourceProblem {
    /// The same, of this file.
    pub(super) fn of(self, path: &Path) -> SourceError {
        SourceError {
            path: shown_name(path).to_path_buf(),
            problem: self,
        }
    }
}

/// What the system says of a file, in the user's terms.
impl From<std::io::Error> for SourceProblem {
    fn from(source: std::io::Error) -> Self {
        match source.kind() {
            ErrorKind::NotFound => Self::NotFound,
            ErrorKind::IsADirectory => Self::IsFolder,
            // Sources of this module wrap problems of their own.
            _ => source
                .downcast()
                .unwrap_or_else(|source| Self::Unreadable { source }),
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
    let bytes = read_start(path, limit_bytes.saturating_add(1))?;
    if bytes.len() as u64 > limit_bytes {
        return Err(SourceProblem::TooLarge { limit_bytes }.of(path));
    }
    Ok(bytes)
}

/// The first bytes of a file, as many as `most`, from standard input for `-`.
///
/// # Errors
/// `NotFound`, `IsFolder`, `Unreadable`.
pub fn read_start(path: &Path, most: u64) -> Result<Vec<u8>, SourceError> {
    let mut bytes = Vec::new();
    let read = Raw::open(path).and_then(|raw| Ok(raw.take(most).read_to_end(&mut bytes)?));
    read.map_err(|problem| problem.of(path))?;
    Ok(bytes)
}

/// The bytes of a file as they are, counted. Errors of reading are
/// [`SourceProblem`]s inside.
pub(super) struct Raw<'a> {
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
    pub(super) fn open(path: &Path) -> Result<Self, SourceProblem> {
        if path.as_os_str() == STANDARD_INPUT.0 {
            return Ok(Self::from_reader(std::io::stdin()));
        }
        let file = match File::open(path) {
            Err(_) if path.is_dir() => return Err(SourceProblem::IsFolder),
            opened => opened?,
        };
        let total = file.metadata().map_or(0, |metadata| metadata.len());
        Ok(Self {
            total,
            ..Self::from_reader(file)
        })
    }

    /// What a reader gives.
    pub(super) fn from_reader(reader: impl Read + Send + 'a) -> Self {
        Self {
            file: Box::new(reader),
            read: 0,
            total: 0,
        }
    }

    /// The same with bytes that were taken from its start put back.
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
                Ok(read) => {
                    self.read += read as u64;
                    return Ok(read);
                }
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => return Err(std::io::Error::other(SourceProblem::from(error))),
            }
        }
    }
}
