//! Requests to the controller, with a tag where it wants one.

use super::update::{KEY, talk};
use crate::bench::{Seen, command};
use crate::machine::Machine;
use hal_adapters::can::command::{Command, Outcome, Request};

pub(super) const SERVO_OFF: Request = Request::ServoOff { seconds: 3 };

/// Sends a request and runs some ticks.
pub(super) fn ask(machine: &mut Machine, request: Request, token: u8, ticks: u64) -> Seen {
    let command = Command::new(request, token);
    if command.needs_authority() {
        // The controller without a key ignores the tag.
        talk(machine, |talk| talk.authorise(&KEY, &command, &[]))
            .0
            .expect("a tag");
    }
    ask_untagged(machine, request, token, ticks)
}

/// Sends a request without a tag.
pub(super) fn ask_untagged(machine: &mut Machine, request: Request, token: u8, ticks: u64) -> Seen {
    (machine.chip.can).receive(&command(request, token, token));
    Seen::after(machine, ticks)
}

/// Sends requests one after the other. Each must have this outcome at once.
pub(super) fn answers(machine: &mut Machine, asked: &[(Request, u8, Outcome)]) {
    for (request, token, outcome) in asked {
        let seen = ask(machine, *request, *token, 10);
        assert_eq!(seen.outcomes(*token), [Some(*outcome)], "{request:?}");
    }
}
