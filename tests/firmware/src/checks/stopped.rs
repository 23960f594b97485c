//! What runs after a reset: what ran before it; and nothing, where the program faults at its start.

use super::asking::answers;
use super::commands::SERVO_OFF;
use super::start::{NOWHERE, TICK};
use super::update::{identity, plan, running, updated};
use crate::bench::{Bench, Seen};
use crate::machine::Machine;
use crate::unicorn::register;
use hal_adapters::can::command::{Outcome as Ended, Request};
use hal_adapters::can::status::NodeState;
use hal_adapters::can::update::{UpdateRequest, blob_crc};
use host_fit::bus::update::Plan;

/// Reads a blob at the start.
const CHECK: &str = "10from_flash";

/// A blob that is stored waits: over resets of any cause what ran before runs, until power-on.
pub fn a_reset_runs_what_ran(bench: &Bench) {
    let mut machine = bench.running(20);
    updated(&mut machine, &plan(&bench.later));
    machine.reset_by_pin();
    assert_eq!(running(&mut machine), bench.blob);
    machine.run_ticks(600);
    machine.hold_ns = 60_000_000;
    machine.run_ticks(100);
    assert_eq!(machine.watchdog_resets, 1);
    assert_eq!(running(&mut machine), bench.blob);
    machine.power_cycle();
    assert_eq!(running(&mut machine), bench.later);
}

/// A controller that has just begun to run [`Bench::later`] in place of [`Bench::blob`].
fn about_to_crash(bench: &Bench) -> Machine {
    let mut machine = bench.machine([&bench.blob, &[]]);
    machine.hook_injection(bench.image.address(TICK));
    machine.run_ticks(20);
    updated(&mut machine, &plan(&bench.later));
    // Not by the host, which waits until they have run for a second.
    let activate = Request::Update(UpdateRequest::Activate);
    let asked = [(SERVO_OFF, 97, Ended::Done), (activate, 98, Ended::Done)];
    answers(&mut machine, &asked);
    machine.run_ticks(10);
    let runs = identity(&mut machine).running;
    assert!(
        runs.map(|(id, _)| id.crc) == blob_crc(&bench.later),
        "the new parameters do not run"
    );
    machine
}

/// The program faults once, at the address of the hook.
fn crash(machine: &mut Machine) {
    machine.chip.inject = vec![(register::R0, NOWHERE)];
    machine.run_ticks(10)
}

/// Parameters that make the program fault twice at its start: none run, and the state says so, also after
/// resets, until the user goes back.
pub fn parameters_that_crash(bench: &Bench) {
    let mut machine = about_to_crash(bench);
    for resets in [2, 3] {
        crash(&mut machine);
        assert_eq!(machine.panics, resets);
    }
    has_stopped(&mut machine);
    machine.run_ticks(600);
    machine.reset_by_pin();
    has_stopped(&mut machine);
    let back = Plan {
        activates: true,
        ..plan(&bench.blob)
    };
    assert!(updated(&mut machine, &back).is_active);
    assert_eq!(running(&mut machine), bench.blob);
}

/// Parameters whose check at the start makes the program fault twice, though they are not the newest.
pub fn parameters_whose_check_crashes(bench: &Bench) {
    let mut machine = bench.machine([&bench.blob, &[]]);
    machine.hook_injection(bench.image.address(CHECK));
    machine.run_ticks(20);
    updated(&mut machine, &plan(&bench.later));
    machine.run_ticks(600);
    for resets in [1, 2] {
        machine.reset_by_pin();
        crash(&mut machine);
        assert_eq!(machine.panics, resets);
    }
    has_stopped(&mut machine);
    machine.power_cycle();
    assert_eq!(running(&mut machine), bench.later);
}

/// Nothing runs, and the state says why.
fn has_stopped(machine: &mut Machine) {
    Seen::after(machine, 10);
    let seen = Seen::after(machine, 40);
    assert_eq!(seen.last_state(), Some((NodeState::Stopped, 1)));
    assert_eq!(seen.axes.len(), 0);
}
