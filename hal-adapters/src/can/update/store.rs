//! What the transfer needs of the memory that keeps the parameters.

/// The blob that runs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Running<'r> {
    /// Number of its slot.
    pub slot: u8,
    /// Its sequence number; 0 for a blob that a probe has flashed.
    pub sequence: u32,
    /// Its CRC-32C.
    pub crc: u32,
    /// Its length, bytes.
    pub bytes: u32,
    /// Whether the fit was refused and written all the same.
    pub is_forced: bool,
    /// Serial number of its stage, as the blob says.
    pub serial: &'r str,
    /// When it was made, as the blob says.
    pub created: &'r str,
    /// rms error of X, Y, Rz of its fit: m, m, rad.
    pub rms: [f32; 3],
    /// Peak error of X, Y, Rz of its fit: m, m, rad.
    pub peak: [f32; 3],
}

/// A blob in the store.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Kept {
    /// Its sequence number; 0 for a blob that a probe has flashed.
    pub sequence: u32,
    /// Its CRC-32C.
    pub crc: u32,
}

/// What is to be stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Change<'b> {
    /// A new blob.
    Blob(&'b [u8]),
    /// The blob before the newest again.
    Previous,
}

/// Why a change was not stored. What was the newest blob still is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NotWritten {
    /// The supply is too low to write.
    SupplyLow,
    /// The memory failed.
    Failed,
}

/// Keeps two blobs over a loss of power.
pub trait Store {
    /// The blob that runs, if there is one.
    fn running(&self) -> Option<Running<'_>>;

    /// A word of the blob that runs, from 0; the last one is padded with zeros.
    fn word(&mut self, index: usize) -> Option<u32>;

    /// The blob that runs once it is activated, or after power-on.
    fn newest(&self) -> Option<Kept>;

    /// The blob to which [`Change::Previous`] goes back.
    fn previous(&self) -> Option<Kept>;

    /// The highest sequence number of any blob, of one that is refused too; 0 if there is none.
    fn newest_sequence(&self) -> u32;

    /// Stores a change, whole and read back; it may take half a second. `sequence` is one above
    /// [`Store::newest_sequence`].
    ///
    /// # Errors
    /// [`NotWritten`].
    fn write(&mut self, sequence: u32, change: Change<'_>) -> Result<(), NotWritten>;
}
