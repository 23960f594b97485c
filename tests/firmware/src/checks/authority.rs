//! Authority: the key, or without a key the line that says that the servo is off.

use super::asking::{SERVO_OFF, ask, ask_untagged};
use super::no_resets;
use crate::bench::{Bench, Seen};
use hal_adapters::can::command::{Outcome, Request};
use hal_adapters::can::update::UpdateRequest;

/// Requests that move the pose, make it invalid, reset, or lead to that.
const REQUESTS: [Request; 7] = [
    SERVO_OFF,
    Request::Rezero { ticks: 300 },
    Request::ClearZero,
    Request::Record { on: true },
    Request::Record { on: false },
    Request::Update(UpdateRequest::Begin { bytes: 400 }),
    Request::Update(UpdateRequest::Activate),
];

/// The controller with a key obeys no such request without its tag, though the line is low. The controller
/// without a key obeys while the line is low, and not while it is high or open.
pub fn tag_or_line(bench: &Bench) {
    for (mut machine, refusal) in [
        (bench.machine([&bench.blob, &[]]), Outcome::NotAuthorised),
        (bench.neighbour(), Outcome::ServoOn),
    ] {
        machine.chip.servo_on = refusal == Outcome::ServoOn;
        Seen::after(&mut machine, 50);
        for (token, request) in (1..).zip(REQUESTS) {
            let seen = ask_untagged(&mut machine, request, token, 10);
            assert_eq!(seen.outcomes(token), [Some(refusal)], "{request:?}");
            assert_eq!(seen.recorded, 0);
        }
        no_resets(&machine);
        machine.chip.servo_on = false;
        machine.run_ticks(1);
        let seen = ask(&mut machine, SERVO_OFF, 20, 10);
        assert_eq!(seen.outcomes(20), [Some(Outcome::Done)]);
    }
}
