//! A blob on its way from a master into the store.
//!
//! ```text
//! Idle --begin--> Receiving, data in any order --verify--> Verified --commit--> Writing
//! Writing --step, until the record is complete--> Idle
//! ```
//!
//! The pieces are staged in RAM. Flash is touched only by [`Transfer::step`] after a commit, and
//! a commit needs a blob that is complete, has the check that was announced, passes the full
//! check of its parameters and of its serial number, and has the sequence number that is due.
//! A session belongs to the master whose token began it; another master waits until it ends,
//! which it also does when nothing was heard for [`IDLE_MS`]. Every message may be repeated.
//!
//! Who may begin, and in which state of the stage, is the caller's to decide.

use super::flash::{Flash, WriteFault};
use super::writing::{Step, Writing};
use super::{Record, Refused, Store};
use runtime::blob::{BlobError, CRC_BYTES, MAX_BYTES};

/// After so long without a message a session ends, ms.
pub const IDLE_MS: u32 = 5000;

/// Words of the largest blob.
const WORDS: usize = MAX_BYTES.div_ceil(4);

/// What a master announces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Offer<'t> {
    /// Length of the blob, bytes.
    pub bytes: usize,
    /// The check at the end of the blob: its last four bytes, little-endian.
    pub crc: u32,
    /// Serial number of the stage that it is for.
    pub serial: &'t str,
    /// Its sequence number: the one that is due, [`Store::due`].
    pub sequence: u32,
}

/// Why a message changes nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum TransferRefused {
    /// Another master's session is open, or a record is being written.
    Busy,
    /// This master has no session.
    NoSession,
    /// No blob has this length.
    Length {
        /// The length that was announced, bytes.
        bytes: usize,
    },
    /// A piece that does not begin at a multiple of four bytes, does not end at one or with the
    /// blob, is empty, or reaches beyond the blob.
    Misplaced {
        /// Where the piece begins, bytes.
        offset: usize,
    },
    /// A piece that was there before, with other bytes.
    Differs {
        /// The first word that differs, bytes.
        offset: usize,
    },
    /// The blob is not complete.
    Missing {
        /// The first word that is missing, bytes.
        offset: usize,
    },
    /// The check of the blob is not the one that was announced.
    OtherCrc {
        /// The blob's.
        staged: u32,
    },
    /// Commit without verify.
    NotVerified,
    /// The store refuses.
    Store(Refused),
}

/// How far a transfer is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Progress {
    /// Nothing is being written.
    Idle,
    /// Words are left to write.
    Writing,
    /// A record was written and will be used by the next start.
    Done {
        /// Its sequence number.
        sequence: u32,
    },
}

#[derive(Debug)]
enum State {
    Idle,
    Receiving,
    Verified,
    Writing(Writing),
}

/// The state of a transfer, with the RAM that the blob is staged in.
#[derive(Debug)]
pub struct Transfer {
    state: State,
    record: Record,
    token: u32,
    bytes: usize,
    crc: u32,
    sequence: u32,
    heard_ms: u32,
    /// A bit for each word of the blob that is there.
    received: [u32; WORDS.div_ceil(32)],
    /// Token and sequence number of the last record that was written.
    done: Option<(u32, u32)>,
}

impl Transfer {
    /// No transfer.
    pub const IDLE: Self = Self {
        state: State::Idle,
        record: Record::EMPTY,
        token: 0,
        bytes: 0,
        crc: 0,
        sequence: 0,
        heard_ms: 0,
        received: [0; WORDS.div_ceil(32)],
        done: None,
    };

    /// Begins a session. The same offer again keeps what has been received; another offer of the
    /// same master starts anew.
    ///
    /// # Errors
    /// [`TransferRefused::Busy`], [`TransferRefused::Length`], and of the store
    /// [`Refused::Sequence`] and [`Refused::Blob`] with [`BlobError::OtherStage`].
    pub fn begin(
        &mut self,
        store: &Store,
        token: u32,
        offer: &Offer<'_>,
        now_ms: u32,
    ) -> Result<(), TransferRefused> {
        self.expire(now_ms);
        match self.state {
            State::Writing(_) => return Err(TransferRefused::Busy),
            State::Receiving | State::Verified if self.token != token => {
                return Err(TransferRefused::Busy);
            }
            State::Receiving | State::Verified
                if (self.bytes, self.crc, self.sequence)
                    == (offer.bytes, offer.crc, offer.sequence) =>
            {
                self.heard_ms = now_ms;
                return Ok(());
            }
            State::Idle | State::Receiving | State::Verified => {}
        }
        let bytes = offer.bytes;
        if bytes <= CRC_BYTES || bytes > MAX_BYTES {
            return Err(TransferRefused::Length { bytes });
        }
        if store.serial.is_some_and(|serial| serial != offer.serial) {
            return Err(TransferRefused::Store(Refused::Blob(BlobError::OtherStage)));
        }
        if store.due() != Some(offer.sequence) {
            return Err(TransferRefused::Store(store.not_due()));
        }
        (self.state, self.token, self.heard_ms) = (State::Receiving, token, now_ms);
        (self.bytes, self.crc, self.sequence) = (bytes, offer.crc, offer.sequence);
        self.received = [0; WORDS.div_ceil(32)];
        Ok(())
    }

    /// Stages a piece of the blob: it begins at a multiple of four bytes and ends at one, or with
    /// the blob. What is there already must be the same.
    ///
    /// # Errors
    /// [`TransferRefused::NoSession`], [`TransferRefused::Misplaced`],
    /// [`TransferRefused::Differs`]; nothing of the piece is staged then.
    pub fn data(
        &mut self,
        token: u32,
        offset: usize,
        piece: &[u8],
        now_ms: u32,
    ) -> Result<(), TransferRefused> {
        self.heard(token, now_ms)?;
        let end = offset.checked_add(piece.len()).filter(|&end| {
            end <= self.bytes
                && end > offset
                && offset.is_multiple_of(4)
                && (end.is_multiple_of(4) || end == self.bytes)
        });
        end.ok_or(TransferRefused::Misplaced { offset })?;
        let mut all = true;
        for (offset, word) in (offset..).step_by(4).zip(piece.chunks(4)) {
            let there = self.is_received(offset / 4);
            let staged = self
                .record
                .staged(MAX_BYTES)
                .get(offset..offset + word.len());
            if there && staged != Some(word) {
                return Err(TransferRefused::Differs { offset });
            }
            all &= there;
        }
        if all {
            return Ok(());
        }
        if let Some(staged) = self.record.room().get_mut(offset..offset + piece.len()) {
            staged.copy_from_slice(piece);
        }
        for index in offset / 4..(offset + piece.len()).div_ceil(4) {
            if let Some(bits) = self.received.get_mut(index / 32) {
                *bits |= 1 << (index % 32);
            }
        }
        Ok(())
    }

    /// Checks the whole blob: complete, the check that was announced, parameters, serial number,
    /// sequence number. After any refusal except `Missing` all of the blob is missing again.
    ///
    /// # Errors
    /// [`TransferRefused::NoSession`], [`TransferRefused::Missing`],
    /// [`TransferRefused::OtherCrc`], [`TransferRefused::Store`].
    pub fn verify(
        &mut self,
        store: &Store,
        token: u32,
        now_ms: u32,
    ) -> Result<(), TransferRefused> {
        self.heard(token, now_ms)?;
        if !matches!(self.state, State::Receiving) {
            return Ok(());
        }
        if let Some(offset) = self.missing() {
            return Err(TransferRefused::Missing { offset });
        }
        let check = self.record.staged(self.bytes).last_chunk::<CRC_BYTES>();
        let staged = check.map_or(0, |check| u32::from_le_bytes(*check));
        let made = if staged == self.crc {
            (store.update(&mut self.record, self.bytes, self.sequence))
                .map_err(TransferRefused::Store)
        } else {
            Err(TransferRefused::OtherCrc { staged })
        };
        if let Err(refused) = made {
            self.received = [0; WORDS.div_ceil(32)];
            return Err(refused);
        }
        self.state = State::Verified;
        Ok(())
    }

    /// Lets [`Transfer::step`] write what was verified. Repeated, it tells how far that is, also
    /// once the record was written.
    ///
    /// # Errors
    /// [`TransferRefused::NoSession`], [`TransferRefused::NotVerified`],
    /// [`TransferRefused::Store`].
    pub fn commit(
        &mut self,
        store: &mut Store,
        flash: &impl Flash,
        token: u32,
        now_ms: u32,
    ) -> Result<Progress, TransferRefused> {
        if let (State::Idle, Some((last, sequence))) = (&self.state, self.done)
            && last == token
        {
            return Ok(Progress::Done { sequence });
        }
        self.heard(token, now_ms)?;
        match self.state {
            State::Writing(_) => Ok(Progress::Writing),
            State::Verified => {
                let writing = (store.begin(flash, &self.record)).map_err(TransferRefused::Store)?;
                self.state = State::Writing(writing);
                Ok(Progress::Writing)
            }
            State::Idle | State::Receiving => Err(TransferRefused::NotVerified),
        }
    }

    /// Ends a session whose record is not being written.
    ///
    /// # Errors
    /// [`TransferRefused::NoSession`], [`TransferRefused::Busy`].
    pub fn abort(&mut self, token: u32, now_ms: u32) -> Result<(), TransferRefused> {
        self.heard(token, now_ms)?;
        if matches!(self.state, State::Writing(_)) {
            return Err(TransferRefused::Busy);
        }
        self.state = State::Idle;
        Ok(())
    }

    /// Writes the next word, if a record is being written.
    ///
    /// # Errors
    /// [`WriteFault`]: the session is over, and the store takes no other record before the next
    /// start.
    pub fn step(
        &mut self,
        store: &mut Store,
        flash: &mut impl Flash,
    ) -> Result<Progress, WriteFault> {
        let State::Writing(writing) = &mut self.state else {
            return Ok(Progress::Idle);
        };
        match writing.step(flash, &self.record) {
            Ok(Step::More) => Ok(Progress::Writing),
            Ok(Step::Done) => {
                store.finish(flash, writing);
                let sequence = self.sequence;
                self.state = State::Idle;
                self.done = Some((self.token, sequence));
                Ok(Progress::Done { sequence })
            }
            Err(fault) => {
                self.state = State::Idle;
                Err(fault)
            }
        }
    }

    /// Ends a session of which nothing was heard for [`IDLE_MS`]; a record that is being written
    /// is written to its end.
    pub fn expire(&mut self, now_ms: u32) {
        let silent = now_ms.wrapping_sub(self.heard_ms) >= IDLE_MS;
        if silent && matches!(self.state, State::Receiving | State::Verified) {
            self.state = State::Idle;
        }
    }

    /// Whether a session is open or a record is being written.
    pub const fn is_open(&self) -> bool {
        !matches!(self.state, State::Idle)
    }

    /// Where the first word is that is missing, bytes.
    fn missing(&self) -> Option<usize> {
        (0..self.bytes.div_ceil(4))
            .find(|&index| !self.is_received(index))
            .map(|index| 4 * index)
    }

    fn is_received(&self, index: usize) -> bool {
        (self.received.get(index / 32)).is_some_and(|bits| bits >> (index % 32) & 1 == 1)
    }

    /// Takes note of a message of the session's master.
    fn heard(&mut self, token: u32, now_ms: u32) -> Result<(), TransferRefused> {
        if !self.is_open() || self.token != token {
            return Err(TransferRefused::NoSession);
        }
        self.heard_ms = now_ms;
        Ok(())
    }
}
