//! Commands over the bus.

use super::asking::ask;
use super::no_resets;
use crate::bench::{Bench, Seen, command};
use hal_adapters::can::command::{Outcome, Request};
use hal_adapters::can::status::flag;
use hal_adapters::can::{Layout, Message as M};

/// From the trigger to the middle of the sample, by the driver's documentation, us.
const SAMPLE_US: u64 = 165;

/// Identify: the flag and a fast LED, for the time asked for.
pub fn identify(bench: &Bench) {
    let mut machine = bench.running(50);
    let seen = ask(&mut machine, Request::Identify { seconds: 1 }, 1, 100);
    assert_eq!(seen.outcomes(1), [Some(Outcome::Done)]);
    assert_eq!(seen.flags() & flag::IDENTIFYING, flag::IDENTIFYING);
    let mut blinks = 0;
    let mut lit = machine.chip.led;
    for _ in 0..300 {
        machine.run_ticks(1);
        blinks += u32::from(machine.chip.led != lit);
        lit = machine.chip.led;
    }
    assert!((8..=11).contains(&blinks), "the LED changed {blinks} times");
    let flags = Seen::after(&mut machine, 300).flags();
    assert_eq!(flags & flag::IDENTIFYING, 0);
}

/// The frames of a tick in record mode, in their order: X, Y, Rz, the rest of the pose, the codes; and the
/// age of each at its end. Codes end with record mode.
pub fn order_and_age(bench: &Bench) {
    let mut machine = bench.running(50);
    ask(&mut machine, Request::Record { on: true }, 1, 20);
    machine.run_ticks(320);
    let first_ns = machine.chip.first_tick_ns.expect("no tick");
    let order = [
        &[M::PoseX, M::PoseY, M::PoseRz, M::PoseTime][..],
        &[
            M::PoseZ,
            M::PoseRx,
            M::PoseRy,
            M::Temperature,
            M::SensorTime,
        ],
        Layout::Bits24.messages(),
        &[M::NodeStatus, M::Health],
    ]
    .concat();
    let mut ages: Vec<Option<(u64, u64)>> = vec![None; order.len()];
    let mut last = (0, 0);
    for sent in &machine.chip.can.sent {
        let message = M::from_id(sent.frame.id).expect("a foreign frame");
        let place = order.iter().position(|m| *m == message);
        let place = place.expect("a message that nobody asked for");
        let tick = (sent.asked_ns - first_ns) / 2_000_000;
        assert!(
            (tick, place) > last,
            "{message:?} comes after {:?} in tick {tick}",
            order[last.1]
        );
        last = (tick, place);
        let age_us = (sent.done_ns - first_ns) / 1000 - 2_000 * tick - SAMPLE_US;
        let (least, most) = ages[place].get_or_insert((age_us, age_us));
        (*least, *most) = (age_us.min(*least), age_us.max(*most));
    }
    for (message, age) in order.iter().zip(ages) {
        let (least, most) = age.expect("no such frame");
        println!("RESULT firmware_age_at_end_of_{message:?}_us={least}..{most}");
        assert!(most < 2_000, "a frame of {most} us");
    }
    ask(&mut machine, Request::Record { on: false }, 2, 20);
    let seen = Seen::after(&mut machine, 20);
    assert_eq!(seen.recorded, 0);
}

/// Command frames with every data length code: none stops the program, and only the code 8 is obeyed.
pub fn any_length_code(bench: &Bench) {
    let mut machine = bench.running(50);
    for code in 0..16 {
        let frame = command(Request::ClearZero, code, code);
        machine.chip.can.receive_coded(&frame, code);
        machine.run_ticks(20);
    }
    no_resets(&machine);
    let seen = Seen::since_last(&mut machine);
    let tokens: Vec<_> = seen.answers.iter().map(|answer| answer.token).collect();
    assert_eq!(tokens, [8]);
}
