//! Files as bytes, plain or gzip.

use super::ImportError;
use flate2::bufread::MultiGzDecoder;
use std::io::Read;
use std::path::Path;

/// Largest file that is read, in decompressed bytes.
const BYTES_MAX: u64 = 2 << 30;

/// The bytes of a file, decompressed if its first bytes say gzip.
pub(super) fn read(path: &Path) -> Result<Vec<u8>, ImportError> {
    let unreadable = |cause| ImportError::Unreadable {
        path: path.to_owned(),
        cause,
    };
    let raw = std::fs::read(path).map_err(unreadable)?;
    if !raw.starts_with(&[0x1f, 0x8b]) {
        return Ok(raw);
    }
    let mut bytes = Vec::new();
    let decoder = MultiGzDecoder::new(raw.as_slice());
    decoder
        .take(BYTES_MAX)
        .read_to_end(&mut bytes)
        .map_err(unreadable)?;
    Ok(bytes)
}
