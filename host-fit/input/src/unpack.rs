//! A file that is decompressed as it is read, if its first bytes say gzip.

use super::source::{Raw, SourceProblem};
use flate2::bufread::MultiGzDecoder;
use std::io::{BufReader, ErrorKind, Read};

/// First bytes of every gzip file, and of every member of one.
const GZIP_MAGIC: [u8; 2] = [0x1f, 0x8b];

/// Bytes of a file that are read at once where a buffer is needed.
const BUFFER_BYTES: usize = 64 * 1024;

/// The bytes of a file, of gzip those of all members, one after the other. Errors of reading are
/// [`SourceProblem`]s inside.
pub(super) struct Unpacked<'a> {
    source: Source<'a>,
    /// Decompressed bytes that were read.
    bytes: usize,
}

enum Source<'a> {
    Plain(BufReader<Raw<'a>>),
    Gzip(Box<MultiGzDecoder<BufReader<Raw<'a>>>>),
}

impl<'a> Unpacked<'a> {
    /// What is in `raw`.
    ///
    /// # Errors
    /// Those of reading.
    pub(super) fn new(mut raw: Raw<'a>) -> std::io::Result<Self> {
        // The first two bytes, which a pipe may give one at a time.
        let mut start = Vec::new();
        (&mut raw)
            .take(GZIP_MAGIC.len() as u64)
            .read_to_end(&mut start)?;
        let is_gzip = start == GZIP_MAGIC;
        let whole = BufReader::with_capacity(BUFFER_BYTES, raw.preceded_by(start));
        let source = match is_gzip {
            true => Source::Gzip(Box::new(MultiGzDecoder::new(whole))),
            false => Source::Plain(whole),
        };
        Ok(Self { source, bytes: 0 })
    }

    /// How many bytes of the file were read, and how many it has; 0 where that is not known.
    pub(super) fn progress(&self) -> (u64, u64) {
        let raw = match &self.source {
            Source::Plain(raw) => raw.get_ref(),
            Source::Gzip(decoder) => decoder.get_ref().get_ref(),
        };
        (raw.read, raw.total)
    }

    /// An error of the decoder, in the user's terms.
    fn damaged(&self, source: std::io::Error) -> std::io::Error {
        let bytes = self.bytes;
        match source.kind() {
            ErrorKind::UnexpectedEof => std::io::Error::other(SourceProblem::GzipCut { bytes }),
            ErrorKind::InvalidInput | ErrorKind::InvalidData => {
                std::io::Error::other(SourceProblem::GzipDamaged { bytes, source })
            }
            // Of the file below.
            _ => source,
        }
    }
}

impl Read for Unpacked<'_> {
    fn read(&mut self, bytes: &mut [u8]) -> std::io::Result<usize> {
        let decoder = match &mut self.source {
            Source::Plain(raw) => return raw.read(bytes),
            Source::Gzip(decoder) => decoder,
        };
        let read = decoder.read(bytes).map_err(|error| self.damaged(error))?;
        self.bytes += read;
        Ok(read)
    }
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
    fn a_fault_of_the_system_is_not_reported_as_one_of_the_gzip_data() {
        let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::none());
        encoder.write_all(&[b'a'; 1000]).expect("in memory");
        let packed = encoder.finish().expect("in memory");
        for kind in [ErrorKind::OutOfMemory, ErrorKind::PermissionDenied] {
            let half = packed[..500].chain(Failing(kind));
            let mut unpacked = Unpacked::new(Raw::from_reader(half)).expect("gzip");
            let error = unpacked.read_to_end(&mut Vec::new()).expect_err("refused");
            let SourceProblem::Unreadable { source } = error.into() else {
                panic!("another problem");
            };
            assert_eq!(source.kind(), kind);
        }
    }
}
