//! A node's side of an update.

use super::authentication::{Nonce, Tag};
use super::request::{UpdateData, UpdateRequest};
use super::staging::{Staging, crc_of};
use super::store::{Change, NotWritten, Store};
use super::tell::{Identity, tell};
use crate::can::command::{Answer, Command, Outcome, Request};
use runtime::ParameterSet;
use runtime::blob::{BlobError, MAX_BYTES};

/// A transfer to which nothing came for so long is closed, s.
const IDLE_S: u32 = 5;
/// [`BlobError::number`] of a wrong check.
const WRONG_CHECK: u32 = 7;

/// What a request meets: the servo, the store, and a random number.
pub struct Surroundings<'u> {
    /// Whether the servo is declared off.
    pub servo_is_off: bool,
    /// Keeps the parameters.
    pub store: &'u mut dyn Store,
    /// A fresh random number, for a host that asks for one; `None` if there is no source of any:
    /// nothing can be authorised then.
    pub nonce: Option<Nonce>,
}

/// An open transfer.
#[derive(Clone, Debug)]
struct Transfer {
    token: u8,
    /// Length of the blob, 0 for going back.
    bytes: usize,
    /// The low half of its CRC-32C, as it was begun.
    check: u16,
    idle_ticks: u32,
    /// What is to be stored, once that is asked for.
    commit: Option<Commit>,
}

/// What is to be stored.
#[derive(Clone, Debug)]
struct Commit {
    sequence: u32,
    /// CRC-32C of the blob.
    crc: u32,
    tag: Tag,
}

/// Receives tags, and blobs, one at a time, and has them stored: [`Receiver::take`] with every frame of
/// data, [`Receiver::obey`] with every request, [`Receiver::tick`] in every tick, and
/// [`Receiver::store`] when [`Receiver::is_storing`] says so.
#[derive(Clone, Debug)]
pub struct Receiver<'s> {
    identity: Identity<'s>,
    idle_ticks_max: u32,
    staging: Staging,
    transfer: Option<Transfer>,
    /// The number that the next tag is over: asked for, and not used yet.
    nonce: Option<Nonce>,
    /// The last command that was obeyed by its tag, and its answer, until a number is asked for.
    answered: Option<(Command, (Outcome, u32))>,
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
            nonce: None,
            answered: None,
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

    /// Whether [`Receiver::store`] is to be called, once the frames that announce it have left.
    pub const fn is_storing(&self) -> bool {
        matches!(&self.transfer, Some(transfer) if transfer.commit.is_some())
    }

    /// Whether its requests need a tag.
    pub const fn has_key(&self) -> bool {
        self.identity.key.is_some()
    }

    /// Whether a command came with its tag, over the number that was asked for. That number is used up
    /// by a right tag and by a wrong one. `Err` is the answer to a command that is not to be obeyed: a
    /// repeated one is answered as before.
    pub fn authorise(&mut self, command: &Command) -> Result<(), (Outcome, u32)> {
        if let Some((_, answer)) = self.answered.filter(|(before, _)| before == command) {
            return Err(answer);
        }
        let refused = Err((Outcome::NotAuthorised, 0));
        let Some(nonce) = self.nonce else {
            return refused;
        };
        if let Some(index) = self.staging.missing(0, true) {
            return Err((Outcome::Incomplete, index.into()));
        }
        self.nonce = None;
        let bytes = self.staging.tag();
        let tag = Tag { nonce, bytes };
        match tag.is_of(self.identity.key.as_ref(), command, &[], 0) {
            true => Ok(()),
            false => refused,
        }
    }

    /// Notes how a command that needs a tag was answered.
    pub(in crate::can) fn note_answer(&mut self, command: &Command, answer: (Outcome, u32)) {
        let is_final = !matches!(answer.0, Outcome::NotAuthorised | Outcome::Incomplete);
        if self.has_key() && is_final {
            self.answered = Some((*command, answer));
        }
    }

    /// Takes a word: of a tag, or of the open transfer. Words of other transfers, and of one that is
    /// being stored, are ignored.
    pub fn take(&mut self, data: &UpdateData) {
        let open = self.transfer.as_mut();
        let own = open.filter(|open| open.token == data.token && open.commit.is_none());
        let bytes = own.map_or(0, |transfer| {
            transfer.idle_ticks = 0;
            transfer.bytes
        });
        self.staging.put(data.index, data.word, bytes);
    }

    /// Obeys a request; outcome and detail are to be answered. After [`Outcome::Started`]
    /// another answer comes from [`Receiver::store`].
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
            UpdateRequest::ReadBack { index } => match around.store.word(index.into()) {
                Some(word) => (Outcome::Done, word),
                None if around.store.running().is_none() => (Outcome::NoParameters, 0),
                None => (Outcome::UnknownCommand, 0),
            },
            UpdateRequest::Challenge { part } => {
                if part == 0 {
                    (self.nonce, self.answered) = (around.nonce, None);
                    self.staging.clear_tag();
                }
                let word = self
                    .nonce
                    .and_then(|nonce| nonce.get(usize::from(part)).copied());
                match (word, part) {
                    (Some(word), _) => (Outcome::Done, word),
                    (None, 0) => (Outcome::NoRandomNumber, 0),
                    (None, _) => (Outcome::NoTransfer, 0),
                }
            }
            UpdateRequest::Abort => self.abort(token),
            // Once it has ended, nothing begins: this only asks again.
            UpdateRequest::Commit { .. } if !self.is_updating() => self.without_transfer(token),
            _ if !around.servo_is_off => (Outcome::ServoOn, 0),
            UpdateRequest::Begin { bytes, check } => {
                let refusal = self.begin(token, bytes.into(), check, around).err();
                refusal.unwrap_or((Outcome::Done, request.argument()))
            }
            UpdateRequest::Commit { sequence } => self.commit(token, sequence, around.store),
            UpdateRequest::Activate if self.is_updating() => (Outcome::Busy, 0),
            UpdateRequest::Activate => {
                self.wants_reset = true;
                (Outcome::Done, 0)
            }
        }
    }

    /// One tick: closes a transfer whose host is silent, and any once the servo is on.
    pub fn tick(&mut self, servo_is_off: bool) {
        let Some(transfer) = self.transfer.as_mut().filter(|t| t.commit.is_none()) else {
            return;
        };
        transfer.idle_ticks += 1;
        let (token, is_idle) = (transfer.token, transfer.idle_ticks > self.idle_ticks_max);
        if !servo_is_off {
            self.end(token, (Outcome::ServoOn, 0));
        } else if is_idle {
            self.end(token, (Outcome::NoTransfer, 0));
        }
    }

    /// Checks what was committed, stores it, and gives the answer. Takes half a second.
    pub fn store(&mut self, servo_is_off: bool, store: &mut dyn Store) -> Option<Answer> {
        let transfer = self.transfer.as_ref()?;
        let (token, end) = (transfer.token, self.stored(transfer, servo_is_off, store)?);
        self.end(token, end);
        let (outcome, detail) = end;
        Some(Answer {
            number: COMMIT,
            token,
            outcome: Some(outcome),
            detail,
        })
    }

    fn stored(
        &self,
        transfer: &Transfer,
        servo_is_off: bool,
        store: &mut dyn Store,
    ) -> Option<(Outcome, u32)> {
        let Commit { sequence, crc, tag } = transfer.commit.as_ref()?;
        let (sequence, crc) = (*sequence, *crc);
        if !servo_is_off {
            return Some((Outcome::ServoOn, 0));
        }
        let blob = self.staging.blob(transfer.bytes);
        let request = Request::Update(UpdateRequest::Commit { sequence });
        let command = Command::new(request, transfer.token);
        if !tag.is_of(self.identity.key.as_ref(), &command, blob, crc) {
            return Some((Outcome::NotAuthorised, 0));
        }
        if let Err(error) = check(blob, self.identity.serial) {
            return Some((Outcome::BadContent, error.number().into()));
        }
        let change = match transfer.bytes {
            0 => Change::Previous,
            _ => Change::Blob(blob),
        };
        Some(match store.write(sequence, change) {
            Ok(()) => (Outcome::Done, crc),
            Err(NotWritten::SupplyLow) => (Outcome::SupplyLow, 0),
            Err(NotWritten::Failed) => (Outcome::StoreFailed, 0),
        })
    }

    fn begin(
        &mut self,
        token: u8,
        bytes: usize,
        check: u16,
        around: Surroundings<'_>,
    ) -> Result<(), (Outcome, u32)> {
        if let Some(transfer) = &self.transfer {
            let named = (transfer.token, transfer.bytes, transfer.check);
            // The answer to the first of two equal requests may have been lost.
            return match named == (token, bytes, check) && transfer.commit.is_none() {
                true => Ok(()),
                false => Err((Outcome::Busy, 0)),
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
        self.staging.clear();
        self.ended = None;
        self.transfer = Some(Transfer {
            token,
            bytes,
            check,
            idle_ticks: 0,
            commit: None,
        });
        Ok(())
    }

    fn commit(&mut self, token: u8, sequence: u32, store: &dyn Store) -> (Outcome, u32) {
        let Some(transfer) = self.transfer.as_mut().filter(|t| t.token == token) else {
            return (Outcome::Busy, 0);
        };
        match &transfer.commit {
            None => transfer.idle_ticks = 0,
            Some(commit) if commit.sequence == sequence => return (Outcome::Started, 0),
            Some(_) => return (Outcome::Busy, 0),
        }
        let with_tag = self.identity.key.is_some();
        if let Some(index) = self.staging.missing(transfer.bytes, with_tag) {
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
        if let Some(crc) = crc.filter(|crc| *crc as u16 == transfer.check) {
            // A number that was never asked for, or is used up, is no zero that a tag could be over.
            let Some(nonce) = self.nonce.take().or((!with_tag).then_some([0; 4])) else {
                self.end(token, (Outcome::NotAuthorised, 0));
                return (Outcome::NotAuthorised, 0);
            };
            let bytes = self.staging.tag();
            let tag = Tag { nonce, bytes };
            transfer.commit = Some(Commit { sequence, crc, tag });
            return (Outcome::Started, 0);
        }
        let end = (Outcome::BadContent, WRONG_CHECK);
        self.end(token, end);
        end
    }

    fn abort(&mut self, token: u8) -> (Outcome, u32) {
        match &self.transfer {
            None => (Outcome::Done, 0),
            Some(t) if t.token != token || t.commit.is_some() => (Outcome::Busy, 0),
            Some(_) => {
                self.end(token, (Outcome::NoTransfer, 0));
                (Outcome::Done, 0)
            }
        }
    }

    /// To a request for a transfer that is not open: how it ended, if it was the last one.
    fn without_transfer(&self, token: u8) -> (Outcome, u32) {
        match self.ended {
            Some((ended, outcome, detail)) if ended == token => (outcome, detail),
            _ => (Outcome::NoTransfer, 0),
        }
    }

    fn end(&mut self, token: u8, (outcome, detail): (Outcome, u32)) {
        self.transfer = None;
        self.ended = Some((token, outcome, detail));
    }
}

const COMMIT: u8 = UpdateRequest::Commit { sequence: 0 }.number();

/// The sequence number that is due; `None` once all are used up.
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
