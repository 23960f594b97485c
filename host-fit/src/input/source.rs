//! A file as bytes: opened, decompressed if its first bytes say gzip, and refused when it is
//! no text where text is needed. `-` is standard input.

use super::{binary, encoding};
use flate2::bufread::GzDecoder;
use std::borrow::Cow;
use std::io::{ErrorKind, Read};
use std::path::{Path, PathBuf};

/// First bytes of every gzip file.
pub(crate) const GZIP_MAGIC: [u8; 2] = [0x1f, 0x8b];

/// Largest log that is read, in decompressed bytes: twenty hours at 2 ms. A file that
/// unpacks to more is damaged or hostile.
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

/// A file of text, plain or gzip, as it is encoded. What is plainly no text is refused by its
/// start: a device or a damaged file may have no end.
///
/// # Errors
/// Every variant of [`SourceError`] but `Utf16`.
pub fn read_text(path: &Path) -> Result<Vec<u8>, SourceError> {
    let plain = |start: &[u8]| match start {
        _ if start.starts_with(&GZIP_MAGIC) => Ok(()),
        _ => refuse_binary(start, path),
    };
    let raw = read_up_to(path, BYTES_MAX, plain)?;
    unpack_text(raw.into(), path).map(Cow::into_owned)
}

/// The text of a file that is in memory, plain or gzip, as it is encoded; `path` is only named
/// in errors.
///
/// # Errors
/// `TooLarge`, `Binary` and those of gzip.
pub fn unpack_text<'r>(raw: Cow<'r, [u8]>, path: &Path) -> Result<Cow<'r, [u8]>, SourceError> {
    let bytes = unpack(raw, path, |start| refuse_binary(start, path))?;
    refuse_binary(&bytes, path)?;
    Ok(bytes)
}

/// A text of [`read_text`] in UTF-8, or in another encoding that has ASCII in it.
///
/// # Errors
/// `Utf16`, `Binary`.
pub fn to_utf8<'t>(text: &'t [u8], path: &Path) -> Result<Cow<'t, [u8]>, SourceError> {
    let utf8 = encoding::to_utf8(text).map_err(|bytes| SourceError::Utf16 {
        path: shown_name(path).to_path_buf(),
        offset: bytes.start,
    })?;
    refuse_binary(&utf8, path)?;
    Ok(utf8)
}

/// A file of any bytes, plain or gzip.
///
/// # Errors
/// Every variant of [`SourceError`] but `Binary`.
pub fn read_bytes(path: &Path) -> Result<Vec<u8>, SourceError> {
    let raw = read_whole(path, BYTES_MAX)?;
    unpack(raw.into(), path, |_| Ok(())).map(Cow::into_owned)
}

/// A file of at most `limit_bytes`, as it is.
///
/// # Errors
/// `NotFound`, `IsFolder`, `Unreadable`, `TooLarge`.
pub fn read_whole(path: &Path, limit_bytes: u64) -> Result<Vec<u8>, SourceError> {
    read_up_to(path, limit_bytes, |_| Ok(()))
}

/// Reads a file whose start `look` does not refuse.
fn read_up_to(
    path: &Path,
    limit_bytes: u64,
    look: impl Fn(&[u8]) -> Result<(), SourceError>,
) -> Result<Vec<u8>, SourceError> {
    let standard = is_standard(path);
    let unreadable = |error| unreadable(path, error);
    let mut file: Box<dyn Read> = match standard {
        true => Box::new(std::io::stdin().lock()),
        false => Box::new(std::fs::File::open(path).map_err(unreadable)?),
    };
    let mut raw = probe(&mut file).map_err(unreadable)?;
    look(&raw)?;
    append(&mut file, limit_bytes, &mut raw).map_err(unreadable)?;
    refuse_large(&raw, limit_bytes, path)?;
    Ok(raw)
}

/// Whether a text that starts like this is UTF-16.
pub(crate) fn is_utf16(start: &[u8]) -> bool {
    encoding::is_utf16(start)
}

/// Whether a name means standard input.
pub(crate) fn is_standard(path: &Path) -> bool {
    path.as_os_str() == STANDARD_INPUT.0
}

/// The start of an input, by which it is told whether it is text.
pub(crate) fn probe(source: &mut impl Read) -> std::io::Result<Vec<u8>> {
    let mut start = Vec::new();
    append(source, binary::PROBE_BYTES as u64, &mut start)?;
    Ok(start)
}

/// What the system says of a file, in the user's terms.
pub(crate) fn unreadable(path: &Path, source: std::io::Error) -> SourceError {
    let standard = is_standard(path);
    let path = shown_name(path).to_path_buf();
    match source.kind() {
        ErrorKind::IsADirectory => SourceError::IsFolder { path },
        _ if !standard && path.is_dir() => SourceError::IsFolder { path },
        ErrorKind::NotFound => SourceError::NotFound { path },
        _ => SourceError::Unreadable { path, source },
    }
}

/// Appends what `source` holds, stopping soon after `limit` bytes.
fn append(source: &mut impl Read, limit: u64, bytes: &mut Vec<u8>) -> std::io::Result<()> {
    source.take(limit.saturating_add(1)).read_to_end(bytes)?;
    Ok(())
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

/// Decompresses `raw` if its first bytes say gzip: all members, one after the other, no
/// further than a start that `look` refuses.
fn unpack<'r>(
    raw: Cow<'r, [u8]>,
    path: &Path,
    look: impl Fn(&[u8]) -> Result<(), SourceError>,
) -> Result<Cow<'r, [u8]>, SourceError> {
    refuse_large(&raw, BYTES_MAX, path)?;
    if !raw.starts_with(&GZIP_MAGIC) {
        return Ok(raw);
    }
    let mut bytes = Vec::with_capacity(raw.len().saturating_mul(4));
    let mut rest: &[u8] = &raw;
    while !rest.is_empty() {
        if !rest.starts_with(&GZIP_MAGIC) {
            return Err(SourceError::GzipTrailing {
                path: shown_name(path).to_path_buf(),
                bytes: rest.len(),
            });
        }
        let mut decoder = GzDecoder::new(rest);
        let read = append(&mut decoder, binary::PROBE_BYTES as u64, &mut bytes);
        if read.is_ok() {
            look(&bytes)?;
        }
        let room = BYTES_MAX.saturating_sub(bytes.len() as u64);
        let read = read.and_then(|()| append(&mut decoder, room, &mut bytes));
        refuse_large(&bytes, BYTES_MAX, path)?;
        if let Err(source) = read {
            let (path, bytes) = (shown_name(path).to_path_buf(), bytes.len());
            return Err(match source.kind() {
                ErrorKind::UnexpectedEof => SourceError::GzipCut { path, bytes },
                _ => SourceError::GzipDamaged {
                    path,
                    bytes,
                    source,
                },
            });
        }
        rest = decoder.into_inner();
    }
    Ok(Cow::Owned(bytes))
}

/// Refuses what is plainly no text, with a word on what it seems to be.
pub(crate) fn refuse_binary(bytes: &[u8], path: &Path) -> Result<(), SourceError> {
    match binary::in_text(bytes) {
        Some((offset, looks_like)) if !encoding::is_utf16(bytes) => Err(SourceError::Binary {
            path: shown_name(path).to_path_buf(),
            offset,
            looks_like,
        }),
        _ => Ok(()),
    }
}
