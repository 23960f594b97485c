//! A bus that fails.

use super::log::Stage;
use super::start::{row, tick_now};
use super::{no_resets, same_words};
use crate::bench::{Bench, Seen, command};
use crate::can_model::BusState;
use hal_adapters::can::Message;
use hal_adapters::can::command::{Outcome, Request};
use hal_adapters::can::status::flag;

const MS: u64 = 1_000_000;

/// The bus fails by a short circuit, or no other node is there, and it comes back. The ticks go on; old poses
/// are never sent late.
pub fn goes_and_comes_back(bench: &Bench) {
    for bus in [BusState::Off, BusState::Alone] {
        let mut machine = bench.running(100);
        machine.set_bus(bus);
        let silent = Seen::after(&mut machine, 500);
        assert!(silent.axes.len() <= 6, "words on a dead bus");
        let meanwhile = Stage::read(&machine);
        meanwhile.has_the_pose(bench, 598);
        assert!(meanwhile.count("frames_dropped") > 1000);

        machine.set_bus(BusState::Good);
        let after = Seen::after(&mut machine, 500);
        same_words(&after.axes, &bench.poses, 0, 498);
        let first = after.axes.first().map_or(0, |axis| axis.tick);
        assert!(first >= 598, "a pose of tick {first} was sent late");
        let status = after.last_status().expect("no status frame");
        let off = u8::from(bus == BusState::Off);
        assert_eq!(status.bus_off, off);
        assert_eq!(status.flags & flag::BUS_WAS_OFF, off * flag::BUS_WAS_OFF);
        assert_eq!(status.missed_ticks, 0);
        no_resets(&machine);
    }
}

/// A bus that is off for 0.3 ms, between two ticks, is counted.
pub fn off_for_less_than_a_tick(bench: &Bench) {
    let mut machine = bench.machine([&bench.blob, &[]]);
    machine.run_ns(200 * MS + 7 * MS / 10);
    let before = Seen::since_last(&mut machine).last_status();
    assert_eq!(before.map(|s| s.bus_off), Some(0));
    let now_ns = machine.chip.now_ns;
    let at = tick_now(&machine);
    machine.chip.can.blip(now_ns, 3 * MS / 10);
    let seen = Seen::after(&mut machine, 40);
    let status = seen.last_status().expect("no status frame");
    assert_eq!(status.bus_off, 1);
    let reported = seen.first_state(flag::BUS_WAS_OFF);
    row(bench, "bus off for 0.3 ms", at, reported, &seen.axes)
}

/// A frame that is on the wire at the end of its tick is sent once, or not at all if it fails then. No newer
/// frame overtakes it.
pub fn aborted_on_the_wire(bench: &Bench) {
    for fails in [false, true] {
        let mut machine = bench.running(100);
        let dropped_before = Stage::read(&machine).count("frames_dropped");
        // Other nodes hold the bus until just before the frames of the next tick.
        let free_ns = machine.chip.now_ns + 2 * MS + 18 * MS / 100;
        machine.chip.can.occupy(free_ns);
        machine.run_ns(free_ns + MS / 10 - machine.chip.now_ns);
        if fails {
            let now_ns = machine.chip.now_ns;
            assert!(machine.chip.can.destroy(now_ns), "nothing was on the wire");
        }
        machine.run_ticks(10);
        let sent = machine.chip.can.sent.clone();
        let seen = Seen::since_last(&mut machine);
        let ticks: Vec<_> = seen.x().map(|axis| axis.tick).collect();
        let first = if fails { 100 } else { 99 };
        let count = ticks.len() as u64;
        assert!(ticks.iter().copied().eq(first..first + count), "{ticks:?}");
        assert!(count >= 9, "only {count} poses");
        let in_order = sent.is_sorted_by_key(|frame| frame.asked_ns);
        assert!(in_order, "a frame overtook an older one");
        same_words(&seen.axes, &bench.poses, 0, 0);
        let dropped = Stage::read(&machine).count("frames_dropped") - dropped_before;
        assert!(dropped >= 2, "{dropped} frames dropped");
    }
}

/// An answer that other nodes do not let pass holds back no pose, and is sent once when they do.
pub fn an_answer_waits_alone(bench: &Bench) {
    let mut machine = bench.running(100);
    machine.chip.can.others_send = Some(Message::Answer.spec().id - 1);
    let request = Request::Identify { seconds: 1 };
    machine.chip.can.receive(&command(request, 7, 7));
    let held = Seen::after(&mut machine, 50);
    same_words(&held.axes, &bench.poses, 0, 49);
    assert_eq!(held.answers, []);
    machine.chip.can.others_send = None;
    let after = Seen::after(&mut machine, 50);
    assert_eq!(after.outcomes(7), [Some(Outcome::Done)]);
    same_words(&after.axes, &bench.poses, 0, 49);
}

/// More frames than the store holds: the overrun is counted once.
pub fn received_frames_without_room(bench: &Bench) {
    let mut machine = bench.running(100);
    for token in 0..5 {
        let request = Request::Identify { seconds: 1 };
        machine.chip.can.receive(&command(request, token, token));
    }
    machine.run_ticks(20);
    let counted = Stage::read(&machine).count("receive_overruns");
    assert_eq!(counted, 1);
}
