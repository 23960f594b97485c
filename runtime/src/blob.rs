//! The parameter blob: the bytes of a [`ParameterSet`] in a file or in flash.
//!
//! | offset | bytes | what |
//! |---|---|---|
//! | 0 | 4 | magic, `HALL` in ASCII |
//! | 4 | 2 | layout version, little-endian: 1, 2 for the field model, 3 with temperatures, or 4 with a motion correction |
//! | 6 | 1 | 1 if the fit was refused and written all the same, else 0 |
//! | 7 | 1 | reserved: 0 |
//! | 8 | 4 | payload length n in bytes, little-endian |
//! | 12 | n | payload: the [`ParameterSet`] in postcard |
//! | 12 + n | 4 | CRC-32C (Castagnoli) of everything before it, little-endian |
//!
//! The payload holds the fields in the order of the struct: unsigned integers as varints
//! (7 bits a byte, lowest first), signed ones zigzagged first, `f32` as four bytes
//! little-endian, text as a length and its bytes, arrays without a length. `inspect` shows
//! every field; the golden examples in `blob_tests.rs` fix the bytes. In version 2 each probe has
//! the 28 numbers of a [`FieldProbe`](crate::model::FieldProbe), and three matrices that follow
//! from the constants are left out: PM, PM^-1 and the capacitive plane matrix.
//!
//! Version 3 is the layout of the model, with [`Temperature`](crate::Temperature): T0 and reach
//! follow the counts of rows, (k, h) of the probes follow the other numbers. With the field model
//! the geometry is left out, too.
//!
//! Version 4 is version 3 with a [`MotionCorrection`](crate::MotionCorrection) as the last numbers: the
//! rows of A, then of L. Without temperatures T0 and reach are 0, and (k, h) are left out.
//!
//! theta of the probes is the angle of the sensing axis from +Y for A and B and from +X for C (see
//! [`geometry`](crate::geometry)), whatever direction the stage was designed with: in the
//! paper's directions it is the misalignment, and for a probe mounted the other way round it is
//! near pi. So a stage with other directions needs nothing else in the blob.
//!
//! The CRC finds any five flipped bits, any odd number of them, and any burst of up to 32, in
//! every blob of versions 1 to 3: at most 5,216 bits stand before the check, and up to 5,243
//! its Hamming distance is 6 (P. Koopman, 32-bit CRC zoo, polynomial 0x8f6e37a0; by our own
//! search, the first four bits that are missed span 5,276). Beyond, as with the 6,080 bits of the largest
//! blob of version 4, it is 4: any three bits, any odd number and the bursts.
//!
//! In a file the length is exact; in flash the header gives the length and the rest is padding. A
//! layout that cannot be read by this version gets a new version number, and this version's
//! blobs stay readable. Not promised: that an older decoder reads a newer layout, or that two
//! layouts of one calibration have the same length.

use crate::layout;
use crate::model::Probes;
use crate::parameters::{ParameterError, ParameterSet};
use crc::{CRC_32_ISCSI, Crc};

/// First bytes of every blob.
pub const MAGIC: [u8; 4] = *b"HALL";
/// The newest layout that this version reads, with a motion correction. See
/// [`ParameterSet::layout_version`].
pub const LAYOUT_VERSION: u16 = 4;
/// The first layout with temperatures.
pub(crate) const WITH_TEMPERATURE: u16 = 3;
/// Bytes before the payload.
pub const HEADER_BYTES: usize = 12;
/// Bytes of the check after the payload.
pub const CRC_BYTES: usize = 4;
/// The largest blob. Of versions 1 to 3 it is 656.
pub const MAX_BYTES: usize = 764;

/// CRC-32C of a blob.
pub static CRC: Crc<u32> = Crc::<u32>::new(&CRC_32_ISCSI);

/// Why bytes are not a usable blob.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum BlobError {
    /// Shorter than a header, or than the header says.
    #[error("cut short: {found} bytes where at least {needed} are needed")]
    Truncated {
        /// Bytes that are needed, at least.
        needed: usize,
        /// Bytes that are there.
        found: usize,
    },
    /// All bytes are 0xFF or all 0x00: flash that holds no blob.
    #[error("erased memory: no parameter blob was written here")]
    Erased,
    /// The first four bytes are not `HALL`: no parameter blob at all.
    #[error(
        "not a parameter blob: it starts with {found:02x?} where {MAGIC:02x?} (\"HALL\") belongs"
    )]
    BadMagic {
        /// The bytes that are there.
        found: [u8; 4],
    },
    /// A layout that this version does not read.
    #[error("layout version {found}, but this program reads versions 1 to {supported}")]
    UnknownVersion {
        /// Version in the header.
        found: u16,
        /// Newest version that is read.
        supported: u16,
    },
    /// A payload length that no blob has, or reserved bytes that are not zero.
    #[error("damaged header: payload length {payload_bytes}, or reserved bytes not zero")]
    BadHeader {
        /// Payload length in the header.
        payload_bytes: u32,
    },
    /// Bytes follow the blob in a file, where its length must be exact.
    #[error("the blob ends after {blob_bytes} bytes but the file has {found}: padded or joined")]
    TrailingBytes {
        /// Bytes of the blob.
        blob_bytes: usize,
        /// Bytes that are there.
        found: usize,
    },
    /// The check over header and payload fails: a bit is wrong.
    #[error("damaged: stored check {stored:08x}, computed {computed:08x}")]
    BadCrc {
        /// The check that the blob carries.
        stored: u32,
        /// The check of its bytes.
        computed: u32,
    },
    /// The check holds, yet the payload is not a parameter set of this layout.
    #[error("the check holds but the payload cannot be read")]
    BadPayload,
    /// The parameters are readable but unusable.
    #[error("unusable parameters: {0}")]
    Parameters(#[source] ParameterError),
    /// The blob belongs to another stage than expected.
    #[error("the parameters belong to another stage")]
    OtherStage,
    /// The buffer to write into is too small.
    #[error("a blob takes up to {MAX_BYTES} bytes, the buffer has {bytes}")]
    BufferTooSmall {
        /// Its size.
        bytes: usize,
    },
}

impl BlobError {
    /// Its number on the bus and in the state of a node: 1 to 11 in the order of the variants.
    pub const fn number(&self) -> u8 {
        match self {
            Self::Truncated { .. } => 1,
            Self::Erased => 2,
            Self::BadMagic { .. } => 3,
            Self::UnknownVersion { .. } => 4,
            Self::BadHeader { .. } => 5,
            Self::TrailingBytes { .. } => 6,
            Self::BadCrc { .. } => 7,
            Self::BadPayload => 8,
            Self::Parameters(_) => 9,
            Self::OtherStage => 10,
            Self::BufferTooSmall { .. } => 11,
        }
    }
}

impl ParameterSet {
    /// The version of the layout that this set is written in: 4 with a motion correction, else 3 with
    /// temperatures, else 2 with the field model, else 1.
    pub const fn layout_version(&self) -> u16 {
        match self.probes {
            _ if self.motion_correction.is_some() => LAYOUT_VERSION,
            _ if self.constants.temperature.is_used() => WITH_TEMPERATURE,
            Probes::Linear(_) => 1,
            Probes::Field(_) => 2,
        }
    }

    /// Writes the blob into `buffer` ([`MAX_BYTES`] always suffice) and gives its bytes.
    ///
    /// # Errors
    /// [`BlobError::BufferTooSmall`]. The set is not checked: see [`ParameterSet::check`].
    pub fn to_bytes<'b>(&self, buffer: &'b mut [u8]) -> Result<&'b [u8], BlobError> {
        let bytes = buffer.len();
        let too_small = BlobError::BufferTooSmall { bytes };
        let room = buffer.get_mut(HEADER_BYTES..).ok_or(too_small)?;
        let payload = layout::write(self, room).ok_or(too_small)?;
        let payload_bytes = u32::try_from(payload).map_err(|_| too_small)?;
        let header = buffer.first_chunk_mut::<HEADER_BYTES>().ok_or(too_small)?;
        let [m0, m1, m2, m3] = MAGIC;
        let [v0, v1] = self.layout_version().to_le_bytes();
        let [n0, n1, n2, n3] = payload_bytes.to_le_bytes();
        let forced = u8::from(self.fit.forced);
        *header = [m0, m1, m2, m3, v0, v1, forced, 0, n0, n1, n2, n3];
        let end = HEADER_BYTES + payload;
        let (body, rest) = buffer.split_at_mut_checked(end).ok_or(too_small)?;
        let check = rest.first_chunk_mut::<CRC_BYTES>().ok_or(too_small)?;
        *check = CRC.checksum(body).to_le_bytes();
        buffer.get(..end + CRC_BYTES).ok_or(too_small)
    }

    /// Reads a blob that must fill `bytes` exactly, as in a file, and checks it.
    ///
    /// # Errors
    /// Every variant of [`BlobError`] except `BufferTooSmall` and `OtherStage`.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, BlobError> {
        let (_, length) = version_and_length(bytes)?;
        if bytes.len() > length {
            return Err(BlobError::TrailingBytes {
                blob_bytes: length,
                found: bytes.len(),
            });
        }
        Self::from_flash(bytes)
    }

    /// Reads a blob at the start of `memory`, as in flash, where padding follows it, and
    /// checks it.
    ///
    /// # Errors
    /// As [`ParameterSet::from_bytes`], except `TrailingBytes`.
    pub fn from_flash(memory: &[u8]) -> Result<Self, BlobError> {
        let (version, length) = version_and_length(memory)?;
        let blob = memory.get(..length).ok_or(BlobError::Truncated {
            needed: length,
            found: memory.len(),
        })?;
        let (body, check) = blob
            .split_last_chunk::<CRC_BYTES>()
            .ok_or(BlobError::BadPayload)?;
        let stored = u32::from_le_bytes(*check);
        let computed = CRC.checksum(body);
        if stored != computed {
            return Err(BlobError::BadCrc { stored, computed });
        }
        let (header, payload) =
            (body.split_at_checked(HEADER_BYTES)).ok_or(BlobError::BadPayload)?;
        // Changed where it was read: a copy on the stack of a controller is 780 bytes.
        let mut read = layout::read(payload, version);
        let set = read.as_mut().ok_or(BlobError::BadPayload)?;
        // Each version holds its own models.
        if version != set.layout_version() {
            return Err(BlobError::BadPayload);
        }
        set.fit.forced = header.get(6) == Some(&1);
        layout::check_finite(set).map_err(BlobError::Parameters)?;
        set.check_terms().map_err(BlobError::Parameters)?;
        read.ok_or(BlobError::BadPayload)
    }

    /// Refuses a set of another stage than `serial`.
    ///
    /// # Errors
    /// [`BlobError::OtherStage`].
    pub fn expect_serial(&self, serial: &str) -> Result<(), BlobError> {
        if self.serial.as_bytes() == serial.as_bytes() {
            Ok(())
        } else {
            Err(BlobError::OtherStage)
        }
    }
}

/// The layout and the whole length of the blob that starts `bytes`, by its header.
fn version_and_length(bytes: &[u8]) -> Result<(u16, usize), BlobError> {
    let header = bytes
        .first_chunk::<HEADER_BYTES>()
        .ok_or(BlobError::Truncated {
            needed: HEADER_BYTES,
            found: bytes.len(),
        })?;
    if header.iter().all(|&b| b == 0xff) || header.iter().all(|&b| b == 0) {
        return Err(BlobError::Erased);
    }
    let [m0, m1, m2, m3, v0, v1, forced, reserved, n0, n1, n2, n3] = *header;
    let found = [m0, m1, m2, m3];
    if found != MAGIC {
        return Err(BlobError::BadMagic { found });
    }
    let version = u16::from_le_bytes([v0, v1]);
    if !(1..=LAYOUT_VERSION).contains(&version) {
        return Err(BlobError::UnknownVersion {
            found: version,
            supported: LAYOUT_VERSION,
        });
    }
    let payload_bytes = u32::from_le_bytes([n0, n1, n2, n3]);
    let most = MAX_BYTES - HEADER_BYTES - CRC_BYTES;
    match usize::try_from(payload_bytes) {
        Ok(payload) if payload <= most && forced <= 1 && reserved == 0 => {
            Ok((version, HEADER_BYTES + payload + CRC_BYTES))
        }
        _ => Err(BlobError::BadHeader { payload_bytes }),
    }
}

#[cfg(test)]
#[path = "blob_tests.rs"]
mod tests;
