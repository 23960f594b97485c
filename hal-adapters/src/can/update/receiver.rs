//! A node's side of an update.

use super::authentication::{Authenticator, Nonce};
use super::request::{UpdateData, UpdateRequest};
use super::staging::{Staging, crc_of, word_of};
use super::store::{Change, Store, Written};
use super::tell::{Identity, tell};
use crate::can::command::{Answer, Outcome};
use runtime::ParameterSet;
use runtime::blob::{BlobError, MAX_BYTES};

/// A transfer to which nothing came for so long is closed, s.
const IDLE_S: u32 = 5;
/// [`BlobError::number`] of a wrong check.
const WRONG_CHECK: u32 = 7;
/// Bytes of a blob that are authenticated in one tick: four blocks of AES.
const BYTES_PER_TICK: usize = 64;

/// What a request meets: the servo, the store, and a random number.
pub struct Surroundings<'u> {
    /// Whether the servo is declared off.
    pub servo_is_off: bool,
    /// Keeps the records.
    pub store: &'u mut dyn Store,
    /// A fresh random number, for a transfer that begins; `None` if there is no source of any:
    /// a node with a key then refuses the transfer.
    pub nonce: Option<Nonce>,
}

/// How far a transfer is.
#[derive(Clone, Debug)]
enum Stage {
    /// Words come.
    Receiving,
    /// The tag is computed, a piece in each tick; so many bytes are done.
    Authenticating(Authenticator, usize),
    /// The blob itself is to be checked.
    Checking,
    /// It may be stored.
    Verified,
    /// It is being stored.
    Storing,
}

/// An open transfer.
#[derive(Clone, Debug)]
struct Transfer {
    token: u8,
    /// Length of the blob, 0 for going back.
    bytes: usize,
    /// The low half of its CRC-32C, as it was begun.
    check: u16,
    nonce: Nonce,
    /// The sequence number that [`UpdateRequest::Verify`] named.
    sequence: u32,
    /// The CRC-32C, once every word is there.
    crc: u32,
    idle_ticks: u32,
    stage: Stage,
}

/// Receives blobs, one at a time, and has them stored: [`Receiver::take`] with every frame of
/// data, [`Receiver::obey`] with every request, [`Receiver::tick`] in every tick.
#[derive(Clone, Debug)]
pub struct Receiver<'s> {
    identity: Identity<'s>,
    idle_ticks_max: u32,
    staging: Staging,
    transfer: Option<Transfer>,
    /// Token and end of the last transfer, for a host that asks again.
    ended: Option<(u8, Outcome, u32)>,
    wants_reset: bool,
}

impl<'s> Receiver<'s> {
    /// Before the first request; `ticks_per_s` is the servo's rate.
    pub const fn new(identity: Identity<'s>, ticks_per_s: u32) -> Self {
        Self {
            identity,
            idle_ticks_max: IDLE_S.saturating_mul(ticks_per_s),
            staging: Staging::EMPTY,
            transfer: None,
            ended: None,
            wants_reset: false,
        }
    }

    /// Whether a transfer is open: the pose is to be invalid meanwhile.
    pub const fn is_updating(&self) -> bool {
        self.transfer.is_some()
    }

    /// Whether the node is to be reset, once its answers have left.
    pub const fn wants_reset(&self) -> bool {
        self.wants_reset
    }

    const fn is_verified(&self) -> bool {
        matches!(&self.transfer, Some(transfer) if matches!(transfer.stage, Stage::Verified))
    }

    /// Takes a word. Words of other transfers, and of one that is being checked or stored, are ignored.
    pub fn take(&mut self, data: &UpdateData) {
        if let Some(transfer) = &mut self.transfer
            && transfer.token == data.token
            && matches!(transfer.stage, Stage::Receiving)
        {
            transfer.idle_ticks = 0;
            self.staging.put(data.index, data.word, transfer.bytes);
        }
    }

    /// Obeys a request; outcome and detail are to be answered. After [`Outcome::Started`]
    /// another answer comes from [`Receiver::tick`].
    pub fn obey(
        &mut self,
        token: u8,
        request: UpdateRequest,
        around: Surroundings<'_>,
    ) -> (Outcome, u32) {
        match request {
            UpdateRequest::Tell { page } => {
                let ended = self.ended.map(|(_, outcome, _)| outcome);
                tell(page, &self.identity, ended, around.store)
            }
            UpdateRequest::ReadBack { index } => {
                let running = around.store.running();
                let word = running.map(|running| word_of(running.blob, index.into()));
                match word {
                    None => (Outcome::NoParameters, 0),
                    Some(None) => (Outcome::UnknownCommand, 0),
                    Some(Some(word)) => (Outcome::Done, word),
                }
            }
            UpdateRequest::Challenge { part } => {
                let nonce = self.transfer.as_ref().map(|transfer| transfer.nonce);
                let word = nonce.and_then(|nonce| nonce.get(usize::from(part)).copied());
                word.map_or((Outcome::NoTransfer, 0), |word| (Outcome::Done, word))
            }
            UpdateRequest::Abort => self.abort(token),
            // Once it is being stored or has ended, nothing begins: this only asks again.
            UpdateRequest::Commit { sequence } if !self.is_verified() => {
                self.commit(token, sequence)
            }
            _ if !around.servo_is_off => (Outcome::ServoOn, 0),
            UpdateRequest::Begin { bytes, check } => {
                let refusal = self.begin(token, bytes.into(), check, around).err();
                refusal.unwrap_or((Outcome::Done, request.argument()))
            }
            UpdateRequest::Verify { sequence } => self.verify(token, sequence, around.store),
            UpdateRequest::Commit { sequence } => self.commit(token, sequence),
            UpdateRequest::Activate if self.is_updating() => (Outcome::Busy, 0),
            UpdateRequest::Activate => {
                self.wants_reset = true;
                (Outcome::Done, 0)
            }
        }
    }

    /// One tick: a step of a check or of storing. Gives the answer to a request that has ended.
    pub fn tick(&mut self, servo_is_off: bool, store: &mut dyn Store) -> Option<Answer> {
        let transfer = self.transfer.as_mut()?;
        let blob = self.staging.blob(transfer.bytes);
        let end = match &mut transfer.stage {
            Stage::Storing => {
                let change = match transfer.bytes {
                    0 => Change::Previous,
                    _ => Change::Blob(blob),
                };
                match store.write(transfer.sequence, change) {
                    Written::InProgress => return None,
                    Written::Done => (Outcome::Done, transfer.crc),
                    Written::Failed => (Outcome::StoreFailed, 0),
                }
            }
            _ if !servo_is_off => (Outcome::ServoOn, 0),
            Stage::Authenticating(authenticator, done) => {
                let rest = blob.get(*done..).unwrap_or_default();
                if !rest.is_empty() {
                    let piece = rest.get(..BYTES_PER_TICK).unwrap_or(rest);
                    authenticator.update(piece);
                    *done += piece.len();
                    return None;
                }
                let last = (transfer.sequence, transfer.bytes as u32, transfer.crc);
                if authenticator.agrees(last, &self.staging.tag()) {
                    transfer.stage = Stage::Checking;
                    return None;
                }
                (Outcome::NotAuthorised, 0)
            }
            Stage::Checking => match check(blob, self.identity.serial) {
                Ok(()) => {
                    transfer.stage = Stage::Verified;
                    transfer.idle_ticks = 0;
                    let end = (Outcome::Done, transfer.crc);
                    return Some(answer(VERIFY, transfer.token, end));
                }
                Err(error) => (Outcome::BadContent, error.number().into()),
            },
            Stage::Receiving | Stage::Verified if transfer.idle_ticks < self.idle_ticks_max => {
                transfer.idle_ticks += 1;
                return None;
            }
            Stage::Receiving | Stage::Verified => (Outcome::NoTransfer, 0),
        };
        let number = match transfer.stage {
            Stage::Storing => Some(COMMIT),
            Stage::Authenticating(..) | Stage::Checking => Some(VERIFY),
            Stage::Receiving | Stage::Verified => None,
        };
        let token = transfer.token;
        self.end(token, end);
        number.map(|number| answer(number, token, end))
    }

    fn begin(
        &mut self,
        token: u8,
        bytes: usize,
        check: u16,
        around: Surroundings<'_>,
    ) -> Result<(), (Outcome, u32)> {
        if let Some(transfer) = &mut self.transfer {
            let named = (transfer.token, transfer.bytes, transfer.check);
            let same = named == (token, bytes, check);
            // The answer to the first of two equal requests may have been lost.
            return if same && matches!(transfer.stage, Stage::Receiving) {
                Ok(())
            } else {
                Err((Outcome::Busy, 0))
            };
        }
        if bytes > MAX_BYTES {
            return Err((Outcome::BadContent, 0));
        }
        if bytes == 0 {
            match around.store.previous() {
                None => return Err((Outcome::NoParameters, 0)),
                Some(kept) if kept.crc as u16 != check => {
                    let due = due(around.store).unwrap_or(u32::MAX);
                    return Err((Outcome::WrongSequence, due));
                }
                Some(_) => {}
            }
        }
        if !around.store.is_writable() {
            return Err((Outcome::StoreFailed, 0));
        }
        if !around.store.has_room() {
            return Err((Outcome::NoRoom, 0));
        }
        let nonce = match (self.identity.key, around.nonce) {
            (Some(_), None) => return Err((Outcome::NoRandomNumber, 0)),
            (_, nonce) => nonce.unwrap_or_default(),
        };
        self.staging.clear();
        self.ended = None;
        self.transfer = Some(Transfer {
            token,
            bytes,
            check,
            nonce,
            sequence: 0,
            crc: 0,
            idle_ticks: 0,
            stage: Stage::Receiving,
        });
        Ok(())
    }

    fn verify(&mut self, token: u8, sequence: u32, store: &dyn Store) -> (Outcome, u32) {
        let Some(transfer) = self.transfer.as_mut().filter(|t| t.token == token) else {
            return self.without_transfer(token);
        };
        match transfer.stage {
            Stage::Receiving => {}
            _ if transfer.sequence != sequence => return (Outcome::Busy, 0),
            Stage::Authenticating(..) | Stage::Checking => return (Outcome::Started, 0),
            Stage::Verified => return (Outcome::Done, transfer.crc),
            Stage::Storing => return (Outcome::Busy, 0),
        }
        transfer.idle_ticks = 0;
        let key = self.identity.key;
        if let Some(index) = self.staging.missing(transfer.bytes, key.is_some()) {
            return (Outcome::Incomplete, index.into());
        }
        // Of two transfers that were made for the same store only one is stored.
        let due = due(store);
        if due != Some(sequence) {
            return (Outcome::WrongSequence, due.unwrap_or(u32::MAX));
        }
        let crc = match transfer.bytes {
            0 => store.previous().map(|kept| kept.crc),
            bytes => crc_of(self.staging.blob(bytes)),
        };
        let Some(crc) = crc.filter(|crc| *crc as u16 == transfer.check) else {
            let end = (Outcome::BadContent, WRONG_CHECK);
            self.end(token, end);
            return end;
        };
        (transfer.sequence, transfer.crc) = (sequence, crc);
        transfer.stage = match key {
            None => Stage::Checking,
            Some(key) => Stage::Authenticating(Authenticator::new(&key, &transfer.nonce), 0),
        };
        (Outcome::Started, 0)
    }

    fn commit(&mut self, token: u8, sequence: u32) -> (Outcome, u32) {
        let Some(transfer) = self.transfer.as_mut().filter(|t| t.token == token) else {
            return self.without_transfer(token);
        };
        match transfer.stage {
            Stage::Verified if transfer.sequence == sequence => {
                transfer.stage = Stage::Storing;
                (Outcome::Started, 0)
            }
            Stage::Storing if transfer.sequence == sequence => (Outcome::Started, 0),
            Stage::Receiving => (Outcome::NotAuthorised, 0),
            _ => (Outcome::Busy, 0),
        }
    }

    fn abort(&mut self, token: u8) -> (Outcome, u32) {
        match &self.transfer {
            None => (Outcome::Done, 0),
            Some(t) if t.token != token || matches!(t.stage, Stage::Storing) => (Outcome::Busy, 0),
            Some(_) => {
                self.end(token, (Outcome::NoTransfer, 0));
                (Outcome::Done, 0)
            }
        }
    }

    /// To a request for a transfer that is not open: how it ended, if it was the last one.
    fn without_transfer(&self, token: u8) -> (Outcome, u32) {
        match self.ended {
            _ if self.is_updating() => (Outcome::Busy, 0),
            Some((ended, outcome, detail)) if ended == token => (outcome, detail),
            _ => (Outcome::NoTransfer, 0),
        }
    }

    fn end(&mut self, token: u8, (outcome, detail): (Outcome, u32)) {
        self.transfer = None;
        self.ended = Some((token, outcome, detail));
    }
}

const VERIFY: u8 = UpdateRequest::Verify { sequence: 0 }.number();
const COMMIT: u8 = UpdateRequest::Commit { sequence: 0 }.number();

const fn answer(number: u8, token: u8, (outcome, detail): (Outcome, u32)) -> Answer {
    Answer {
        number,
        token,
        outcome: Some(outcome),
        detail,
    }
}

/// The sequence number of the next record; `None` once all are used up.
fn due(store: &dyn Store) -> Option<u32> {
    store.newest_sequence().checked_add(1)
}

/// Whether a blob is sound and that of the stage; an empty one asks for nothing. A parameter set
/// has 700 bytes: in a function of its own it leaves the stack at once.
#[inline(never)]
fn check(blob: &[u8], serial: Option<&str>) -> Result<(), BlobError> {
    if blob.is_empty() {
        return Ok(());
    }
    let read = ParameterSet::from_bytes(blob);
    let set = read.as_ref().map_err(|error| *error)?;
    match serial {
        Some(serial) => set.expect_serial(serial),
        None => Ok(()),
    }
}

#[cfg(test)]
#[path = "receiver_tests.rs"]
mod tests;
