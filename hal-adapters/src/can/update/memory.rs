//! A store in RAM, for the tests of the receiver.

use super::staging::crc_of;
use super::store::{Change, Kept, Running, Store, Written};
use runtime::blob::MAX_BYTES;
use runtime::{BlobError, ParameterSet};

/// Words that it writes in one tick.
const WORDS_PER_TICK: usize = 4;

/// A record.
#[derive(Clone, Debug)]
struct Record {
    sequence: u32,
    length: usize,
    bytes: [u8; MAX_BYTES],
}

impl Record {
    /// `None` for what no record holds.
    fn of(sequence: u32, blob: &[u8]) -> Option<Self> {
        let mut bytes = [0; MAX_BYTES];
        let length = blob.len();
        bytes.get_mut(..length)?.copy_from_slice(blob);
        Some(Self {
            sequence,
            length,
            bytes,
        })
    }

    fn blob(&self) -> &[u8] {
        self.bytes.get(..self.length).unwrap_or_default()
    }

    fn kept(&self) -> Option<Kept> {
        let (sequence, crc) = (self.sequence, crc_of(self.blob())?);
        Some(Kept { sequence, crc })
    }
}

/// Keeps the newest record and the one before, and runs what was newest at the last reset.
#[derive(Clone, Debug, Default)]
pub struct MemoryStore {
    newest: Option<Record>,
    previous: Option<Record>,
    running: Option<(Record, ParameterSet)>,
    /// Ticks that the write in progress took so far.
    ticks: usize,
    writes: u32,
}

impl MemoryStore {
    /// A store that holds a blob, and runs it.
    ///
    /// # Errors
    /// The blob is not sound.
    pub fn holding(sequence: u32, blob: &[u8]) -> Result<Self, BlobError> {
        ParameterSet::from_bytes(blob)?;
        let mut store = Self {
            newest: Record::of(sequence, blob),
            ..Self::default()
        };
        store.reset();
        Ok(store)
    }

    /// The node is reset: what is newest runs, and a write in progress is lost.
    pub fn reset(&mut self) {
        self.ticks = 0;
        self.running = self.newest.clone().and_then(|record| {
            let set = ParameterSet::from_bytes(record.blob()).ok()?;
            Some((record, set))
        });
    }

    /// The newest blob.
    pub fn newest_blob(&self) -> Option<&[u8]> {
        self.newest.as_ref().map(Record::blob)
    }

    /// Records written since the store was made.
    pub const fn writes(&self) -> u32 {
        self.writes
    }
}

impl Store for MemoryStore {
    fn running(&self) -> Option<Running<'_>> {
        let (record, set) = self.running.as_ref()?;
        Some(Running {
            slot: 0,
            sequence: record.sequence,
            blob: record.blob(),
            serial: &set.serial,
            created: &set.created,
            rms: set.fit.rms,
            peak: set.fit.peak,
        })
    }

    fn newest(&self) -> Option<Kept> {
        self.newest.as_ref()?.kept()
    }

    fn previous(&self) -> Option<Kept> {
        self.previous.as_ref()?.kept()
    }

    fn newest_sequence(&self) -> u32 {
        self.newest.as_ref().map_or(0, |record| record.sequence)
    }

    fn has_room(&self) -> bool {
        true
    }

    fn write(&mut self, sequence: u32, change: Change<'_>) -> Written {
        let blob = match change {
            Change::Blob(blob) => blob,
            Change::Previous => self.previous.as_ref().map_or(&[][..], Record::blob),
        };
        self.ticks += 1;
        if self.ticks * WORDS_PER_TICK < blob.len() / 4 {
            return Written::InProgress;
        }
        self.ticks = 0;
        let Some(record) = Record::of(sequence, blob) else {
            return Written::Failed;
        };
        self.previous = self.newest.replace(record);
        self.writes += 1;
        Written::Done
    }
}
