//! Opens and reads files. `-` is standard input.

use std::fs::File;
use std::io::{ErrorKind, Read};
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
    /// Text, and no table.
    #[error("no table of numbers: it looks like {looks_like}")]
    OtherFormat { looks_like: &'static str },
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
    /// The problem of this file, as an error.
    pub(super) fn in_file(self, path: &Path) -> SourceError {
        SourceError {
            path: shown_name(path).to_path_buf(),
            problem: self,
        }
    }
}

impl From<std::io::Error> for SourceProblem {
    fn from(source: std::io::Error) -> Self {
        match source.kind() {
            ErrorKind::NotFound => Self::NotFound,
            ErrorKind::IsADirectory => Self::IsFolder,
            _ => Self::Unreadable { source },
        }
    }
}

/// The name of an input in messages.
pub fn shown_name(path: &Path) -> &Path {
    let (argument, name) = STANDARD_INPUT;
    match path.as_os_str() == argument {
        true => Path::new(name),
        false => path,
    }
}

/// All bytes of a file, at most `limit_bytes`.
///
/// # Errors
/// `NotFound`, `IsFolder`, `Unreadable`, `TooLarge`.
pub fn read_whole(path: &Path, limit_bytes: u64) -> Result<Vec<u8>, SourceError> {
    let bytes = read_start(path, limit_bytes.saturating_add(1))?;
    if bytes.len() as u64 > limit_bytes {
        return Err(SourceProblem::TooLarge { limit_bytes }.in_file(path));
    }
    Ok(bytes)
}

/// The first bytes of a file, at most `most`; of standard input for `-`.
///
/// # Errors
/// `NotFound`, `IsFolder`, `Unreadable`.
pub fn read_start(path: &Path, most: u64) -> Result<Vec<u8>, SourceError> {
    let mut bytes = Vec::new();
    let read = open(path).and_then(|(file, _)| Ok(file.take(most).read_to_end(&mut bytes)?));
    read.map_err(|problem| problem.in_file(path))?;
    Ok(bytes)
}

/// Opens a file for reading, and gives its length: 0 where it is not known.
///
/// # Errors
/// `NotFound`, `IsFolder`, `Unreadable`.
pub(super) fn open(path: &Path) -> Result<(Box<dyn Read + Send>, u64), SourceProblem> {
    if path.as_os_str() == STANDARD_INPUT.0 {
        return Ok((Box::new(std::io::stdin()), 0));
    }
    let file = match File::open(path) {
        Err(_) if path.is_dir() => return Err(SourceProblem::IsFolder),
        opened => opened?,
    };
    let length = file.metadata().map_or(0, |metadata| metadata.len());
    Ok((Box::new(file), length))
}
