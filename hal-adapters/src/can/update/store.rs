//! What the transfer needs of the memory that keeps the records.

/// The record that runs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Running<'r> {
    /// Where it lies: number of the sector or slot.
    pub slot: u8,
    /// Its sequence number; 0 for a blob that a probe has flashed.
    pub sequence: u32,
    /// The blob, byte for byte.
    pub blob: &'r [u8],
    /// Serial number of its stage, as the blob tells.
    pub serial: &'r str,
    /// When it was made, as the blob tells.
    pub created: &'r str,
    /// rms error of X, Y, Rz of its fit: m, m, rad.
    pub rms: [f32; 3],
    /// Peak error of X, Y, Rz of its fit: m, m, rad.
    pub peak: [f32; 3],
}

/// A record in the store.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Kept {
    /// Its sequence number; 0 for a blob that a probe has flashed.
    pub sequence: u32,
    /// The CRC-32C of its blob.
    pub crc: u32,
}

/// What is to be stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Change<'b> {
    /// A new blob.
    Blob(&'b [u8]),
    /// The record before the newest one again.
    Previous,
}

/// How far a change is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Written {
    /// Call again.
    InProgress,
    /// The record is whole, committed and read back.
    Done,
    /// It could not be written. The next start settles whether the record counts; until then the one
    /// before is the newest.
    Failed,
}

/// Keeps records over a loss of power.
pub trait Store {
    /// The record that runs, if there is one.
    fn running(&self) -> Option<Running<'_>>;

    /// The record that runs from the next reset on.
    fn newest(&self) -> Option<Kept>;

    /// The record to which [`Change::Previous`] goes back.
    fn previous(&self) -> Option<Kept>;

    /// The highest sequence number of any committed record, of one that is refused too; 0 if
    /// there is none.
    fn newest_sequence(&self) -> u32;

    /// Whether records can be written before the next start. If not, that start may try again.
    fn is_writable(&self) -> bool {
        true
    }

    /// Whether a record of any size fits without an erase.
    fn has_room(&self) -> bool;

    /// Writes a part of a change, as long as fits between two ticks. It is called in every tick with
    /// the same arguments until it gives something other than [`Written::InProgress`], and then
    /// not again for this change. `sequence` is one above [`Store::newest_sequence`].
    fn write(&mut self, sequence: u32, change: Change<'_>) -> Written;
}
