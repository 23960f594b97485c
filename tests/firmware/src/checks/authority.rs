//! Who may: with a key whoever has it, without one whoever holds the line low.

use super::asking::{ask, ask_alone};
use super::commands::SERVO_OFF;
use super::no_resets;
use crate::bench::{Bench, Seen};
use hal_adapters::can::command::{Outcome as Ended, Request};
use hal_adapters::can::update::UpdateRequest;

/// All that moves the pose, makes it invalid, resets, or leads to that.
const REQUESTS: [Request; 7] = [
    SERVO_OFF,
    Request::Rezero { ticks: 300 },
    Request::ClearZero,
    Request::Record { on: true },
    Request::Record { on: false },
    Request::Update(UpdateRequest::Begin { bytes: 400 }),
    Request::Update(UpdateRequest::Activate),
];

/// Without its tag no such request is obeyed by the controller with a key, whatever the line says;
/// with it the servo is declared off. The other one obeys while the line is low, and not while it is
/// high or open.
pub fn tag_or_line(bench: &Bench) {
    for (mut machine, refusal) in [
        (bench.machine([&bench.blob, &[]]), Ended::NotAuthorised),
        (bench.neighbour(), Ended::ServoOn),
    ] {
        machine.chip.servo_on = refusal == Ended::ServoOn;
        Seen::after(&mut machine, 50);
        for (token, request) in (1..).zip(REQUESTS) {
            let seen = ask_alone(&mut machine, request, token, 10);
            assert_eq!(seen.ended(token), [Some(refusal)], "{request:?}");
            assert_eq!(seen.recorded, 0);
        }
        no_resets(&machine);
        machine.chip.servo_on = false;
        machine.run_ticks(1);
        let seen = ask(&mut machine, SERVO_OFF, 20, 10);
        assert_eq!(seen.ended(20), [Some(Ended::Done)]);
    }
}
