//! The SocketCAN adapter on a real interface: `tests/vcan` runs these on the virtual interface
//! `CAN_TEST_INTERFACE`.
#![cfg(target_os = "linux")]

use hal_adapters::can::{
    BusFrame, Layout, Message, NodeNumber, SensorReceiver, StampedFrame, Timing, sensor,
};
use hal_adapters::socketcan::{SocketCan, SocketCanError};
use runtime::RawFrame;
use std::process::Command;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

const WAIT: Duration = Duration::from_millis(200);

fn now_us() -> u64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH);
    since.expect("after 1970").as_micros() as u64
}

fn interface() -> String {
    std::env::var("CAN_TEST_INTERFACE").expect("run tests/vcan")
}

fn open(messages: &[Message]) -> SocketCan {
    SocketCan::open(&interface(), NodeNumber::default(), messages).expect("the interface is up")
}

fn run(command: &str) {
    let status = Command::new("sh").args(["-c", command]).status();
    assert!(status.expect("sh runs").success(), "{command}");
}

fn tick(n: u32) -> RawFrame {
    let code = (n % 30_000) as i32;
    RawFrame::new([code, -code, 1], [2, 3, code], n, n.wrapping_mul(2_000))
}

fn traffic(layout: Layout, ticks: u32) -> Vec<BusFrame> {
    (0..ticks)
        .flat_map(|n| sensor::frames(layout, &tick(n)))
        .map(BusFrame::from)
        .collect()
}

/// A receiver that is patient with a busy machine.
fn receiver(layout: Layout) -> SensorReceiver {
    let timing = Timing {
        assembly_us: 500_000,
        stale_us: 2_000_000,
    };
    SensorReceiver::new(layout, timing)
}

/// Reads everything that is there.
fn drain(bus: &mut SocketCan) -> Vec<StampedFrame> {
    let mut all = Vec::new();
    while let Some(frame) = bus.receive(Duration::from_millis(20)).expect("up") {
        all.push(frame);
    }
    all
}

#[test]
#[ignore = "needs a CAN interface: run tests/vcan"]
fn what_is_sent_is_received_in_order_with_its_time() {
    for layout in [Layout::Bits16, Layout::Bits24] {
        let mut messages = layout.messages().to_vec();
        messages.push(Message::SensorTime);
        let (sender, mut bus) = (open(&[]), open(&messages));
        let sent = traffic(layout, 1_000);
        let before_us = now_us();
        for frame in &sent {
            sender.send(frame, WAIT).expect("room");
        }
        let after_us = now_us();
        let got = drain(&mut bus);
        let frames: Vec<_> = got.iter().map(|f| f.frame).collect();
        assert_eq!(frames, sent);
        assert!(got.is_sorted_by_key(|f| f.time_us));
        assert!(
            got.iter()
                .all(|f| (before_us..=after_us).contains(&f.time_us))
        );
        let mut receiver = receiver(layout);
        let ticks: Vec<_> = got
            .iter()
            .filter_map(|f| receiver.take(&f.frame, f.time_us as u32).tick)
            .map(|t| (t.hall, t.capacitive, t.sequence))
            .collect();
        let want = (0..1_000).map(tick);
        let want: Vec<_> = want.map(|t| (t.hall, t.capacitive, t.sequence)).collect();
        assert_eq!(ticks, want);
    }
}

#[test]
#[ignore = "needs a CAN interface: run tests/vcan"]
fn frames_that_nobody_reads_in_time_are_counted_and_seen_as_lost() {
    let (sender, mut bus) = (open(&[]), open(Layout::Bits16.messages()));
    let sent = traffic(Layout::Bits16, 60_000);
    for frame in &sent {
        sender.send(frame, WAIT).expect("room");
    }
    let dropped = bus.dropped();
    assert!(dropped > 0);
    let mut receiver = receiver(Layout::Bits16);
    let mut last = None;
    let mut got = 0;
    for frame in drain(&mut bus) {
        got += 1;
        let taken = receiver.take(&frame.frame, frame.time_us as u32);
        last = taken.tick.map(|t| t.sequence).or(last);
    }
    let codes = sent
        .iter()
        .filter(|f| f.id != Message::SensorTime.id().into());
    assert_eq!(got + dropped as usize, codes.count());
    // The frames after the gap show it.
    for frame in traffic(Layout::Bits16, 60_003).iter().rev().take(6).rev() {
        sender.send(frame, WAIT).expect("room");
    }
    let faults: Vec<_> = drain(&mut bus)
        .iter()
        .filter_map(|f| receiver.take(&f.frame, f.time_us as u32).fault)
        .collect();
    assert!(last.is_some() && !faults.is_empty(), "{last:?}");
}

#[test]
#[ignore = "needs a CAN interface: run tests/vcan"]
fn a_full_transmit_queue_is_waited_for_until_the_deadline() {
    let name = interface();
    let bus = open(&[]);
    let [frame, _] = sensor::frames_16(&tick(1)).map(BusFrame::from);
    // A queue that takes no frame at all.
    run(&format!("tc qdisc add dev {name} root bfifo limit 1"));
    let started = Instant::now();
    let refused = bus.send(&frame, Duration::from_millis(50));
    let waited = started.elapsed();
    let freed = std::thread::spawn(move || {
        std::thread::sleep(Duration::from_millis(100));
        run(&format!("tc qdisc del dev {name} root"));
    });
    let sent = bus.send(&frame, Duration::from_secs(10));
    freed.join().expect("tc");
    assert!(
        matches!(refused, Err(SocketCanError::QueueFull { .. })),
        "{refused:?}"
    );
    assert!(waited >= Duration::from_millis(50));
    sent.expect("sent once there is room");
}
