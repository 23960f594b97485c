//! A host's side of an update.

use super::UpdateError;
use super::dialog::{Job, TRANSFER_TOKEN, Wish};
use super::identity::{Identity, Pages};
use super::plan::{Plan, Updated};
use hal_adapters::can::command::{Outcome, Request};
use hal_adapters::can::update::{TAG_INDEX, UpdateData, UpdateRequest, page, tag, word_of};
use std::collections::VecDeque;

/// How long the servo is declared off: longer than an update takes, on a bad bus too.
const SERVO_OFF_S: u8 = 30;
/// Pause before a node is asked again whether another host is done, us.
const BUSY_US: u64 = 500_000;
/// How often: longer than a node waits for a silent host.
const BUSY_MAX: u32 = 14;
/// How often a transfer that came to nothing, damaged or forgotten, is begun anew.
const RESTARTS_MAX: u32 = 3;
/// How often one transfer is verified: each time names a word that was lost.
const VERIFIED_MAX: u32 = 1_000;
/// Pause before a node is asked again whether it runs the new parameters, us.
const RESET_US: u64 = 20_000;
/// How often: 5 s.
const RESET_MAX: u32 = 250;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    Identify,
    ServoOff,
    Begin,
    Challenge,
    Transfer,
    Verify,
    Commit,
    Activate,
    Restarted,
    Abort,
    ServoOn,
    Over,
}

/// Updates a node: who is there, the servo declared off, the blob transferred, verified and
/// stored, the servo declared on again.
#[derive(Debug)]
pub struct Updater {
    plan: Plan,
    phase: Phase,
    pages: Pages,
    before: Option<Identity>,
    sequence: u32,
    nonce: Vec<u32>,
    words: VecDeque<UpdateData>,
    /// A transfer is open.
    is_open: bool,
    is_declared: bool,
    stored: Option<u32>,
    is_active: bool,
    pause_us: Option<u64>,
    /// How often the phase was tried.
    tries: u32,
    resent: u32,
    restarts: u32,
    failure: Option<UpdateError>,
}

impl Updater {
    /// Before the first request.
    pub fn new(plan: Plan) -> Self {
        Self {
            phase: Phase::Identify,
            pages: Pages::default(),
            before: None,
            sequence: 0,
            nonce: Vec::new(),
            words: VecDeque::new(),
            is_open: false,
            is_declared: false,
            stored: None,
            is_active: false,
            pause_us: None,
            tries: 0,
            resent: 0,
            restarts: 0,
            failure: None,
            plan,
        }
    }

    /// What came of it, once it is over.
    ///
    /// # Errors
    /// See [`UpdateError`]. Unless it says otherwise the node stores what it stored before.
    pub fn result(self) -> Result<Updated, UpdateError> {
        match (self.failure, self.before) {
            (Some(failure), _) => Err(failure),
            (None, None) => Err(UpdateError::NoAnswer),
            (None, Some(before)) => Ok(Updated {
                before,
                sequence: self.stored,
                is_active: self.is_active,
                repeated: (self.resent, self.restarts),
            }),
        }
    }

    /// Words of the blob and its tag that were sent, and how many there are.
    pub fn progress(&self) -> (u64, u64) {
        let total = self.plan.blob.len().div_ceil(4) as u64 + 4;
        let left = match self.phase {
            Phase::Identify | Phase::ServoOff | Phase::Begin | Phase::Challenge => total,
            Phase::Transfer => self.words.len() as u64,
            _ => 0,
        };
        (total.saturating_sub(left), total)
    }

    fn go(&mut self, phase: Phase) {
        self.phase = phase;
        self.tries = 0;
    }

    /// Closes what is open, and ends with this error.
    fn fail(&mut self, error: UpdateError) {
        self.failure.get_or_insert(error);
        self.pause_us = None;
        self.close();
    }

    fn close(&mut self) {
        self.go(if self.is_open {
            Phase::Abort
        } else if self.is_declared {
            Phase::ServoOn
        } else {
            Phase::Over
        });
    }

    /// The transfer came to nothing: once more from the start, unless that was tried often enough.
    fn restart(&mut self, error: UpdateError) {
        self.is_open = false;
        if self.restarts == RESTARTS_MAX {
            return self.fail(error);
        }
        self.restarts += 1;
        self.plan.token = self.plan.token.wrapping_add(1);
        self.pages = Pages::default();
        self.go(Phase::Identify);
    }

    const fn token(&self) -> u8 {
        self.plan.token | TRANSFER_TOKEN
    }

    /// The node is known: whether it may be updated at all, and with which number.
    fn judge(&mut self) {
        let identity = self.pages.identity();
        let other = |serial: &&String| !identity.serial.is_empty() && **serial != identity.serial;
        if let Some(expected) = self.plan.serial.as_ref().filter(other) {
            let (expected, found) = (expected.clone(), identity.serial);
            return self.fail(UpdateError::OtherStage { expected, found });
        }
        let running = identity.running.as_ref();
        let is_there = running.is_some_and(|running| {
            running.sequence == identity.newest_sequence && running.are(&self.plan.blob)
        });
        let (newest, needs_key) = (identity.newest_sequence, identity.needs_key);
        let sent = self.sequence;
        self.before.get_or_insert(identity);
        if is_there {
            // After a reset in the middle: the record was stored, and runs.
            self.stored = (newest == sent && self.restarts > 0).then_some(sent);
            self.is_active = true;
            return self.close();
        }
        if needs_key && self.plan.key.is_none() {
            return self.fail(UpdateError::KeyNeeded);
        }
        let Some(sequence) = newest.checked_add(1) else {
            return self.fail(UpdateError::NumbersUsedUp);
        };
        self.sequence = sequence;
        self.go(if self.plan.declares_servo_off {
            Phase::ServoOff
        } else {
            Phase::Begin
        });
    }

    /// The words of `bytes`, whose first has this index.
    fn words(&self, bytes: &[u8], first: u8) -> Vec<UpdateData> {
        let token = self.token();
        let words = (0..).map_while(|k| word_of(bytes, k.into()).map(|word| (first + k, word)));
        words
            .map(|(index, word)| UpdateData { token, index, word })
            .collect()
    }

    fn tag_words(&self) -> Vec<UpdateData> {
        let (Some(key), &[a, b, c, d]) = (&self.plan.key, &self.nonce[..]) else {
            return Vec::new();
        };
        let tag = tag(key, &[a, b, c, d], self.sequence, &self.plan.blob);
        self.words(&tag, TAG_INDEX)
    }

    /// A transfer is open: all its words are to be sent.
    fn fill(&mut self) {
        let blob = self.words(&self.plan.blob, 0);
        self.words = blob.into_iter().chain(self.tag_words()).collect();
        self.go(Phase::Transfer);
    }

    /// What was lost, once more: a word of the blob, or the tag, which is short.
    fn resend(&mut self, index: u32) {
        let words = match u8::try_from(index) {
            Ok(TAG_INDEX..) | Err(_) => self.tag_words(),
            Ok(index) => {
                let mut words = self.words(&self.plan.blob, 0);
                words.retain(|data| data.index == index);
                words
            }
        };
        self.resent += 1;
        self.words.extend(words);
        self.phase = Phase::Transfer;
    }

    fn request(&self) -> Option<UpdateRequest> {
        let sequence = self.sequence;
        Some(match self.phase {
            Phase::Begin => UpdateRequest::Begin {
                bytes: self.plan.blob.len() as u16,
            },
            Phase::Challenge => UpdateRequest::Challenge {
                part: self.nonce.len() as u8,
            },
            Phase::Verify => UpdateRequest::Verify { sequence },
            Phase::Commit => UpdateRequest::Commit { sequence },
            Phase::Activate => UpdateRequest::Activate,
            Phase::Restarted => UpdateRequest::Tell {
                page: page::SEQUENCE,
            },
            Phase::Abort => UpdateRequest::Abort,
            _ => return None,
        })
    }

    fn verified(&mut self, outcome: Outcome, detail: u32) {
        match outcome {
            Outcome::Done => self.go(Phase::Commit),
            Outcome::Incomplete => {
                self.tries += 1;
                if self.tries > VERIFIED_MAX {
                    return self.fail(UpdateError::Lossy);
                }
                match (detail >= TAG_INDEX.into(), &self.plan.key) {
                    (true, None) => self.fail(UpdateError::KeyNeeded),
                    (true, Some(_)) if self.nonce.len() < 4 => self.phase = Phase::Challenge,
                    _ => self.resend(detail),
                }
            }
            // Whatever the check of the frames let through: damage, or a number that another host took.
            Outcome::NotAuthorised => self.restart(UpdateError::NotAuthorised),
            Outcome::BadContent => self.restart(UpdateError::BadContent { kind: detail }),
            Outcome::WrongSequence => self.restart(UpdateError::Overtaken { least: detail }),
            outcome => self.refused(outcome),
        }
    }

    fn begun(&mut self, outcome: Outcome) {
        match outcome {
            Outcome::Done => {
                self.is_open = true;
                self.nonce.clear();
                if self.plan.key.is_some() && self.needs_key() {
                    self.go(Phase::Challenge);
                } else {
                    self.fill();
                }
            }
            Outcome::Busy if self.tries < BUSY_MAX => {
                self.tries += 1;
                self.pause_us = Some(BUSY_US);
            }
            Outcome::NoParameters => self.fail(UpdateError::NoPrevious),
            outcome => self.refused(outcome),
        }
    }

    fn needs_key(&self) -> bool {
        self.before.as_ref().is_some_and(|node| node.needs_key)
    }

    /// What any request of a transfer may be answered with.
    fn refused(&mut self, outcome: Outcome) {
        match outcome {
            // The node was reset, or another host has declared the servo on.
            Outcome::ServoOn if self.is_declared => {
                self.restart(UpdateError::ServoOn { declared: true });
            }
            Outcome::ServoOn => self.fail(UpdateError::ServoOn { declared: false }),
            Outcome::Busy => {
                // To declare the servo on would end the other host's transfer; it will do so.
                self.is_declared = false;
                self.fail(UpdateError::Busy);
            }
            Outcome::NoRoom => self.fail(UpdateError::NoRoom),
            Outcome::NotAuthorised => self.restart(UpdateError::NotAuthorised),
            Outcome::StoreFailed => {
                self.is_open = false;
                self.fail(UpdateError::StoreFailed);
            }
            // The node was reset, or has waited too long.
            Outcome::NoTransfer => self.restart(UpdateError::Lossy),
            outcome => self.fail(UpdateError::Unexpected {
                outcome: Some(outcome),
            }),
        }
    }
}

impl Job for Updater {
    fn next(&mut self) -> Wish {
        if let Some(us) = self.pause_us.take() {
            return Wish::Pause { us };
        }
        let ask = |request, transfer| Wish::Ask { request, transfer };
        match self.phase {
            Phase::Identify => self.pages.next().map_or(Wish::Over, |page| ask(page, None)),
            Phase::ServoOff => ask(
                Request::ServoOff {
                    seconds: SERVO_OFF_S,
                },
                None,
            ),
            Phase::ServoOn => ask(Request::ServoOff { seconds: 0 }, None),
            Phase::Transfer => match self.words.pop_front() {
                Some(data) => Wish::Send(data),
                None => {
                    self.phase = Phase::Verify;
                    self.next()
                }
            },
            Phase::Over => Wish::Over,
            _ => self.request().map_or(Wish::Over, |request| {
                let is_of_transfer = matches!(
                    self.phase,
                    Phase::Begin | Phase::Verify | Phase::Commit | Phase::Abort
                );
                let transfer = is_of_transfer.then_some(self.token());
                ask(Request::Update(request), transfer)
            }),
        }
    }

    fn answered(&mut self, _request: Request, outcome: Option<Outcome>, detail: u32) {
        if self.phase == Phase::Identify {
            return match self.pages.take(outcome, detail) {
                Ok(()) if self.pages.next().is_some() => {}
                Ok(()) => self.judge(),
                Err(error) => self.fail(error),
            };
        }
        let Some(outcome) = outcome else {
            return self.fail(UpdateError::Unexpected { outcome });
        };
        match (self.phase, outcome) {
            (Phase::ServoOff, _) => {
                self.is_declared = true;
                self.go(Phase::Begin);
            }
            (Phase::Begin, outcome) => self.begun(outcome),
            (Phase::Challenge, Outcome::Done) => {
                self.nonce.push(detail);
                if self.nonce.len() == 4 {
                    self.fill();
                }
            }
            (Phase::Verify, outcome) => self.verified(outcome, detail),
            (Phase::Commit, Outcome::Done) => {
                self.is_open = false;
                self.stored = Some(self.sequence);
                if self.plan.activates {
                    self.go(Phase::Activate);
                } else {
                    self.close();
                }
            }
            (Phase::Activate, Outcome::Done) => {
                self.is_declared = false;
                self.go(Phase::Restarted);
                self.pause_us = Some(RESET_US);
            }
            (Phase::Restarted, outcome) => {
                self.tries += 1;
                if (outcome, detail) == (Outcome::Done, self.sequence) {
                    self.is_active = true;
                    self.close();
                } else if self.tries == RESET_MAX {
                    let sequence = self.sequence;
                    self.fail(UpdateError::NotActive { sequence });
                } else {
                    self.pause_us = Some(RESET_US);
                }
            }
            (Phase::Abort, _) => {
                self.is_open = false;
                self.close();
            }
            (Phase::ServoOn, _) => {
                self.is_declared = false;
                self.close();
            }
            (_, outcome) => self.refused(outcome),
        }
    }

    fn interrupt(&mut self) -> bool {
        // What is being stored will be, in less than a second.
        let is_early = self.failure.is_none() && self.stored.is_none();
        let interrupts = is_early && self.phase != Phase::Commit;
        if interrupts {
            self.fail(UpdateError::Interrupted);
        }
        interrupts
    }

    fn unanswered(&mut self) {
        if self.phase == Phase::Abort {
            self.is_open = false;
            self.close();
        } else if self.phase == Phase::ServoOn {
            self.go(Phase::Over);
        } else {
            self.is_open = false;
            self.is_declared = false;
            self.fail(match self.stored {
                Some(sequence) => UpdateError::NotActive { sequence },
                None if self.phase == Phase::Commit => UpdateError::Unknown,
                None => UpdateError::NoAnswer,
            });
        }
    }
}
