use super::super::frame::BusFrame;
use super::super::sensor::{TemperatureSender, frames, frames_16};
use super::*;

const LAYOUTS: [Layout; 2] = [Layout::Bits16, Layout::Bits24];

fn raw(sequence: u32) -> RawFrame {
    let code = sequence as i32 % 30_000;
    RawFrame::new(
        [code, -code, 17],
        [code / 2, 5, -code / 3],
        sequence,
        sequence.wrapping_mul(2_000),
    )
}

fn new(layout: Layout) -> SensorReceiver {
    SensorReceiver::new(layout, Timing::default())
}

/// Feeds the frames of a tick at 2 ms a tick; gives the ticks and faults that come out.
fn feed(r: &mut SensorReceiver, layout: Layout, sequence: u32) -> (Option<RawFrame>, u32) {
    let (mut tick, mut faults) = (None, 0);
    for frame in frames(layout, &raw(sequence)) {
        let taken = r.take(&BusFrame::from(frame), sequence.wrapping_mul(2_000));
        assert!(tick.is_none() || taken.tick.is_none());
        tick = tick.or(taken.tick);
        faults += u32::from(taken.fault.is_some());
    }
    (tick, faults)
}

/// The frames of a tick, Hall and capacitive.
fn pair(sequence: u32) -> [BusFrame; 2] {
    frames_16(&raw(sequence)).map(BusFrame::from)
}

fn codes(frame: &RawFrame) -> ([i32; 3], [i32; 3]) {
    (frame.hall, frame.capacitive)
}

#[test]
fn every_tick_comes_out_whole_and_numbered_across_counter_wraps() {
    for layout in LAYOUTS {
        let mut r = new(layout);
        for sequence in 5..200 {
            assert_eq!(feed(&mut r, layout, sequence), (Some(raw(sequence)), 0));
        }
        let health = r.health();
        assert_eq!(health.good as usize, 195 * layout.messages().len());
        let good = health.good;
        assert_eq!(
            *health,
            BusHealth {
                good,
                ..BusHealth::default()
            }
        );
    }
}

#[test]
fn a_dropped_frame_leaves_its_codes_missing_and_the_next_tick_whole() {
    let mut r = new(Layout::Bits16);
    feed(&mut r, Layout::Bits16, 1);
    let [hall, _] = pair(2);
    assert_eq!(r.take(&hall, 4_000), Taken::NOTHING);
    let [hall, gaps] = pair(3);
    let taken = r.take(&hall, 6_000);
    let partial = taken.tick.expect("the tick is over");
    assert_eq!(codes(&partial), (raw(2).hall, [MISSING_CODE; 3]));
    let taken = r.take(&gaps, 6_000);
    let message = Message::Capacitive;
    assert_eq!(taken.fault, Some(BusFault::Lost { message, frames: 1 }));
    assert_eq!(taken.tick, Some(raw(3)));
    assert_eq!(r.health().incomplete, 1);
}

#[test]
fn the_passing_of_time_ends_a_tick_and_then_calls_the_source_stale() {
    let mut r = new(Layout::Bits16);
    feed(&mut r, Layout::Bits16, 1);
    let [hall, _] = pair(2);
    r.take(&hall, 4_000);
    assert_eq!(r.deadline_us(), Some(5_000));
    assert_eq!(r.poll(4_999), Taken::NOTHING);
    assert_eq!(r.poll(5_000).tick.map(|t| t.hall), Some(raw(2).hall));
    assert_eq!(r.deadline_us(), Some(7_000));
    assert_eq!(r.poll(6_999), Taken::NOTHING);
    let fault = Some(BusFault::Stale { age_us: 3_000 });
    assert_eq!(r.poll(7_000), Taken { tick: None, fault });
    assert!(r.is_stale());
    assert_eq!((r.poll(9_000), r.deadline_us()), (Taken::NOTHING, None));
    assert_eq!(feed(&mut r, Layout::Bits16, 3).0, Some(raw(3)));
    assert!(!r.is_stale());
    // A clock that steps back makes nothing stale.
    assert_eq!(r.poll(0), Taken::NOTHING);
}

#[test]
fn a_frame_sixteen_ticks_on_is_not_joined_to_an_old_one() {
    let mut r = new(Layout::Bits16);
    let [hall, _] = pair(2);
    let [_, gaps] = pair(18);
    r.take(&hall, 4_000);
    let taken = r.take(&gaps, 36_000);
    let partial = taken.tick.expect("the old tick, without the new codes");
    assert_eq!(codes(&partial), (raw(2).hall, [MISSING_CODE; 3]));
}

#[test]
fn sixteen_lost_ticks_are_known_from_the_time_frame() {
    let mut r = new(Layout::Bits16);
    for sequence in 12..18 {
        feed(&mut r, Layout::Bits16, sequence);
    }
    // 18 to 33 are lost: the counter goes on as if nothing had happened.
    let mut lost = 0;
    for sequence in 34..50 {
        for frame in frames(Layout::Bits16, &raw(sequence)) {
            if let Some(BusFault::TicksLost { ticks }) =
                r.take(&BusFrame::from(frame), sequence * 2000).fault
            {
                lost += ticks;
            }
        }
    }
    assert_eq!(lost, 16);
    // Receiver's numbers again run with the sender's.
    assert_eq!(feed(&mut r, Layout::Bits16, 50).0, Some(raw(50)));
}

#[test]
fn a_sender_that_starts_again_is_used_from_its_second_frame_on() {
    let mut r = new(Layout::Bits16);
    for sequence in 20..39 {
        feed(&mut r, Layout::Bits16, sequence);
    }
    let mut whole = [false; 20];
    let mut restarted = false;
    for sequence in 0..20u32 {
        for frame in frames(Layout::Bits16, &raw(sequence)) {
            let taken = r.take(&BusFrame::from(frame), 100_000 + sequence * 2_000);
            restarted |= taken.fault == Some(BusFault::SenderRestarted);
            let ticks = taken.tick.filter(|t| codes(t) == codes(&raw(sequence)));
            whole[sequence as usize] |= ticks.is_some();
        }
    }
    assert!(!whole[0] && whole[1..].iter().all(|w| *w), "{whole:?}");
    assert!(restarted);
}

#[test]
fn a_remote_frame_a_short_one_and_a_foreign_one_give_no_tick() {
    let mut r = new(Layout::Bits16);
    let (message, id) = (Message::Hall, Message::Hall.id());
    let remote = BusFrame::new_remote(id, 8).expect("eight");
    let short = BusFrame::new(id, &[0; 7]).expect("seven");
    for (frame, bytes) in [(remote, 0), (short, 7)] {
        let fault = Some(BusFault::WrongLength { message, bytes });
        assert_eq!(r.take(&frame, 0), Taken { tick: None, fault });
    }
    for foreign in [
        BusFrame::new(embedded_can::StandardId::ZERO, &[0; 8]),
        BusFrame::new(embedded_can::ExtendedId::ZERO, &[0; 8]),
        BusFrame::new(Message::HallAb24.id(), &[0; 8]),
    ] {
        assert_eq!(r.take(&foreign.expect("eight"), 0), Taken::NOTHING);
    }
}

const WARM: [i32; 2] = [21_500, -3];

/// Feeds these ticks of a node with thermometers; gives the temperatures of the last tick.
fn temperatures(
    (sender, r): &mut (TemperatureSender, SensorReceiver),
    ticks: core::ops::Range<u32>,
    sends: bool,
) -> [i32; 2] {
    let mut last = [0; 2];
    for sequence in ticks {
        let tick = raw(sequence).with_temperature_mc(WARM);
        if let Some(frame) = sends.then(|| sender.frame(&tick)).flatten() {
            assert_eq!(r.take(&BusFrame::from(frame), 2_000 * sequence).fault, None);
        }
        let (tick, _) = feed(r, Layout::Bits16, sequence);
        last = tick.expect("whole").temperature_mc;
    }
    last
}

#[test]
fn temperatures_hold_from_the_tick_before_which_they_came() {
    let mut r = (TemperatureSender::START, new(Layout::Bits16));
    assert_eq!(temperatures(&mut r, 100..101, false), [MISSING_CODE; 2]);
    assert_eq!(temperatures(&mut r, 101..102, true), WARM);
    assert_eq!(temperatures(&mut r, 102..260, false), WARM);
}

#[test]
fn temperatures_are_forgotten_when_none_come_or_the_node_is_silent() {
    let mut r = (TemperatureSender::START, new(Layout::Bits16));
    assert_eq!(temperatures(&mut r, 100..101, true), WARM);
    // 350 ms, and up to 16 ticks until the next time frame.
    assert_eq!(temperatures(&mut r, 101..292, false), [MISSING_CODE; 2]);
    assert_eq!(temperatures(&mut r, 292..293, true), WARM);
    r.1.poll(293 * 2_000 + 2_000);
    assert!(r.1.is_stale());
    assert_eq!(temperatures(&mut r, 295..296, false), [MISSING_CODE; 2]);
}

#[test]
fn a_delayed_frame_is_late_and_its_codes_are_not_used() {
    let mut r = new(Layout::Bits16);
    feed(&mut r, Layout::Bits16, 1);
    let [hall_2, gaps_2] = pair(2);
    let [hall_3, gaps_3] = pair(3);
    r.take(&hall_2, 4_000);
    assert!(r.take(&hall_3, 6_000).tick.is_some());
    let message = Message::Capacitive;
    let late = r.take(&gaps_2, 6_010);
    assert_eq!(late.fault, Some(BusFault::Late { message }));
    let taken = r.take(&gaps_3, 6_020);
    assert_eq!((taken.tick, taken.fault), (Some(raw(3)), None));
}

#[test]
fn frames_of_a_tick_may_come_in_any_order() {
    let mut r = new(Layout::Bits16);
    for sequence in 1..40 {
        let [hall, gaps] = pair(sequence);
        assert_eq!(r.take(&gaps, sequence * 2000), Taken::NOTHING);
        let tick = r.take(&hall, sequence * 2000).tick;
        assert_eq!(tick, Some(raw(sequence)));
    }
}
