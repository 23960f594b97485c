//! What is put into the image after the build: the check of the program, and the key, which stays in flash.

use super::asking::{SERVO_OFF, answers};
use super::update::KEY;
use crate::bench::{Bench, Seen};
use crate::machine::Machine;
use hal_adapters::can::command::Outcome;
use hal_adapters::can::status::{NodeState, board_check};

/// State, reason and Health page 11 of a controller after its start.
fn start(mut machine: Machine) -> (Option<NodeState>, u8, Option<u32>) {
    let seen = Seen::after(&mut machine, 250);
    let status = seen.statuses.last().expect("a status").1;
    (status.state, status.reason, seen.page(11))
}

/// A bit of the program in flash has flipped: in the vector of an unused interrupt, in a constant.
pub fn a_changed_program_does_not_run(bench: &Bench) {
    let parameters = [&bench.blob[..], &[]];
    let sound = start(bench.machine(parameters));
    assert_eq!(sound, (Some(NodeState::Running), 0, Some(0)));
    let vectors = bench.image.address("__INTERRUPTS");
    let constants = bench.image.address("__erodata");
    for (address, bit) in [(vectors, 32), (constants - 4, 3)] {
        let mut machine = bench.machine(parameters);
        machine.flip(address, bit);
        let changed = start(machine);
        assert_eq!(changed, (Some(NodeState::Stopped), 4, Some(0)));
    }
}

/// A controller without a key says so on the bus.
pub fn a_program_without_a_key_says_so(bench: &Bench) {
    let (state, _, checks) = start(bench.neighbour());
    let wanted = (Some(NodeState::Running), Some(board_check::NO_KEY));
    assert_eq!((state, checks), wanted);
}

/// After tagged requests RAM holds no half of the key, and not the cipher's first round key either: it is the key with
/// bit 0 of all bytes first, then bit 1. Bits 4 to 7 of this key are 0.
pub fn no_copy_of_the_key_is_in_ram(bench: &Bench) {
    let mut machine = bench.running(100);
    let request = |token| (SERVO_OFF, token, Outcome::Done);
    answers(&mut machine, &[request(7), request(8)]);
    let round_key: Vec<u8> = (0..4)
        .flat_map(|bit| {
            let bit_of = |k: usize| u16::from(KEY[k % 4 * 4 + k / 4] >> bit & 1) << k;
            (0..16).map(bit_of).sum::<u16>().to_le_bytes()
        })
        .collect();
    for half in KEY.chunks(8).chain([&round_key[..]]) {
        let ram = &machine.chip.ram.0;
        let found = ram.windows(half.len()).position(|at| at == half);
        assert_eq!(found, None, "{half:02x?}");
    }
}
