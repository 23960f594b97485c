use super::super::frame::BusFrame;
use super::*;
use proptest::prelude::*;

#[test]
fn a_request_worked_by_hand() {
    let command = Command::new(Request::Rezero { ticks: 500 }, 0xa7);
    let payload = Payload::new(0xa71, 500);
    assert_eq!(command.payload(), payload);
    assert_eq!(Command::from_payload(payload), command);
}

#[test]
fn an_argument_that_does_not_fit_is_an_unknown_request() {
    let read = |short, long| Command::from_payload(Payload { short, long }).request;
    assert_eq!(read(1, 65536), None);
    assert_eq!(read(2, 256), None);
    assert_eq!(read(3, 1), None);
    assert_eq!(read(4, 2), None);
    assert_eq!(read(5, 256), None);
    assert_eq!(read(6, 4), None);
    assert_eq!(read(7, 65536), None);
    assert_eq!(read(10, 1), None);
    assert_eq!(read(12, 0), None);
    assert_eq!(read(15, 0), None);
    assert_eq!(read(2, 255), Some(Request::Identify { seconds: 255 }));
}

#[test]
fn a_mailbox_reads_what_another_sent_and_refuses_a_repeat() {
    let (mut host, mut node) = (Mailbox::default(), Mailbox::default());
    let command = Content::Command(Command::new(Request::Identify { seconds: 3 }, 9));
    let frame = BusFrame::from(host.send(&command).expect("known"));
    assert_eq!(node.take(&frame), Some(Ok(command)));
    let message = Message::Command;
    assert_eq!(node.take(&frame), Some(Err(BusFault::Repeated { message })));
    let again = BusFrame::from(host.send(&command).expect("known"));
    assert_eq!(node.take(&again), Some(Ok(command)));
    let damaged = again.flipped(1 << 40);
    let fault = BusFault::WrongCheck { message };
    assert_eq!(node.take(&damaged), Some(Err(fault)));
    let fault = BusFault::WrongLength { message, bytes: 7 };
    assert_eq!(
        node.take(&BusFrame::new(again.id(), &again.data()[..7]).expect("shorter")),
        Some(Err(fault))
    );
}

#[test]
fn every_request_comes_back_as_sent() {
    for request in [
        Request::Rezero { ticks: 65535 },
        Request::Identify { seconds: 255 },
        Request::ClearZero,
        Request::Record { on: true },
        Request::Record { on: false },
        Request::ServoOff { seconds: 255 },
        Request::Update(UpdateRequest::Challenge { part: 3 }),
        Request::Update(UpdateRequest::Begin { bytes: 656 }),
        Request::Update(UpdateRequest::Commit { sequence: 7 }),
        Request::Update(UpdateRequest::Abort),
        Request::Update(UpdateRequest::Activate),
        Request::Update(UpdateRequest::ReadBack { index: 163 }),
        Request::Update(UpdateRequest::Tell { page: 21 }),
    ] {
        let sent = Command::new(request, 7);
        assert_eq!(Command::from_payload(sent.payload()), sent);
    }
}

proptest! {
    #[test]
    fn answers_come_back_as_sent(number in 0u8..16, token: u8, outcome in 0usize..Outcome::ALL.len(), detail: u32) {
        let sent = Answer { number, token, outcome: Some(Outcome::ALL[outcome]), detail };
        prop_assert_eq!(Answer::from_payload(sent.payload()), sent);
    }
}
