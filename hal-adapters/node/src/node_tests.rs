//! When the servo counts as off.

extern crate std;

use super::*;
use crate::records::{Choice, Records};
use crate::store::flash_model::{FlashModel, slots};
use crate::store::tests::blob;
use hal_adapters::can::BusFrame;
use hal_adapters::can::command::{Command, Mailbox, Outcome, Request};
use std::vec::Vec;

fn loaded() -> AnyDecoder {
    let mut flash = FlashModel::erased();
    flash.load(0, &blob(0));
    let (mut records, _) = Records::start(slots(flash), Choice::Newest, None);
    records.load(Choice::Newest).expect("a sound slot")
}

/// Sends a request. Returns the outcomes that the node answers.
fn ask(node: &mut Node<'_>, request: Request, token: u8) -> Vec<Outcome> {
    let command = Content::Command(Command::new(request, token));
    let frame = BusFrame::from(Mailbox::default().send(&command).expect("a frame"));
    let mut outbox = Outbox::default();
    let (mut records, _) = Records::start(slots(FlashModel::erased()), Choice::Newest, None);
    node.take(&frame, &mut outbox, &mut records, None);
    let mut host = Mailbox::default();
    core::iter::from_fn(|| outbox.pop())
        .filter_map(|coded| match host.take(&BusFrame::from(coded))?.ok()? {
            Content::Answer(answer) => answer.outcome,
            _ => None,
        })
        .collect()
}

/// With a key the tag decides: see the tests of `hal_adapters::can::update`.
#[test]
fn without_a_key_the_servo_counts_as_on_unless_the_line_says_off() {
    for (line, outcome) in [
        (Some(true), Outcome::Done),
        (Some(false), Outcome::ServoOn),
        (None, Outcome::ServoOn),
    ] {
        let parameters = Parameters::at_start(Some(loaded()), None, None, true);
        let settings = Settings {
            identity: Identity::default(),
            period: Period::from_us(2000).expect("a period"),
            rezero_limits: ZeroOffsetSettings::default(),
        };
        let mut node = Node::new(parameters, false, Layout::Bits24, settings);
        let facts = Facts {
            servo_off_pin: line,
            ..Facts::default()
        };
        let frame = RawFrame::new([100, 200, 300], [10, 20, 30], 0, 0);
        node.tick(Ok(frame), &facts, &mut Outbox::default());
        ask(&mut node, Request::ServoOff { seconds: 9 }, 1);
        assert_eq!(ask(&mut node, Request::ClearZero, 2), [outcome], "{line:?}");
    }
}
