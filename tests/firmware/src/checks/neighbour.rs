//! A second stage on the bus, with a servo period of its own.

use crate::bench::{Bench, NEIGHBOUR, NEIGHBOUR_PERIOD_US, Seen, command};
use crate::machine::Machine;
use hal_adapters::can::NodeNumber;
use hal_adapters::can::command::{Outcome, Request};

const MS: u64 = 1_000_000;

/// The neighbour has its own identifiers and period, and its poses are the host's. It obeys requests to its
/// number and no others.
pub fn has_identifiers_and_a_period_of_its_own(bench: &Bench) {
    let mut machine = bench.neighbour();
    let own = machine.chip.can.node;
    machine.run_ns(100 * MS);
    Seen::since_last(&mut machine);
    machine.run_ns(1_000 * MS);
    let seen = Seen::since_last(&mut machine);
    assert_eq!(seen.damaged, 0);
    let x: Vec<u32> = seen.x().map(|axis| axis.word).collect();
    let ticks = 1_000_000 / NEIGHBOUR_PERIOD_US as usize;
    assert!(
        x.len().abs_diff(ticks) <= 1,
        "{} poses in a second",
        x.len()
    );
    let host: Vec<u32> = bench.poses.iter().map(|pose| pose.words[0]).collect();
    let mut starts = host.windows(x.len()).take(2 * ticks);
    assert!(starts.any(|poses| poses == x), "the poses skip rows");
    let times: Vec<u32> = seen.times.iter().map(|(_, us)| *us).collect();
    let mut apart = times.windows(2).map(|pair| pair[1].wrapping_sub(pair[0]));
    let slow = 16 * NEIGHBOUR_PERIOD_US as u32;
    let far = apart.find(|us| us.abs_diff(slow) >= 50);
    assert_eq!(far, None, "us from one time to the next");
    for (number, answers) in [(NEIGHBOUR, 1), (NEIGHBOUR ^ 1, 0), (0, 0)] {
        let to = NodeNumber::new(number).expect("no number");
        let answered = identified(&mut machine, own, to);
        assert_eq!(answered, answers, "answers to a request to node {number}");
    }
}

/// How often a request to a node is answered as done.
fn identified(machine: &mut Machine, own: NodeNumber, to: NodeNumber) -> usize {
    let token = to.number() as u8;
    let frame = command(Request::Identify { seconds: 0 }, token, token);
    machine.chip.can.node = to;
    machine.chip.can.receive(&frame);
    machine.chip.can.node = own;
    machine.run_ns(20 * MS);
    let ended = Seen::since_last(machine).outcomes(token);
    ended
        .iter()
        .filter(|ended| **ended == Some(Outcome::Done))
        .count()
}
