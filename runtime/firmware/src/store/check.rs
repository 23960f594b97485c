//! What a blob is checked for before it is used.

use super::blobs::stored_crc;
use runtime::ParameterSet;
use runtime::blob::BlobError;

/// What a blob is checked for, besides that it is sound.
#[derive(Clone, Copy, Debug)]
pub struct Check {
    /// Serial number of the stage, if it is known: blobs of other stages are refused.
    pub serial: Option<&'static str>,
    /// CRC of a blob that made the program fault while it was checked: it is refused unread.
    pub suspect: Option<u32>,
    /// Called with the CRC of a blob before its check begins, and with `None` after it.
    pub note: fn(Option<u32>),
}

impl From<Option<&'static str>> for Check {
    fn from(serial: Option<&'static str>) -> Self {
        Self {
            serial,
            suspect: None,
            note: |_| {},
        }
    }
}

impl Check {
    /// What `read` makes of a blob, with whatever follows it in `memory`.
    pub(crate) fn guard<T>(
        &self,
        memory: &[u8],
        read: impl FnOnce() -> Result<T, BlobError>,
    ) -> Result<T, BlobError> {
        let crc = stored_crc(memory);
        if crc.is_some() && crc == self.suspect {
            return Err(BlobError::BadPayload);
        }
        (self.note)(crc);
        let done = read();
        (self.note)(None);
        done
    }

    /// Whether this is the stage of the parameters.
    pub(crate) fn is_of_stage(&self, set: &ParameterSet) -> Result<(), BlobError> {
        self.serial
            .map_or(Ok(()), |serial| set.expect_serial(serial))
    }
}
