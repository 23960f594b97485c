//! An update, step by step: who is there, the servo declared off, the blob transferred and stored, the
//! node reset to run it, the servo declared on again.

use super::identity::{Identity, identify};
use super::talk::{Link, Talk, page as tell, words};
use super::{Plan, UpdateError, Updated, Wanted};
use hal_adapters::can::command::{Command, Outcome, Request};
use hal_adapters::can::update::{Kept, Key, UpdateRequest, crc_of, page};

/// How long the servo is declared off: longer than an update takes, on a bad bus too.
const SERVO_OFF_S: u8 = 30;
/// How often a transfer that came to nothing, damaged or forgotten, is begun anew.
const RESTARTS_MAX: u32 = 3;
/// Pause before a node is asked again whether it runs the new parameters, us, and how often.
const RESET_US: u64 = 20_000;
const RESET_MAX: u32 = 250;
/// Parameters that make the program fault twice in its first second have stopped it by then, us.
const PROVEN_US: u64 = 2_500_000;

/// An update under way.
struct Script<'p, L> {
    talk: &'p mut Talk<L>,
    plan: &'p Plan,
    /// The stage's key, if the node wants tags.
    key: Option<Key>,
    /// What is to run.
    wanted: Kept,
    /// Token of the open transfer.
    open: Option<u8>,
    /// Whether the declaration that the servo is off is to be taken back.
    declared: bool,
    repeated: (u32, u32),
    progress: &'p mut dyn FnMut(u64, u64),
}

/// Updates the node. Once it stores, the user no longer ends it. `progress` takes how many words were
/// sent, and of how many.
///
/// # Errors
/// See [`UpdateError`]. Unless it says otherwise the node keeps what it kept before.
pub fn update<L: Link>(
    talk: &mut Talk<L>,
    plan: &Plan,
    progress: &mut dyn FnMut(u64, u64),
) -> Result<Updated, UpdateError> {
    let before = identify(talk)?;
    if let Some(error) = other_stage(plan, &before) {
        return Err(error);
    }
    let (wanted, is_kept) = wanted(plan, &before)?;
    let runs = |kept: Kept| {
        let running = before.running.as_ref();
        running.is_some_and(|r| (r.sequence, r.crc) == (kept.sequence, kept.crc))
    };
    let mut script = Script {
        wanted,
        open: None,
        declared: false,
        repeated: (0, 0),
        talk,
        plan,
        key: plan.key.filter(|_| before.needs_key),
        progress,
    };
    let is_active = if is_kept && (runs(wanted) || !plan.activates) {
        Ok(runs(wanted))
    } else if before.needs_key && plan.key.is_none() {
        Err(UpdateError::KeyNeeded)
    } else {
        let done = script.run(is_kept);
        script.close();
        done
    };
    Ok(Updated {
        record: wanted.sequence,
        sequence: (!is_kept).then_some(wanted.sequence),
        is_active: is_active?,
        repeated: script.repeated,
        before,
    })
}

/// What is to run, and whether the node keeps it already as the newest.
fn wanted(plan: &Plan, node: &Identity) -> Result<(Kept, bool), UpdateError> {
    let crc = match &plan.wanted {
        Wanted::Blob(blob) => crc_of(blob).unwrap_or_default(),
        Wanted::Previous => node.previous.ok_or(UpdateError::NoPrevious)?.crc,
        Wanted::Newest => return Ok((node.next.ok_or(UpdateError::NothingKept)?, true)),
    };
    if let Some(next) = node.next.filter(|next| next.crc == crc) {
        return Ok((next, true));
    }
    let sequence = node.newest_sequence.checked_add(1);
    let sequence = sequence.ok_or(UpdateError::NumbersUsedUp)?;
    Ok((Kept { sequence, crc }, false))
}

impl<L: Link> Script<'_, L> {
    /// Says whether it runs in the end.
    fn run(&mut self, is_kept: bool) -> Result<bool, UpdateError> {
        if self.plan.declares_servo_off {
            let seconds = SERVO_OFF_S;
            let (outcome, detail) = self.tagged(Request::ServoOff { seconds })?;
            self.declared = true;
            if outcome != Outcome::Done {
                return Err(self.refused(outcome, detail));
            }
        }
        if !is_kept {
            self.store()?;
        }
        if self.plan.activates {
            self.talk.may_stop = false;
            self.activate()?;
        }
        Ok(self.plan.activates)
    }

    /// Asks with a tag, where the node wants one.
    fn tagged(&mut self, request: Request) -> Result<(Outcome, u32), UpdateError> {
        self.talk.exchange_tagged(self.key.as_ref(), request)
    }

    fn store(&mut self) -> Result<(), UpdateError> {
        loop {
            let failure = match self.transfer() {
                Ok(()) => return Ok(()),
                Err(failure) => failure,
            };
            // The commit may have come through and its answer not.
            if !self.talk.may_stop && self.is_stored()? {
                return Ok(());
            }
            let is_damage = matches!(
                failure,
                UpdateError::BadContent { .. } | UpdateError::NotAuthorised | UpdateError::Lossy
            );
            if !is_damage || self.repeated.1 == RESTARTS_MAX {
                return Err(failure);
            }
            self.repeated.1 += 1;
        }
    }

    fn is_stored(&mut self) -> Result<bool, UpdateError> {
        let node = identify(self.talk).map_err(|_| UpdateError::Unknown)?;
        Ok(node.next == Some(self.wanted))
    }

    /// One transfer and its commit.
    fn transfer(&mut self) -> Result<(), UpdateError> {
        self.talk.may_stop = true;
        let blob = self.plan.wanted.blob();
        let token = self.talk.transfer_token();
        let begin = UpdateRequest::begin(blob.len(), self.wanted.crc);
        let key = self.key;
        let begun = (self.talk).exchange_tagged_under(token, key.as_ref(), Request::Update(begin));
        match begun? {
            (Outcome::Done, detail) if detail == begin.argument() => self.open = Some(token),
            (Outcome::NoParameters, _) => return Err(UpdateError::NoPrevious),
            (outcome, detail) => return Err(self.refused(outcome, detail)),
        }
        let Kept { sequence, crc } = self.wanted;
        let commit = Request::Update(UpdateRequest::Commit { sequence });
        let mut words = words(token, blob, 0);
        for (sent, word) in (1..).zip(&words) {
            self.talk.send_word(*word)?;
            (self.progress)(sent, words.len() as u64);
        }
        if let Some(key) = &key {
            let command = Command::new(commit, token);
            words.extend(self.talk.authorise(key, &command, blob, crc)?);
        }
        // What is being stored will be, in less than a second.
        self.talk.may_stop = false;
        let (answer, lost) = self.talk.exchange_words(token, commit, &words)?;
        self.repeated.0 += lost;
        match answer {
            (Outcome::Done, crc) if crc == self.wanted.crc => {
                self.open = None;
                Ok(())
            }
            (outcome, detail) => Err(self.refused(outcome, detail)),
        }
    }

    /// Why a request of a transfer was not done.
    fn refused(&mut self, outcome: Outcome, detail: u32) -> UpdateError {
        let declared = self.declared;
        self.declared &= !matches!(outcome, Outcome::ServoOn | Outcome::Busy | Outcome::Done);
        match outcome {
            Outcome::Done => UpdateError::Busy,
            outcome => UpdateError::of(outcome, detail, declared),
        }
    }

    /// Resets the node, and waits until it runs what is wanted, and whether it still does when it could
    /// have faulted twice.
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
        // The answer may have been lost with the reset: then the servo counts as on.
        let looks = if outcome == Outcome::Done {
            RESET_MAX
        } else {
            1
        };
        for look in 1..=looks {
            self.talk.pause(RESET_US)?;
            if self.runs().map_err(silent)? {
                self.declared = false;
                self.talk.pause(PROVEN_US)?;
                return match self.runs().map_err(silent)? {
                    true => Ok(()),
                    false => Err(UpdateError::NotActive { sequence }),
                };
            }
            if look == looks && outcome == Outcome::Done {
                return Err(UpdateError::NotActive { sequence });
            }
        }
        self.declared &= outcome != Outcome::Busy;
        Err(UpdateError::NotActivated { sequence })
    }

    fn runs(&mut self) -> Result<bool, UpdateError> {
        let Kept { sequence, crc } = self.wanted;
        for (page, wanted) in [(page::SEQUENCE, sequence), (page::CRC, crc)] {
            if self.talk.exchange(tell(page))? != (Outcome::Done, wanted) {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Closes what is open; the answers no longer matter.
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

/// Why this node is not to be touched: it is that of another stage, or may be.
fn other_stage(plan: &Plan, identity: &Identity) -> Option<UpdateError> {
    let found = identity.serial.clone();
    match (plan.serial.clone(), plan.wanted.serial()) {
        (Some(expected), _) if found.is_empty() => Some(UpdateError::NoSerial { expected }),
        (Some(expected), _) | (None, Some(expected)) if !found.is_empty() && expected != found => {
            Some(UpdateError::OtherStage { expected, found })
        }
        _ => None,
    }
}
