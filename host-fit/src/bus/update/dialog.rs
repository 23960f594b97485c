//! Requests and answers, without a bus and without a clock: frames and times in, frames out.

use hal_adapters::can::command::{Answer, Command, Mailbox, Outcome, Request, Told};
use hal_adapters::can::update::UpdateData;
use hal_adapters::can::{BusFrame, Coded};

/// From frame to frame, us. The receive store of a controller holds three frames and is emptied in
/// every tick of 2 ms: at one frame in a millisecond none is lost, not even to a tick that is late.
pub const SPACING_US: u64 = 1_000;
/// How long an answer is waited for before the request is repeated, us.
const PATIENCE_US: u64 = 100_000;
/// How often a request is sent: for 3 s, in which a controller starts.
const ATTEMPTS: u32 = 30;
/// How often a node may say that it is still at it.
const STARTED_MAX: u32 = 100;
/// The tokens of transfers have this bit, those of other requests do not.
pub(super) const TRANSFER_TOKEN: u8 = 0x80;

/// What a job wants next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wish {
    /// The answer to a request.
    Ask {
        /// What is asked for.
        request: Request,
        /// The transfer that it belongs to, if any.
        transfer: Option<u8>,
    },
    /// A word sent; no answer comes.
    Send(UpdateData),
    /// A pause.
    Pause {
        /// How long, us.
        us: u64,
    },
    /// Nothing: it is over.
    Over,
}

/// What is asked for, step by step.
pub trait Job {
    /// The next step.
    fn next(&mut self) -> Wish;

    /// A request was answered, with something other than [`Outcome::Started`]. The outcome is `None` if
    /// this version does not know its number.
    fn answered(&mut self, request: Request, outcome: Option<Outcome>, detail: u32);

    /// A request was repeated for 3 s and never answered, or never to an end.
    fn unanswered(&mut self);

    /// Ctrl-C: whether what was asked for last is no longer waited for.
    fn interrupt(&mut self) -> bool;
}

#[derive(Clone, Copy, Debug)]
enum State {
    Free,
    Asking {
        command: Command,
        request: Request,
        until_us: u64,
        attempts: u32,
        started: u32,
    },
    Pausing {
        until_us: u64,
    },
    Over,
}

/// Has a job's requests answered, one after the other: each is repeated until it is.
#[derive(Debug)]
pub struct Dialog<J> {
    job: J,
    mailbox: Mailbox,
    token: u8,
    /// The last command of another host.
    heard: Option<Command>,
    state: State,
    /// When the next frame may leave, us.
    free_us: u64,
}

impl<J: Job> Dialog<J> {
    /// A dialog before its first request. Programs that run one after the other need different
    /// tokens: a node ignores a request that equals the last one.
    pub fn new(job: J, token: u8) -> Self {
        Self {
            job,
            mailbox: Mailbox::default(),
            token,
            heard: None,
            state: State::Free,
            free_us: 0,
        }
    }

    /// The job.
    pub const fn job(&self) -> &J {
        &self.job
    }

    /// Ends the job early, as far as it can be.
    pub fn interrupt(&mut self) {
        if self.job.interrupt() {
            self.state = State::Free;
        }
    }

    /// The job, once it is over.
    pub fn into_job(self) -> J {
        self.job
    }

    /// Whether nothing more is to be sent or waited for.
    pub const fn is_over(&self) -> bool {
        matches!(self.state, State::Over)
    }

    /// When [`Dialog::poll`] has something to do, if no frame comes before, us.
    pub const fn due_us(&self) -> u64 {
        let until_us = match self.state {
            State::Asking { until_us, .. } | State::Pausing { until_us } => until_us,
            State::Free | State::Over => 0,
        };
        if until_us > self.free_us {
            until_us
        } else {
            self.free_us
        }
    }

    /// The frame that is to be sent now, if any.
    pub fn poll(&mut self, now_us: u64) -> Option<Coded> {
        while now_us >= self.due_us() {
            match self.state {
                State::Over => return None,
                State::Asking { attempts: 0, .. } => {
                    self.state = State::Free;
                    self.job.unanswered();
                }
                State::Asking {
                    command,
                    request,
                    attempts,
                    started,
                    ..
                } => {
                    self.state = State::Asking {
                        command,
                        request,
                        until_us: now_us + PATIENCE_US,
                        attempts: attempts - 1,
                        started,
                    };
                    return self.send(now_us, &Told::Command(command));
                }
                State::Pausing { .. } => self.state = State::Free,
                State::Free => match self.job.next() {
                    Wish::Ask { request, transfer } => self.ask(request, transfer),
                    Wish::Send(data) => return self.send(now_us, &Told::UpdateData(data)),
                    Wish::Pause { us } => {
                        let until_us = now_us + us;
                        self.state = State::Pausing { until_us };
                    }
                    Wish::Over => self.state = State::Over,
                },
            }
        }
        None
    }

    /// Takes a frame of the bus.
    pub fn take(&mut self, frame: &BusFrame, now_us: u64) {
        let told = self.mailbox.take(frame);
        if let Some(Ok(Told::Command(other))) = told {
            self.heard = Some(other);
        }
        let State::Asking {
            command,
            request,
            started,
            ..
        } = self.state
        else {
            return;
        };
        match told {
            Some(Ok(Told::Answer(answer)))
                if (answer.number, answer.token) == (command.number, command.token) =>
            {
                self.answered(request, command, started, &answer, now_us);
            }
            // The answer could be that of the other host: ask anew.
            Some(Ok(Told::Command(_)))
                if command.token < TRANSFER_TOKEN && self.is_taken(&command) =>
            {
                self.ask(request, None);
            }
            _ => {}
        }
    }

    /// Whether another host asked for something else of this kind last, under the same token.
    fn is_taken(&self, command: &Command) -> bool {
        let name = |command: &Command| (command.number, command.token);
        let heard = self.heard.filter(|other| name(other) == name(command));
        heard.is_some_and(|other| other.request != command.request)
    }

    fn answered(
        &mut self,
        request: Request,
        command: Command,
        started: u32,
        answer: &Answer,
        now_us: u64,
    ) {
        if answer.outcome != Some(Outcome::Started) {
            self.state = State::Free;
            return self.job.answered(request, answer.outcome, answer.detail);
        }
        // It is at it: another answer follows, which may be lost.
        self.state = State::Asking {
            command,
            request,
            until_us: now_us + PATIENCE_US,
            attempts: if started < STARTED_MAX { ATTEMPTS } else { 0 },
            started: started + 1,
        };
    }

    fn ask(&mut self, request: Request, transfer: Option<u8>) {
        let mut command = Command::new(request, transfer.unwrap_or_default());
        if transfer.is_none() {
            command.token = self.next_token();
            if self.is_taken(&command) {
                command.token = self.next_token();
            }
        }
        self.state = State::Asking {
            command,
            request,
            until_us: 0,
            attempts: ATTEMPTS,
            started: 0,
        };
    }

    const fn next_token(&mut self) -> u8 {
        self.token = self.token.wrapping_add(1) & !TRANSFER_TOKEN;
        self.token
    }

    fn send(&mut self, now_us: u64, told: &Told) -> Option<Coded> {
        self.free_us = now_us + SPACING_US;
        self.mailbox.send(told)
    }
}

#[cfg(test)]
#[path = "dialog_tests.rs"]
mod tests;
