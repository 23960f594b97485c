//! Parameters that make the program fault at its start.

use super::asking::{SERVO_OFF, answers};
use super::start::{NOWHERE, TICK};
use super::update::{identity, plan, running, updated};
use crate::bench::{Bench, Seen};
use crate::machine::Machine;
use crate::unicorn::register;
use hal_adapters::can::command::{Outcome, Request};
use hal_adapters::can::status::NodeState;
use hal_adapters::can::update::{UpdateRequest, blob_crc};
use host_fit::bus::update::UpdateSettings;

/// Parameters that make the program fault twice at its start stop it: none run, and the state says so, also
/// after resets, until the user goes back.
pub fn parameters_that_crash(bench: &Bench) {
    let mut machine = bench.machine([&bench.blob, &[]]);
    machine.hook_injection(bench.image.address(TICK));
    machine.run_ticks(20);
    updated(&mut machine, &plan(&bench.later));
    // Without the host's own activation, which waits until the blob has run for a second.
    let activate = Request::Update(UpdateRequest::Activate);
    let asked = [
        (SERVO_OFF, 97, Outcome::Done),
        (activate, 98, Outcome::Done),
    ];
    answers(&mut machine, &asked);
    machine.run_ticks(10);
    let runs = identity(&mut machine).running.map(|(id, _)| id.crc);
    assert_eq!(runs, blob_crc(&bench.later));
    for resets in [2, 3] {
        machine.chip.inject = vec![(register::R0, NOWHERE)];
        machine.run_ticks(10);
        assert_eq!(machine.panics, resets);
    }
    has_stopped(&mut machine);
    machine.run_ticks(600);
    machine.reset_by_pin();
    has_stopped(&mut machine);
    let back = UpdateSettings {
        activates: true,
        ..plan(&bench.blob)
    };
    assert!(updated(&mut machine, &back).is_active);
    assert_eq!(running(&mut machine), bench.blob);
}

fn has_stopped(machine: &mut Machine) {
    Seen::after(machine, 10);
    let seen = Seen::after(machine, 40);
    assert_eq!(seen.last_state(), Some((NodeState::Stopped, 1)));
    assert_eq!(seen.axes.len(), 0);
}
