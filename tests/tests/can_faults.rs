//! Every fault of a bus is noticed within one tick, wherever it falls, and no whole tick has codes that were not
//! sent.

use hal_adapters::can::{
    BusFrame, Layout, Message, SensorReceiver, StampedFrame, Taken, Timing, sensor,
};
use runtime::RawFrame;
use runtime::frame::MISSING_CODE;
use tests::fault::{Fault, damaged};
use tests::random::Random;

const PERIOD_US: u64 = 2_000;
/// From frame to frame at 1 Mbit/s.
const FRAME_US: u64 = 135;
const LAYOUTS: [Layout; 2] = [Layout::Bits16, Layout::Bits24];

fn tick(n: u32) -> RawFrame {
    RawFrame::new(
        [n as i32 % 1000, 2, 3],
        [4, 5, n as i32 % 777],
        n,
        n * 2_000,
    )
}

/// The frames of ticks `first` to `last` as a bus carries them.
fn traffic(layout: Layout, first: u32, last: u32) -> Vec<StampedFrame> {
    let mut all = Vec::new();
    for n in first..=last {
        let frames = sensor::frames(layout, &tick(n));
        for (k, frame) in (0u64..).zip(frames) {
            let time_us = u64::from(n) * PERIOD_US + k * FRAME_US;
            let frame = BusFrame::from(frame);
            all.push(StampedFrame { time_us, frame });
        }
    }
    all
}

fn is_whole(frame: &RawFrame) -> bool {
    let codes = frame.hall.iter().chain(&frame.capacitive);
    !codes.into_iter().any(|code| *code == MISSING_CODE)
}

/// When the receiver first reports anything but whole ticks in good order, asked every ms. The codes of every
/// whole tick, also after that, must be those of one tick from `first` on.
fn first_notice_us(
    layout: Layout,
    frames: &[StampedFrame],
    first: u32,
    end_us: u64,
) -> Option<u64> {
    let codes = |frame: &RawFrame| (frame.hall, frame.capacitive);
    let mut receiver = SensorReceiver::new(layout, Timing::default());
    let mut frames = frames.iter().peekable();
    let start_us = frames.peek()?.time_us;
    let mut noticed_us = None;
    let mut look = |taken: Taken<RawFrame>, at_us: u64| {
        let whole = taken.tick.filter(is_whole);
        let was_sent = |whole| (first..=first + 40).any(|n| codes(&tick(n)) == codes(&whole));
        assert!(whole.is_none_or(was_sent), "no such tick: {whole:?}");
        if taken.fault.is_some() || whole.is_none() && taken.tick.is_some() {
            noticed_us.get_or_insert(at_us);
        }
    };
    for now_us in (start_us..end_us).step_by(5) {
        while let Some(stamped) = frames.next_if(|f| f.time_us <= now_us) {
            look(
                receiver.take(&stamped.frame, stamped.time_us as u32),
                stamped.time_us,
            );
        }
        if now_us % 1_000 == 0 {
            look(receiver.poll(now_us as u32), now_us);
        }
    }
    noticed_us
}

/// Puts `fault` on frame `at`; gives the traffic and when the fault is there to be noticed.
fn with_fault(
    mut frames: Vec<StampedFrame>,
    at: usize,
    fault: Fault,
    random: &mut Random,
) -> (Vec<StampedFrame>, u64) {
    let hit = frames[at];
    match fault {
        Fault::Drop => {
            frames.remove(at);
        }
        Fault::Repeat => {
            let time_us = hit.time_us + 1 + random.below(PERIOD_US - 1);
            frames.push(StampedFrame { time_us, ..hit });
            frames.sort_by_key(|f| f.time_us);
            return (frames, time_us);
        }
        Fault::Swap => {
            // With the next frame of the same message: one tick on.
            let next = (at + 1..frames.len())
                .find(|k| frames[*k].frame.id == hit.frame.id)
                .expect("traffic goes on");
            let (a, b) = (frames[at].frame, frames[next].frame);
            frames[at].frame = b;
            frames[next].frame = a;
        }
        Fault::Delay => {
            // Later than a tick is collected, from the arrival of its first frame.
            let late = 1_000 + 3 * FRAME_US + random.below(9 * PERIOD_US);
            frames[at].time_us += late;
            frames.sort_by_key(|f| f.time_us);
        }
        _ => frames[at].frame = damaged(&hit.frame, fault, random),
    }
    (frames, hit.time_us)
}

#[test]
fn each_injected_fault_is_noticed_within_one_tick() {
    let mut random = Random::new(11);
    let mut worst_us = [0u64; 9];
    let mut trials = 0;
    for _ in 0..400 {
        for layout in LAYOUTS {
            for fault in Fault::ALL {
                if fault == Fault::Noise {
                    continue; // passes once in 256 times, as it must
                }
                let first = random.below(1 << 20) as u32;
                let frames = traffic(layout, first, first + 40);
                let at = frames
                    .iter()
                    .position(|f| f.time_us >= u64::from(first + 10) * PERIOD_US)
                    .expect("ten ticks on");
                let at = at + random.below(40) as usize;
                if frames[at].frame.id == Message::SensorTime.id().into() {
                    continue; // carries no codes
                }
                let (frames, fault_us) = with_fault(frames, at, fault, &mut random);
                let end_us = u64::from(first + 35) * PERIOD_US;
                let noticed_us = first_notice_us(layout, &frames, first, end_us);
                let noticed_us = noticed_us.unwrap_or_else(|| panic!("{fault:?} unnoticed"));
                assert!(noticed_us >= fault_us, "{fault:?} before it happened");
                let worst = &mut worst_us[fault as usize];
                *worst = (*worst).max(noticed_us - fault_us);
                trials += 1;
            }
        }
    }
    assert!(trials > 5_000);
    for (fault, worst) in Fault::ALL.iter().zip(worst_us) {
        println!("RESULT fault={fault:?} worst_notice_us={worst}");
        assert!(worst <= PERIOD_US, "{fault:?}: {worst} us");
    }
}
