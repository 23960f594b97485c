//! Parameters that make the program fault: others run in their place.

use super::commands::{SERVO_OFF, answers};
use super::start::TICK;
use super::update::{PART, plan, running, talk, update};
use super::{Failure, Outcome, equal, expect};
use crate::bench::{Bench, Seen};
use crate::callbacks::Injected;
use crate::machine::Machine;
use crate::unicorn::register;
use hal_adapters::can::command::{Outcome as Ended, Request};
use hal_adapters::can::status::NodeState;
use hal_adapters::can::update::UpdateRequest;
use host_fit::bus::update::Identifier;

/// Reads a plain blob at the start.
const CHECK: &str = "10from_flash";

/// A controller that has just begun to run [`Bench::later`] in place of [`Bench::blob`].
pub(super) fn about_to_crash(bench: &Bench) -> Result<Machine, Failure> {
    let mut machine = bench.machine(PART, [&bench.blob, &[]])?;
    machine.hook_injection(bench.image(PART).address(TICK)?)?;
    machine.run_ticks(20)?;
    update(&mut machine, plan(&bench.later, 1))?.0?;
    // Not by the host, which waits until they are proven.
    let activate = Request::Update(UpdateRequest::Activate);
    let asked = [(SERVO_OFF, 97, Ended::Done), (activate, 98, Ended::Done)];
    answers(&mut machine, &asked)?;
    machine.run_ticks(10)?;
    let (job, _) = talk(&mut machine, Identifier::default(), 90)?;
    let runs = job.result()?.running;
    expect(runs.is_some_and(|runs| runs.are(&bench.later)), || {
        "the new ones do not run".to_owned()
    })?;
    Ok(machine)
}

/// What [`Machine::hook_injection`] named reads where nothing is, in the next ticks.
pub(super) fn crash(machine: &mut Machine) -> Outcome {
    let (register, value) = (register::R0, 0x6000_0000);
    machine.chip.inject = vec![Injected { register, value }];
    Ok(machine.run_ticks(10)?)
}

/// Parameters that make the program fault twice at its start: those before them run, and it is
/// told.
pub fn parameters_that_crash(bench: &Bench) -> Outcome {
    let mut machine = about_to_crash(bench)?;
    for resets in [2, 3] {
        crash(&mut machine)?;
        equal("resets", machine.panics, resets)?;
    }
    are_passed_over(&mut machine, &bench.blob)
}

/// Parameters whose check at the start makes the program fault twice, though they are not the newest.
pub fn parameters_whose_check_crashes(bench: &Bench) -> Outcome {
    let mut machine = bench.machine(PART, [&bench.blob, &[]])?;
    machine.hook_injection(bench.image(PART).address(CHECK)?)?;
    machine.run_ticks(20)?;
    update(&mut machine, plan(&bench.later, 1))?.0?;
    for resets in [1, 2] {
        machine.reset_by_pin();
        crash(&mut machine)?;
        equal("resets", machine.panics, resets)?;
    }
    are_passed_over(&mut machine, &bench.later)
}

/// Others run in their place, it is told, and it stays so.
fn are_passed_over(machine: &mut Machine, others: &[u8]) -> Outcome {
    Seen::since_last(machine);
    machine.run_ticks(40)?;
    let seen = Seen::since_last(machine);
    let status = seen.last_status().ok_or("no state")?;
    let told = (status.state, status.reason);
    equal("state", told, (Some(NodeState::Running), 0x80 | 12))?;
    equal("running", running(machine)?, others.to_vec())?;
    machine.power_cycle();
    equal("after power-on", running(machine)?, others.to_vec())
}
