//! A log file as bytes: opened, decompressed, and refused when it is no text.

use super::error::LogError;
use flate2::bufread::GzDecoder;
use std::borrow::Cow;
use std::io::{ErrorKind, Read};
use std::path::Path;

/// First bytes of every gzip file.
const GZIP_MAGIC: [u8; 2] = [0x1f, 0x8b];

/// Largest log that is read, in decompressed bytes: twenty hours at 2 ms. A file that
/// unpacks to more is damaged or hostile.
const BYTES_MAX: u64 = 2 << 30;

/// How far into a file binary data are looked for.
const PROBE_BYTES: usize = 64 * 1024;

/// Reads a log, decompressing it if its first bytes say gzip.
pub(super) fn read(path: &Path) -> Result<Vec<u8>, LogError> {
    let unreadable = |source: std::io::Error| {
        let path = path.to_path_buf();
        match source.kind() {
            ErrorKind::IsADirectory => LogError::IsFolder { path },
            _ if path.is_dir() => LogError::IsFolder { path },
            ErrorKind::NotFound => LogError::NotFound { path },
            _ => LogError::Unreadable { path, source },
        }
    };
    let mut file = std::fs::File::open(path).map_err(unreadable)?;
    let mut raw = Vec::new();
    read_up_to(&mut file, PROBE_BYTES as u64, &mut raw).map_err(unreadable)?;
    refuse_endless(&raw, path)?;
    read_up_to(&mut file, BYTES_MAX, &mut raw).map_err(unreadable)?;
    unpack(raw.into(), path).map(Cow::into_owned)
}

/// Refuses by its start what is plainly no log: a device or a damaged file may have no end.
fn refuse_endless(start: &[u8], path: &Path) -> Result<(), LogError> {
    if start.starts_with(&GZIP_MAGIC) {
        Ok(())
    } else {
        refuse_binary(start, path)
    }
}

/// Appends what `source` holds, stopping soon after `limit` bytes.
fn read_up_to(source: &mut impl Read, limit: u64, bytes: &mut Vec<u8>) -> std::io::Result<()> {
    source.take(limit.saturating_add(1)).read_to_end(bytes)?;
    Ok(())
}

/// Decompresses `raw` if its first bytes say gzip, and refuses what is no text.
pub(super) fn unpack<'r>(raw: Cow<'r, [u8]>, path: &Path) -> Result<Cow<'r, [u8]>, LogError> {
    if raw.len() as u64 > BYTES_MAX {
        return Err(LogError::TooLarge {
            path: path.to_path_buf(),
            limit_bytes: BYTES_MAX,
        });
    }
    let bytes = if raw.starts_with(&GZIP_MAGIC) {
        Cow::Owned(decompress(&raw, path)?)
    } else {
        raw
    };
    refuse_binary(&bytes, path)?;
    Ok(bytes)
}

/// All members of a gzip file, one after the other.
fn decompress(raw: &[u8], path: &Path) -> Result<Vec<u8>, LogError> {
    let mut bytes = Vec::with_capacity(raw.len().saturating_mul(4));
    let mut rest = raw;
    while !rest.is_empty() {
        if !rest.starts_with(&GZIP_MAGIC) {
            return Err(LogError::GzipTrailing {
                path: path.to_path_buf(),
                bytes: rest.len(),
            });
        }
        let mut decoder = GzDecoder::new(rest);
        // As with a plain file: what is plainly no log is unpacked no further.
        let read = read_up_to(&mut decoder, PROBE_BYTES as u64, &mut bytes);
        if read.is_ok() {
            refuse_binary(&bytes, path)?;
        }
        let room = BYTES_MAX.saturating_sub(bytes.len() as u64);
        let read = read.and_then(|()| read_up_to(&mut decoder, room, &mut bytes));
        if bytes.len() as u64 > BYTES_MAX {
            return Err(LogError::TooLarge {
                path: path.to_path_buf(),
                limit_bytes: BYTES_MAX,
            });
        }
        if let Err(source) = read {
            let (path, bytes) = (path.to_path_buf(), bytes.len());
            return Err(match source.kind() {
                ErrorKind::UnexpectedEof => LogError::GzipCut { path, bytes },
                _ => LogError::GzipDamaged {
                    path,
                    bytes,
                    source,
                },
            });
        }
        rest = decoder.into_inner();
    }
    Ok(bytes)
}

/// Refuses what is plainly no text, with a word on what it seems to be.
fn refuse_binary(bytes: &[u8], path: &Path) -> Result<(), LogError> {
    let looks_like = match bytes {
        [0xff, 0xfe, ..] | [0xfe, 0xff, ..] => Some("text in UTF-16; save it as UTF-8"),
        [b'P', b'K', 3, 4, ..] => Some("a zip archive or spreadsheet; export it as CSV"),
        [0x28, 0xb5, 0x2f, 0xfd, ..] => Some("zstd data; decompress it first"),
        [0xfd, b'7', b'z', b'X', b'Z', ..] => Some("xz data; decompress it first"),
        [b'B', b'Z', b'h', b'1'..=b'9', ..] => Some("bzip2 data; decompress it first"),
        [0x1f, 0x8b, ..] => Some("gzip inside gzip; decompress it once"),
        _ => None,
    };
    let start = bytes.get(..PROBE_BYTES).unwrap_or(bytes);
    let control = |b: &u8| matches!(*b, 0..=8 | 14..=31 | 127);
    let first_control = start.iter().position(control);
    match (looks_like, first_control) {
        (None, None) => Ok(()),
        (looks_like, offset) => Err(LogError::Binary {
            path: path.to_path_buf(),
            offset: offset.unwrap_or(0),
            looks_like: looks_like.unwrap_or("binary data; name a CSV or CSV.gz log"),
        }),
    }
}
