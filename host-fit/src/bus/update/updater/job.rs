//! What an update asks for next, and what follows from the answer.

use super::{Phase, ServoOff, Updater};
use crate::bus::update::UpdateError;
use crate::bus::update::dialog::{Job, Wish};
use hal_adapters::can::command::{Outcome, Request};
use hal_adapters::can::update::{TAG_INDEX, UpdateRequest, page};

/// How long the servo is declared off: longer than an update takes, on a bad bus too.
const SERVO_OFF_S: u8 = 30;
/// How often one transfer is verified: each time names a word that was lost.
const VERIFIED_MAX: u32 = 1_000;
/// Pause before a node is asked again whether it runs the new parameters, us.
const RESET_US: u64 = 20_000;
/// How often: 5 s.
const RESET_MAX: u32 = 250;

impl Updater {
    fn request(&self) -> Option<UpdateRequest> {
        let (sequence, crc) = self.wanted();
        Some(match self.phase {
            Phase::Begin => UpdateRequest::begin(self.outgoing.bytes(), crc),
            Phase::Challenge => UpdateRequest::Challenge {
                part: self.outgoing.challenge()?,
            },
            Phase::Verify => UpdateRequest::Verify { sequence },
            Phase::Commit => UpdateRequest::Commit { sequence },
            Phase::Activate => UpdateRequest::Activate,
            Phase::Restarted => UpdateRequest::Tell {
                page: page::SEQUENCE,
            },
            Phase::Compare => UpdateRequest::Tell { page: page::CRC },
            Phase::Abort => UpdateRequest::Abort,
            _ => return None,
        })
    }

    /// Whether what the node calls done is of this blob. Another host may have chosen the same token.
    fn is_own(&self, detail: u32) -> bool {
        match self.phase {
            Phase::Begin => self.request().map(|request| request.argument()) == Some(detail),
            _ => self.wanted().1 == detail,
        }
    }

    fn begun(&mut self, outcome: Outcome, detail: u32) {
        match outcome {
            Outcome::Done => {
                self.is_open = true;
                self.outgoing.begin();
                let needs_key = self.before.as_ref().is_some_and(|node| node.needs_key);
                if self.plan.key.is_some() && needs_key {
                    self.go(Phase::Challenge);
                } else {
                    self.fill();
                }
            }
            Outcome::Busy => self.wait_for_another(UpdateError::Busy),
            Outcome::NoParameters => self.fail(UpdateError::NoPrevious),
            outcome => self.refused(outcome, detail),
        }
    }

    fn verified(&mut self, outcome: Outcome, detail: u32) {
        match outcome {
            Outcome::Done => {
                self.is_committing = true;
                self.go(Phase::Commit);
            }
            Outcome::Incomplete => {
                self.tries += 1;
                if self.tries > VERIFIED_MAX {
                    return self.fail(UpdateError::Lossy);
                }
                match (detail >= TAG_INDEX.into(), &self.plan.key) {
                    (true, None) => self.fail(UpdateError::KeyNeeded),
                    (true, Some(_)) if self.outgoing.challenge().is_some() => {
                        self.phase = Phase::Challenge;
                    }
                    _ => {
                        let (sequence, crc) = self.wanted();
                        self.outgoing.resend(detail, self.token(), sequence, crc);
                        self.phase = Phase::Transfer;
                    }
                }
            }
            // Damage that the check of the frames let through.
            Outcome::BadContent => self.restart(UpdateError::BadContent { kind: detail }),
            outcome => self.refused(outcome, detail),
        }
    }

    fn committed(&mut self) {
        self.is_open = false;
        self.is_committing = false;
        self.is_stored = true;
        self.record = Some(self.wanted().0);
        if self.servo_off == ServoOff::Left {
            // The other host that was at it is done.
            self.servo_off = ServoOff::Declared;
        }
        if self.plan.activates {
            self.go(Phase::Activate);
        } else {
            self.close();
        }
    }

    /// The node runs something again.
    fn restarted(&mut self, outcome: Outcome, detail: u32) {
        self.tries += 1;
        let sequence = self.record.unwrap_or_default();
        if (outcome, detail) == (Outcome::Done, sequence) {
            self.go(Phase::Compare);
        } else if self.tries == RESET_MAX {
            self.fail(UpdateError::NotActive { sequence });
        } else {
            self.pause_us = Some(RESET_US);
        }
    }

    fn compared(&mut self, outcome: Outcome, detail: u32) {
        if (outcome, detail) == (Outcome::Done, self.wanted().1) {
            return self.runs();
        }
        let sequence = self.record.unwrap_or_default();
        self.fail(UpdateError::NotActive { sequence });
    }

    /// What any request of a transfer may be answered with.
    fn refused(&mut self, outcome: Outcome, detail: u32) {
        match outcome {
            // The answer to what was asked before may be lost: the node tells what came of it.
            Outcome::ServoOn => {
                self.servo_off = match self.servo_off {
                    ServoOff::NotDeclared | ServoOff::Missing => ServoOff::Missing,
                    _ => ServoOff::Lost,
                };
                self.ask_again();
            }
            Outcome::Busy if self.is_committing => {
                self.leave_servo_off();
                self.ask_again();
            }
            Outcome::Busy => self.wait_for_another(match self.record {
                Some(sequence) => UpdateError::NotActivated { sequence },
                None => UpdateError::Busy,
            }),
            Outcome::NoRoom => self.fail(UpdateError::NoRoom),
            Outcome::NoRandomNumber => self.fail(UpdateError::NoRandomNumber),
            Outcome::NotAuthorised => self.restart(UpdateError::NotAuthorised),
            // A number that another host has taken; the node tells for what.
            Outcome::WrongSequence => self.restart(UpdateError::Overtaken { least: detail }),
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
            Phase::Transfer => match self.outgoing.next() {
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
        self.has_activated |= self.phase == Phase::Activate;
        match (self.phase, outcome) {
            (Phase::ServoOff, _) => {
                self.servo_off = ServoOff::Declared;
                self.go(match self.record {
                    Some(_) => Phase::Activate,
                    None => Phase::Begin,
                });
            }
            (Phase::Begin | Phase::Verify | Phase::Commit, Outcome::Done)
                if !self.is_own(detail) =>
            {
                self.leave_servo_off();
                self.restart(UpdateError::Busy);
            }
            (Phase::Begin, outcome) => self.begun(outcome, detail),
            (Phase::Challenge, Outcome::Done) => {
                self.outgoing.take(detail);
                if self.outgoing.challenge().is_none() {
                    self.fill();
                }
            }
            (Phase::Verify, outcome) => self.verified(outcome, detail),
            (Phase::Commit, Outcome::Done) => self.committed(),
            (Phase::Activate, Outcome::Done) => {
                self.servo_off = ServoOff::Left;
                self.go(Phase::Restarted);
                self.pause_us = Some(RESET_US);
            }
            (Phase::Restarted, outcome) => self.restarted(outcome, detail),
            (Phase::Compare, outcome) => self.compared(outcome, detail),
            (Phase::Abort, _) => {
                self.is_open = false;
                self.close();
            }
            (Phase::ServoOn, _) => {
                self.servo_off = ServoOff::Left;
                self.close();
            }
            (_, outcome) => self.refused(outcome, detail),
        }
    }

    fn interrupt(&mut self) -> bool {
        // What is being stored will be, in less than a second.
        let interrupts = self.failure.is_none() && !self.is_stored && !self.is_committing;
        if interrupts {
            self.fail(UpdateError::Interrupted);
        }
        interrupts
    }

    fn unanswered(&mut self) {
        match (self.phase, self.record) {
            (Phase::Abort, _) => {
                self.is_open = false;
                self.close();
            }
            (Phase::ServoOn, _) => self.go(Phase::Over),
            (Phase::Commit, _) => self.restart(UpdateError::Unknown),
            (_, record) => {
                self.is_open = false;
                self.servo_off = ServoOff::Left;
                self.fail(match record {
                    _ if self.is_committing => UpdateError::Unknown,
                    Some(sequence) => UpdateError::Silent { sequence },
                    None => UpdateError::NoAnswer,
                });
            }
        }
    }
}
