use super::*;
use hal_adapters::can::command::{Mailbox, Outcome, Request};
use hal_adapters::can::{BusFrame, PoseReceiver, sensor};
use runtime::AnyDecoder;

const SETTINGS: NodeSettings = NodeSettings {
    layout: Layout::Bits16,
    timing: Timing {
        assembly_us: 1_000,
        stale_us: 3_000,
    },
    on_invalid: OnInvalid::Zero,
};

fn decoder() -> AnyDecoder {
    let blob = include_bytes!("../../../../runtime/examples/stage.bin");
    let set = runtime::ParameterSet::from_bytes(blob).expect("sound");
    set.decoder()
}

fn raw(sequence: u32) -> RawFrame {
    let code = (sequence % 1000) as i32;
    RawFrame::new(
        [code, 2 * code - 500, -code],
        [10, -code / 2, 30],
        sequence,
        sequence * 2_000,
    )
}

fn stamped(coded: Coded, time_us: u64) -> StampedFrame {
    StampedFrame {
        time_us,
        frame: BusFrame::from(coded),
    }
}

/// Feeds one tick; gives what the node sent.
fn feed(node: &mut Node, frame: &RawFrame) -> Vec<Coded> {
    let mut out = Vec::new();
    for coded in sensor::frames(Layout::Bits16, frame) {
        node.take(&stamped(coded, u64::from(frame.time_us)), &mut out);
    }
    out
}

fn contents(node_sent: &[Coded], mailbox: &mut Mailbox) -> Vec<Content> {
    let frames = node_sent.iter().map(|c| BusFrame::from(*c));
    frames
        .filter_map(|f| mailbox.take(&f)?.ok())
        .filter(|t| !matches!(t, Content::Status(_) | Content::Health(_)))
        .collect()
}

#[test]
fn a_silent_bus_is_published_as_invalid_until_frames_come_again() {
    let decoder = decoder();
    let mut node = Node::new(decoder, &SETTINGS);
    feed(&mut node, &raw(1));
    let mut out = Vec::new();
    assert_eq!(node.patience_us(4_500), Some(500));
    node.poll(4_500, &mut out);
    assert!(out.is_empty());
    let step = node.poll(5_000, &mut out);
    assert!(matches!(step.fault, Some(BusFault::Stale { .. })));
    let mut receiver = PoseReceiver::new(SETTINGS.timing);
    let got = out
        .iter()
        .find_map(|c| receiver.take(&BusFrame::from(*c), 0).tick);
    assert_eq!(got.and_then(|pose| pose.valid()), None);
    assert!(got.is_some_and(|pose| pose.status.any(Status::FRAMES_MISSED)));
    assert!(!feed(&mut node, &raw(2)).is_empty());
    assert!(!node.receiver().is_stale());
}

/// The service has its own tests; this test shows that the node uses it.
#[test]
fn a_re_zero_at_rest_is_done_while_the_servo_is_off() {
    let decoder = decoder();
    let mut node = Node::new(decoder, &SETTINGS);
    let (mut host, mut out) = (Mailbox::default(), Vec::new());
    for (token, request) in (1..).zip([
        Request::Rezero { ticks: 250 },
        Request::ServoOff { seconds: 1 },
        Request::Rezero { ticks: 250 },
    ]) {
        let command = Content::Command(Command::new(request, token));
        let frame = host.send(&command).expect("known");
        node.take(&stamped(frame, 0), &mut out);
    }
    for sequence in 1..260 {
        let rest = RawFrame {
            hall: [400, -100, 200],
            ..raw(sequence)
        };
        out.extend(feed(&mut node, &rest));
    }
    let outcome = |content| match content {
        Content::Answer(answer) => answer.outcome.map(|outcome| (answer.token, outcome)),
        other => panic!("{other:?}"),
    };
    let outcomes: Vec<_> = contents(&out, &mut host).into_iter().map(outcome).collect();
    let want = [
        (1, Outcome::ServoOn),
        (2, Outcome::Done),
        (3, Outcome::Started),
        (3, Outcome::Done),
    ];
    assert_eq!(outcomes, want.map(Some));
    assert!(node.tracker().zero().x_m != 0.0);
}
