//! An update, step by step: identify the node, declare the servo off, transfer and store the blob, reset the
//! node so that it runs the blob, declare the servo on.

use super::UpdateError;
use super::identity::{Identity, ask_next, ask_page, ask_running, identify};
use super::talk::{Link, Talk, words};
use hal_adapters::can::command::{Command, Outcome, Request};
use hal_adapters::can::update::{BlobId, Key, UpdateRequest, blob_crc, page};
use runtime::ParameterSet;

/// How long the servo is declared off, s: longer than an update takes on a bad bus.
const SERVO_OFF_S: u8 = 30;
/// How often a damaged or forgotten transfer is begun again.
const RESTARTS_MAX: u32 = 3;
/// Pause before the node is asked again whether it runs the new parameters, us, and how often.
const RESET_US: u64 = 20_000;
const RESET_MAX: u32 = 250;
/// A program that faults twice in its first second has stopped after this time, us.
const PROVEN_US: u64 = 2_500_000;

/// The settings of an update.
#[derive(Clone, Debug)]
pub struct UpdateSettings {
    /// The blob to store, which the caller has checked; `None` for the newest one in the node's store.
    pub blob: Option<Vec<u8>>,
    /// Serial number that the node must have; `None`: the serial number of the blob, if both have one.
    pub serial: Option<String>,
    /// The stage's key.
    pub key: Option<Key>,
    /// Declare the servo off during the update.
    pub declares_servo_off: bool,
    /// Reset the node at the end, so that it runs the new parameters.
    pub activates: bool,
}

/// The result of an update.
#[derive(Clone, Debug, PartialEq)]
pub struct Updated {
    /// The node before.
    pub before: Identity,
    /// Sequence number of the blob.
    pub sequence: u32,
    /// Whether this update stored it; otherwise the node had it already.
    pub is_stored: bool,
    /// Whether the node runs it.
    pub is_active: bool,
    /// Lost words that were sent again.
    pub repeated_words: u32,
    /// Transfers that failed and were begun again.
    pub repeated_transfers: u32,
}

/// An update under way.
struct Script<'p, L> {
    talk: &'p mut Talk<L>,
    plan: &'p UpdateSettings,
    /// The stage's key, if the node needs tags.
    key: Option<Key>,
    /// The blob that is to run.
    wanted: BlobId,
    /// Token of the open transfer.
    open: Option<u8>,
    /// Whether the servo must be declared on at the end.
    declared: bool,
    repeated_words: u32,
    repeated_transfers: u32,
    progress: &'p mut dyn FnMut(u64, u64),
}

/// Updates the node. The user can end it until the node stores the blob. `progress` takes the words sent and
/// the words in all.
///
/// # Errors
/// See [`UpdateError`]. The node keeps its parameters unless the error says otherwise.
pub fn update<L: Link>(
    talk: &mut Talk<L>,
    plan: &UpdateSettings,
    progress: &mut dyn FnMut(u64, u64),
) -> Result<Updated, UpdateError> {
    let before = identify(talk)?;
    if let Some(error) = other_stage(plan, &before) {
        return Err(error);
    }
    let crc = plan.blob.as_deref().and_then(blob_crc);
    let kept = before
        .next
        .filter(|next| crc.is_none_or(|crc| crc == next.crc));
    let wanted = match (kept, crc) {
        (Some(kept), _) => kept,
        (None, Some(crc)) => BlobId {
            sequence: before.newest_sequence.saturating_add(1),
            crc,
        },
        (None, None) => return Err(UpdateError::NothingKept),
    };
    let (is_stored, runs) = (
        kept.is_none(),
        before.running.map(|(id, _)| id) == Some(wanted),
    );
    let mut script = Script {
        wanted,
        open: None,
        declared: false,
        repeated_words: 0,
        repeated_transfers: 0,
        talk,
        plan,
        key: plan.key.filter(|_| before.needs_key),
        progress,
    };
    let is_active = if !is_stored && (runs || !plan.activates) {
        Ok(runs)
    } else if before.needs_key && plan.key.is_none() {
        Err(UpdateError::KeyNeeded)
    } else {
        let done = script.run(is_stored);
        script.close();
        done
    };
    Ok(Updated {
        sequence: wanted.sequence,
        is_stored,
        is_active: is_active?,
        repeated_words: script.repeated_words,
        repeated_transfers: script.repeated_transfers,
        before,
    })
}

impl<L: Link> Script<'_, L> {
    /// Returns whether the blob runs in the end.
    fn run(&mut self, stores: bool) -> Result<bool, UpdateError> {
        if self.plan.declares_servo_off {
            let seconds = SERVO_OFF_S;
            let (outcome, detail) = self.tagged(Request::ServoOff { seconds })?;
            self.declared = true;
            if outcome != Outcome::Done {
                return Err(self.refused(outcome, detail));
            }
        }
        if stores {
            self.store()?;
        }
        if self.plan.activates {
            self.talk.may_stop = false;
            self.activate()?;
        }
        Ok(self.plan.activates)
    }

    /// Asks with a tag, if the node needs one.
    fn tagged(&mut self, request: Request) -> Result<(Outcome, u32), UpdateError> {
        self.talk.exchange_tagged(self.key.as_ref(), request)
    }

    fn store(&mut self) -> Result<(), UpdateError> {
        loop {
            let failure = match self.transfer() {
                Ok(()) => return Ok(()),
                Err(failure) => failure,
            };
            // The commit may have arrived and its answer been lost.
            if !self.talk.may_stop && self.is_stored()? {
                return Ok(());
            }
            let is_damage = matches!(
                failure,
                UpdateError::BadContent { .. } | UpdateError::NotAuthorised | UpdateError::Lossy
            );
            if !is_damage || self.repeated_transfers == RESTARTS_MAX {
                return Err(failure);
            }
            self.repeated_transfers += 1;
        }
    }

    fn is_stored(&mut self) -> Result<bool, UpdateError> {
        let next = ask_next(self.talk).map_err(|_| UpdateError::Unknown)?;
        Ok(next == Some(self.wanted))
    }

    /// One transfer and its commit.
    fn transfer(&mut self) -> Result<(), UpdateError> {
        self.talk.may_stop = true;
        let blob = self.plan.blob.as_deref().unwrap_or_default();
        let (key, token) = (self.key, self.talk.transfer_token());
        let bytes = blob.len() as u16;
        let begin = Request::Update(UpdateRequest::Begin { bytes });
        match (self.talk).exchange_tagged_under(token, key.as_ref(), begin)? {
            (Outcome::Done, _) => self.open = Some(token),
            (outcome, detail) => return Err(self.refused(outcome, detail)),
        }
        let sequence = self.wanted.sequence;
        let commit = Request::Update(UpdateRequest::Commit { sequence });
        let mut words = words(token, blob, 0);
        for (sent, word) in (1..).zip(&words) {
            self.talk.send_word(*word)?;
            (self.progress)(sent, words.len() as u64);
        }
        if let Some(key) = &key {
            // The whole blob first: its tag expires after 5 s.
            self.repeated_words += self.talk.exchange_words(token, commit, &words)?.1;
            let command = Command::new(commit, token);
            words = self.talk.authorise(key, &command, blob)?;
        }
        // From here on the node may store the blob, within a second.
        self.talk.may_stop = false;
        let (answer, lost) = self.talk.exchange_words(token, commit, &words)?;
        self.repeated_words += lost;
        match answer {
            (Outcome::Done, crc) if crc == self.wanted.crc => {
                self.open = None;
                Ok(())
            }
            // The blob of another host with the same token.
            (Outcome::Done, _) => Err(UpdateError::Busy),
            (outcome, detail) => Err(self.refused(outcome, detail)),
        }
    }

    /// The error of a refused request.
    fn refused(&mut self, outcome: Outcome, detail: u32) -> UpdateError {
        let declared = self.declared;
        self.declared &= !matches!(outcome, Outcome::ServoOn | Outcome::Busy);
        UpdateError::from_outcome(outcome, detail, declared)
    }

    /// Resets the node, waits until it runs the blob, and looks again after a program that faults twice
    /// would have stopped.
    fn activate(&mut self) -> Result<(), UpdateError> {
        let sequence = self.wanted.sequence;
        let silent = |error| match error {
            UpdateError::NoAnswer => UpdateError::Silent { sequence },
            error => error,
        };
        let activate = Request::Update(UpdateRequest::Activate);
        let (outcome, _) = self.tagged(activate).map_err(silent)?;
        if outcome == Outcome::NotAuthorised {
            return Err(UpdateError::NotAuthorised);
        }
        // If the reset came before the answer, a repeated request finds the servo on.
        let looks = if outcome == Outcome::Done {
            RESET_MAX
        } else {
            1
        };
        for _ in 0..looks {
            self.talk.pause(RESET_US)?;
            if self.runs().map_err(silent)? {
                self.declared = false;
                self.talk.pause(PROVEN_US)?;
                return match self.runs().map_err(silent)? {
                    true => Ok(()),
                    false => Err(self.not_active()),
                };
            }
        }
        if outcome == Outcome::Done {
            return Err(self.not_active());
        }
        self.declared &= outcome != Outcome::Busy;
        Err(UpdateError::NotActivated { sequence })
    }

    /// Why the node does not run the blob after a reset.
    fn not_active(&mut self) -> UpdateError {
        let sequence = self.wanted.sequence;
        match ask_page(self.talk, page::NEWEST_SEQUENCE) {
            Ok(Some(newest)) if newest > sequence => UpdateError::Replaced { sequence, newest },
            _ => UpdateError::NotActive { sequence },
        }
    }

    fn runs(&mut self) -> Result<bool, UpdateError> {
        Ok(ask_running(self.talk)? == Some(self.wanted))
    }

    /// Closes the transfer and takes the declaration back; the answers do not matter.
    fn close(&mut self) {
        self.talk.may_stop = false;
        if let Some(token) = self.open {
            let abort = Request::Update(UpdateRequest::Abort);
            let _ = self.talk.exchange_under(token, abort);
        }
        if self.declared {
            let _ = self.talk.exchange(Request::ServoOff { seconds: 0 });
        }
    }
}

/// The error if the node is, or may be, the node of another stage.
fn other_stage(plan: &UpdateSettings, identity: &Identity) -> Option<UpdateError> {
    let found = identity.serial.clone();
    let set = plan.blob.as_deref().map(ParameterSet::from_bytes);
    let own = set.and_then(Result::ok).map(|set| set.serial.to_string());
    match (plan.serial.clone(), own.filter(|own| !own.is_empty())) {
        (Some(expected), _) if found.is_empty() => Some(UpdateError::NoSerial { expected }),
        (Some(expected), _) | (None, Some(expected)) if !found.is_empty() && expected != found => {
            Some(UpdateError::OtherStage { expected, found })
        }
        _ => None,
    }
}
