//! A host's side of an update.

mod job;

use super::UpdateError;
use super::dialog::TRANSFER_TOKEN;
use super::goal::{Found, Goal};
use super::identity::{Identity, Pages};
use super::outgoing::Outgoing;
use super::plan::{Plan, Updated};

/// How often a transfer that came to nothing, damaged or forgotten, is begun anew.
const RESTARTS_MAX: u32 = 3;
/// Pause before a node is asked again whether another host is done, us.
const BUSY_US: u64 = 500_000;
/// How often: longer than a node waits for a silent host.
const BUSY_MAX: u32 = 14;
/// Pause between the two looks at what a node runs after its reset, us. Parameters that make it
/// fault in their first 500 ticks, twice, are passed over by then.
const PROVEN_US: u64 = 2_500_000;

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
    /// Whether it runs a record of the right number.
    Restarted,
    /// Whether that is the right record.
    Compare,
    Abort,
    ServoOn,
    Over,
}

/// The declaration that the servo is off, which is made once: what another host, the service pin or
/// a restart of the machine has taken back is not declared again.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum ServoOff {
    NotDeclared,
    /// In force; taken back at the end.
    Declared,
    /// Left to run out, since another host is at work too, or ended by the reset.
    Left,
    /// The node takes the servo for on all the same.
    Lost,
    /// Not declared by this host, and the node takes the servo for on.
    Missing,
}

/// Updates a node: who is there, the servo declared off, the blob transferred, verified and
/// stored, the servo declared on again.
#[derive(Debug)]
pub struct Updater {
    plan: Plan,
    phase: Phase,
    pages: Pages,
    before: Option<Identity>,
    goal: Option<Goal>,
    outgoing: Outgoing,
    /// A transfer is open.
    is_open: bool,
    servo_off: ServoOff,
    /// A commit was asked for, and it is not known what came of it.
    is_committing: bool,
    /// Sequence number of the record with what is wanted, once the node keeps it.
    record: Option<u32>,
    /// Whether it was stored by this update.
    is_stored: bool,
    is_active: bool,
    /// Whether the node was asked to reset itself.
    has_activated: bool,
    /// Whether it ran the new parameters when it was first asked.
    has_run: bool,
    pause_us: Option<u64>,
    /// How often the phase was tried.
    tries: u32,
    /// How often another host was in the way.
    busy: u32,
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
            goal: None,
            outgoing: Outgoing::new(&plan),
            is_open: false,
            servo_off: ServoOff::NotDeclared,
            is_committing: false,
            record: None,
            is_stored: false,
            is_active: false,
            has_activated: false,
            has_run: false,
            pause_us: None,
            tries: 0,
            busy: 0,
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
        match (self.failure, self.before, self.record) {
            (Some(failure), ..) => Err(failure),
            (None, Some(before), Some(record)) => Ok(Updated {
                before,
                record,
                sequence: self.is_stored.then_some(record),
                is_active: self.is_active,
                repeated: (self.outgoing.resent, self.restarts),
            }),
            _ => Err(UpdateError::NoAnswer),
        }
    }

    /// Words of the blob and its tag that were sent, and how many there are.
    pub fn progress(&self) -> (u64, u64) {
        let (left, total) = self.outgoing.left();
        let left = match self.phase {
            Phase::Identify | Phase::ServoOff | Phase::Begin | Phase::Challenge => total,
            _ => left,
        };
        (total.saturating_sub(left), total)
    }

    fn go(&mut self, phase: Phase) {
        self.phase = phase;
        self.tries = 0;
    }

    /// Closes what is open, and ends with this error.
    fn fail(&mut self, error: UpdateError) {
        if matches!(error, UpdateError::Busy | UpdateError::Overtaken { .. }) {
            self.leave_servo_off();
        }
        self.failure.get_or_insert(error);
        self.pause_us = None;
        self.close();
    }

    /// To declare the servo on would end the transfer of another host, which does so itself.
    fn leave_servo_off(&mut self) {
        if self.servo_off == ServoOff::Declared {
            self.servo_off = ServoOff::Left;
        }
    }

    fn close(&mut self) {
        self.go(if self.is_open {
            Phase::Abort
        } else if matches!(self.servo_off, ServoOff::Declared | ServoOff::Lost) {
            // Where a service pin says on, the node still has the declaration.
            Phase::ServoOn
        } else {
            Phase::Over
        });
    }

    /// Asks anew who the node is, and goes on from what it keeps now.
    fn ask_again(&mut self) {
        self.is_open = false;
        self.pages = Pages::default();
        self.go(Phase::Identify);
    }

    /// Another host is at it: asks again later, unless that was done often enough.
    fn wait_for_another(&mut self, error: UpdateError) {
        self.leave_servo_off();
        if self.busy == BUSY_MAX {
            return self.fail(error);
        }
        self.busy += 1;
        self.ask_again();
        self.pause_us = Some(BUSY_US);
    }

    /// The node runs what is wanted. New parameters may still make it fault: they count as running
    /// if they do when it could have faulted twice.
    fn runs(&mut self) {
        if self.has_activated && !self.has_run {
            self.has_run = true;
            self.go(Phase::Restarted);
            self.pause_us = Some(PROVEN_US);
        } else {
            self.is_active = true;
            self.close();
        }
    }

    /// The transfer came to nothing: once more from the start, unless that was tried often enough.
    fn restart(&mut self, error: UpdateError) {
        self.is_open = false;
        if self.restarts == RESTARTS_MAX {
            return self.fail(if self.is_committing {
                UpdateError::Unknown
            } else {
                error
            });
        }
        self.restarts += 1;
        self.plan.token = self.plan.token.wrapping_add(1);
        self.ask_again();
    }

    const fn token(&self) -> u8 {
        self.plan.token | TRANSFER_TOKEN
    }

    /// Sequence number and CRC-32C of what is to be stored.
    fn wanted(&self) -> (u32, u32) {
        self.goal.map_or((0, 0), |goal| (goal.sequence(), goal.crc))
    }

    /// The node is known: what it keeps, and what is left to be done.
    fn judge(&mut self) {
        let identity = self.pages.identity();
        if let Some(error) = other_stage(&self.plan, &identity) {
            return self.fail(error);
        }
        let settled = match self.goal {
            Some(goal) => Ok(goal),
            None => Goal::of(&self.plan.wanted, &identity),
        };
        let found = settled.and_then(|goal| {
            self.goal = Some(goal);
            goal.found(&identity)
        });
        let needs_key = identity.needs_key;
        self.before.get_or_insert(identity);
        let was_committing = std::mem::take(&mut self.is_committing);
        match found {
            Err(error) => self.fail(error),
            Ok(Found::Record { sequence, runs }) => {
                self.record = Some(sequence);
                self.is_stored |= was_committing && sequence == self.wanted().0;
                if runs {
                    self.runs();
                } else if !self.plan.activates {
                    self.close();
                } else {
                    self.go_with_servo_off(Phase::Activate);
                }
            }
            Ok(Found::Nothing) if needs_key && self.plan.key.is_none() => {
                self.fail(UpdateError::KeyNeeded);
            }
            Ok(Found::Nothing) => self.go_with_servo_off(Phase::Begin),
        }
    }

    fn go_with_servo_off(&mut self, phase: Phase) {
        match (self.servo_off, self.record) {
            (ServoOff::Missing, _) if !self.is_stored => {
                self.fail(UpdateError::ServoOn { declared: false });
            }
            (ServoOff::Lost | ServoOff::Missing, Some(sequence)) => {
                self.fail(UpdateError::NotActivated { sequence });
            }
            (ServoOff::Lost, None) => self.fail(UpdateError::ServoOn { declared: true }),
            (ServoOff::NotDeclared, _) if self.plan.declares_servo_off => self.go(Phase::ServoOff),
            _ => self.go(phase),
        }
    }

    /// A transfer is open: all its words are to be sent.
    fn fill(&mut self) {
        let (sequence, crc) = self.wanted();
        self.outgoing.fill(self.token(), sequence, crc);
        self.go(Phase::Transfer);
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
