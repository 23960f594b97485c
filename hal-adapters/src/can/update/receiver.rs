//! A node's side of an update.

use super::authentication::{Nonce, Tag};
use super::request::{UpdateData, UpdateRequest};
use super::staging::{Staging, blob_crc};
use super::store::{NotWritten, Store};
use super::tell::{Identity, tell};
use crate::can::command::{Answer, Command, Outcome, Request};
use runtime::ParameterSet;
use runtime::blob::{BlobError, MAX_BYTES};

/// A transfer without a frame for this time is closed, and so old a nonce, and every tag for it, expires, s.
const IDLE_S: u32 = 5;

/// An open transfer.
#[derive(Clone, Debug)]
struct Transfer {
    token: u8,
    /// Length of the blob.
    bytes: usize,
    idle_ticks: u32,
    /// Set once the host has committed: the blob is about to be stored.
    commit: Option<Commit>,
}

/// A commit that waits for [`Receiver::store`].
#[derive(Clone, Debug)]
struct Commit {
    sequence: u32,
    tag: Tag,
}

/// Receives tags and blobs, one transfer at a time, and stores the blobs. Call [`Receiver::take`] with every
/// frame of data, [`Receiver::obey`] with every request, [`Receiver::tick`] in every tick, and
/// [`Receiver::store`] when [`Receiver::is_storing`].
#[derive(Clone, Debug)]
pub struct Receiver<'s> {
    identity: Identity<'s>,
    idle_ticks_max: u32,
    staging: Staging,
    transfer: Option<Transfer>,
    /// The nonce of the next tag: asked for and not used yet, and its age.
    nonce: Option<Nonce>,
    nonce_ticks: u32,
    /// The last command with a right tag, and its answer, until the next challenge.
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
            nonce_ticks: 0,
            answered: None,
            ended: None,
            wants_reset: false,
        }
    }

    /// Whether a transfer is open: the pose must be invalid meanwhile.
    pub const fn is_updating(&self) -> bool {
        self.transfer.is_some()
    }

    /// Whether the node must be reset, once its answers have left.
    pub const fn wants_reset(&self) -> bool {
        self.wants_reset
    }

    /// Whether [`Receiver::store`] must be called, once the frames that announce it have left.
    pub const fn is_storing(&self) -> bool {
        matches!(&self.transfer, Some(transfer) if transfer.commit.is_some())
    }

    /// Whether requests need a tag.
    pub const fn has_key(&self) -> bool {
        self.identity.key.is_some()
    }

    /// Checks the tag of a command against the current nonce, and uses the nonce up.
    ///
    /// # Errors
    /// The answer to a command that must not be obeyed. A repeated command gets its first answer.
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
        match tag.matches(&self.identity, command, &[]) {
            true => Ok(()),
            false => refused,
        }
    }

    /// Notes the answer to a command that needs a tag.
    pub(in crate::can) fn note_answer(&mut self, command: &Command, answer: (Outcome, u32)) {
        let is_final = !matches!(answer.0, Outcome::NotAuthorised | Outcome::Incomplete);
        if self.has_key() && is_final {
            self.answered = Some((*command, answer));
        }
    }

    /// Takes a word of a tag or of the open transfer. Ignores words of other transfers, and those that come
    /// after the commit.
    pub fn take(&mut self, data: &UpdateData) {
        let open = self.transfer.as_mut();
        let own = open.filter(|open| open.token == data.token && open.commit.is_none());
        let bytes = own.map_or(0, |transfer| {
            transfer.idle_ticks = 0;
            transfer.bytes
        });
        self.staging.put(data.index, data.word, bytes);
    }

    /// Obeys a request, and gives outcome and detail of its answer. `nonce` is a fresh random number, `None`
    /// without a source of any: then nothing can be authorised. After [`Outcome::Started`] another answer
    /// comes from [`Receiver::store`].
    pub fn obey(
        &mut self,
        token: u8,
        request: UpdateRequest,
        servo_is_off: bool,
        nonce: Option<Nonce>,
        store: &mut dyn Store,
    ) -> (Outcome, u32) {
        match request {
            UpdateRequest::Tell { page } => tell(page, &self.identity, store),
            UpdateRequest::ReadBack { index } => match store.word(index.into()) {
                Some(word) => (Outcome::Done, word),
                None if store.running().is_none() => (Outcome::NoParameters, 0),
                None => (Outcome::UnknownCommand, 0),
            },
            UpdateRequest::Challenge { part } => self.challenge(part, nonce),
            UpdateRequest::Abort => self.abort(token),
            // After the end of a transfer the host only asks again.
            UpdateRequest::Commit { .. } if !self.is_updating() => self.without_transfer(token),
            _ if !servo_is_off => (Outcome::ServoOn, 0),
            UpdateRequest::Begin { bytes } => self.begin(token, bytes.into()),
            UpdateRequest::Commit { sequence } => self.commit(token, sequence, store),
            UpdateRequest::Activate if self.is_updating() => (Outcome::Busy, 0),
            UpdateRequest::Activate => {
                self.wants_reset = true;
                (Outcome::Done, 0)
            }
        }
    }

    /// One tick: closes a transfer with a silent host, and any transfer once the servo is on; forgets an old nonce.
    pub fn tick(&mut self, servo_is_off: bool) {
        self.nonce_ticks = self.nonce_ticks.saturating_add(1);
        self.nonce = self
            .nonce
            .filter(|_| self.nonce_ticks <= self.idle_ticks_max);
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

    /// Checks the committed blob, stores it, and gives the answer. Takes half a second.
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
        let Commit { sequence, tag } = transfer.commit.as_ref()?;
        let sequence = *sequence;
        if !servo_is_off {
            return Some((Outcome::ServoOn, 0));
        }
        let blob = self.staging.blob(transfer.bytes);
        let request = Request::Update(UpdateRequest::Commit { sequence });
        let command = Command::new(request, transfer.token);
        if !tag.matches(&self.identity, &command, blob) {
            return Some((Outcome::NotAuthorised, 0));
        }
        if let Err(error) = check(blob, self.identity.serial) {
            return Some((Outcome::BadContent, error.number().into()));
        }
        Some(match store.write(sequence, blob) {
            Ok(()) => (Outcome::Done, blob_crc(blob).unwrap_or_default()),
            Err(NotWritten::SupplyLow) => (Outcome::SupplyLow, 0),
            Err(NotWritten::Failed) => (Outcome::StoreFailed, 0),
        })
    }

    fn challenge(&mut self, part: u8, nonce: Option<Nonce>) -> (Outcome, u32) {
        if part == 0 {
            (self.nonce, self.answered) = (nonce, None);
            self.nonce_ticks = 0;
            self.staging.clear_tag();
        }
        let drawn = self.nonce.as_ref();
        match (drawn.and_then(|words| words.get(usize::from(part))), part) {
            (Some(word), _) => (Outcome::Done, *word),
            (None, 0) => (Outcome::NoRandomNumber, 0),
            (None, _) => (Outcome::NoTransfer, 0),
        }
    }

    fn begin(&mut self, token: u8, bytes: usize) -> (Outcome, u32) {
        if let Some(open) = &self.transfer {
            // A host that lost the answer begins the same transfer again.
            let is_same = (open.token, open.bytes) == (token, bytes) && open.commit.is_none();
            let outcome = if is_same {
                Outcome::Done
            } else {
                Outcome::Busy
            };
            return (outcome, 0);
        }
        if !(1..=MAX_BYTES).contains(&bytes) {
            return (Outcome::BadContent, 0);
        }
        self.staging.clear();
        self.ended = None;
        self.transfer = Some(Transfer {
            token,
            bytes,
            idle_ticks: 0,
            commit: None,
        });
        (Outcome::Done, 0)
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
        let due = store.newest_sequence().saturating_add(1);
        if sequence != due {
            return (Outcome::WrongSequence, due);
        }
        // Zeros stand for no nonce only where no tag is checked.
        let Some(nonce) = self.nonce.take().or((!with_tag).then_some([0; 4])) else {
            self.end(token, (Outcome::NotAuthorised, 0));
            return (Outcome::NotAuthorised, 0);
        };
        let bytes = self.staging.tag();
        let tag = Tag { nonce, bytes };
        transfer.commit = Some(Commit { sequence, tag });
        (Outcome::Started, 0)
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

    /// The answer to a commit without an open transfer: the end of the last one, if it had this token.
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

const COMMIT: u8 = UpdateRequest::Commit { sequence: 0 }.in_frame().0;

/// Whether a blob is sound and belongs to the stage. A parameter set has 700 bytes: a function of its own frees
/// that stack at once.
#[inline(never)]
fn check(blob: &[u8], serial: Option<&str>) -> Result<(), BlobError> {
    let read = ParameterSet::from_bytes(blob);
    let set = read.as_ref().map_err(|error| *error)?;
    serial.map_or(Ok(()), |serial| set.expect_serial(serial))
}

#[cfg(test)]
#[path = "receiver_tests.rs"]
mod tests;
