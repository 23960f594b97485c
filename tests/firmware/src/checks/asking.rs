//! Requests to the controller, with a tag where it wants one.

use super::update::{KEY, talk};
use crate::bench::{Seen, command};
use crate::machine::Machine;
use hal_adapters::can::command::{Command, Outcome as Ended, Request};

/// Asks, and runs so many ticks.
pub(super) fn ask(machine: &mut Machine, request: Request, token: u8, ticks: u64) -> Seen {
    let command = Command::new(request, token);
    if command.needs_authority() {
        // The controller without a key ignores the tag.
        talk(machine, |talk| talk.authorise(&KEY, &command, &[]))
            .0
            .expect("a tag");
    }
    ask_alone(machine, request, token, ticks)
}

/// Asks without a tag.
pub(super) fn ask_alone(machine: &mut Machine, request: Request, token: u8, ticks: u64) -> Seen {
    let (id, bytes) = command(request, token, token);
    machine.chip.can.receive(id, bytes);
    Seen::after(machine, ticks)
}

/// Asks for one thing after the other; each must be answered at once, and so.
pub(super) fn answers(machine: &mut Machine, asked: &[(Request, u8, Ended)]) {
    for (request, token, outcome) in asked {
        let seen = ask(machine, *request, *token, 10);
        assert_eq!(seen.ended(*token), [Some(*outcome)], "{request:?}");
    }
}
