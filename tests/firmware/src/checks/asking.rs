//! Requests to the controller, with a tag where it wants one.

use super::update::{KEY, talk};
use super::{Failure, Outcome, equal};
use crate::bench::{Seen, command};
use crate::machine::Machine;
use hal_adapters::can::command::{Command, Outcome as Ended, Request};

/// Asks, and runs so many ticks.
pub(super) fn ask(
    machine: &mut Machine,
    request: Request,
    token: u8,
    ticks: u64,
) -> Result<Seen, Failure> {
    let command = Command::new(request, token);
    if command.needs_authority() {
        // The controller without a key ignores the tag.
        talk(machine, |talk| talk.authorise(&KEY, &command, &[], 0))?.0?;
    }
    ask_alone(machine, request, token, ticks)
}

/// Asks without a tag.
pub(super) fn ask_alone(
    machine: &mut Machine,
    request: Request,
    token: u8,
    ticks: u64,
) -> Result<Seen, Failure> {
    let (id, bytes) = command(request, token, token);
    machine.chip.can.receive(id, bytes);
    machine.run_ticks(ticks)?;
    Ok(Seen::since_last(machine))
}

pub(super) fn ended(seen: &Seen, token: u8) -> Vec<Option<Ended>> {
    seen.answers
        .iter()
        .filter(|(_, a)| a.token == token)
        .map(|(_, a)| a.outcome)
        .collect()
}

/// Asks for one thing after the other; each must be answered at once, and so.
pub(super) fn answers(machine: &mut Machine, asked: &[(Request, u8, Ended)]) -> Outcome {
    for (request, token, outcome) in asked {
        let seen = ask(machine, *request, *token, 10)?;
        let what = format!("answer to {request:?}");
        equal(&what, ended(&seen, *token), vec![Some(*outcome)])?;
    }
    Ok(())
}
