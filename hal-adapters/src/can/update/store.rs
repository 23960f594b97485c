//! What the transfer needs of the memory that keeps the parameters.

/// A blob in the store.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BlobId {
    /// Its sequence number; 0 for a blob that a probe has flashed.
    pub sequence: u32,
    /// Its CRC-32C.
    pub crc: u32,
}

/// The blob that runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Running<'r> {
    /// Sequence number and CRC.
    pub id: BlobId,
    /// Its length, bytes.
    pub bytes: u32,
    /// Serial number of its stage.
    pub serial: &'r str,
}

/// Why a blob was not stored. The newest blob is then the same as before.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NotWritten {
    /// The supply is too low to write.
    SupplyLow,
    /// The memory failed.
    Failed,
}

/// Keeps two blobs over a loss of power.
pub trait Store {
    /// The blob that runs.
    fn running(&self) -> Option<Running<'_>>;

    /// A word of the blob that runs, from 0; the last one is padded with zeros.
    fn word(&mut self, index: usize) -> Option<u32>;

    /// The blob that runs after an activation or power-on.
    fn newest(&self) -> Option<BlobId>;

    /// The highest sequence number of any blob, refused blobs included; 0 for none.
    fn newest_sequence(&self) -> u32;

    /// Stores a blob under `sequence`, one above [`Store::newest_sequence`], and reads it back. This may
    /// take half a second.
    ///
    /// # Errors
    /// [`NotWritten`].
    fn write(&mut self, sequence: u32, blob: &[u8]) -> Result<(), NotWritten>;
}
