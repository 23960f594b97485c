//! When the servo counts as off: by the line, and by the key.

extern crate std;

use super::*;
use crate::records::{Choice, Loaded, Records};
use crate::store::flash_model::FlashModel;
use crate::store::tests::blob;
use hal_adapters::can::BusFrame;
use hal_adapters::can::command::{Command, Mailbox, Outcome, Request};
use hal_adapters::can::update::{Key, TAG_INDEX, UpdateData, UpdateRequest, tag};
use std::boxed::Box;
use std::vec::Vec;

/// The random number of every challenge.
const NONCE: Nonce = [1, 2, 3, 4];

fn loaded() -> &'static Loaded {
    let mut flash = FlashModel::erased();
    flash.load(0, &blob(0));
    let (mut records, _) = Records::start(flash, Choice::Newest, None);
    let place = Box::leak(Box::new(core::mem::MaybeUninit::uninit()));
    records.load(Choice::Newest, place).expect("a sound slot")
}

/// Sends a frame. Returns the outcomes that the node answers.
fn send(node: &mut Node<'_>, content: Content) -> Vec<Outcome> {
    let coded = Mailbox::default().send(&content).expect("a frame");
    let mut outbox = Outbox::new();
    let (mut records, _) = Records::start(FlashModel::erased(), Choice::Newest, None);
    let frame = BusFrame::from(coded);
    node.take(&frame, &mut outbox, &mut records, Some(NONCE));
    let mut host = Mailbox::default();
    core::iter::from_fn(|| outbox.pop())
        .filter_map(|coded| match host.take(&BusFrame::from(coded))?.ok()? {
            Content::Answer(answer) => answer.outcome,
            _ => None,
        })
        .collect()
}

/// Sends a request, with the tag by this key if there is one.
fn ask(node: &mut Node<'_>, request: Request, token: u8, key: Option<Key>) -> Vec<Outcome> {
    let command = Command::new(request, token);
    if let Some(key) = key {
        let challenge = Request::Update(UpdateRequest::Challenge { part: 0 });
        send(node, Content::Command(Command::new(challenge, token)));
        let tag = tag(&key, &NONCE, &command, &[]);
        for (index, word) in (TAG_INDEX..).zip(tag.as_chunks().0) {
            let word = u32::from_le_bytes(*word);
            send(node, Content::UpdateData(UpdateData { token, index, word }));
        }
    }
    send(node, Content::Command(command))
}

/// The line must say off. Without a line the key must stand in for it; without both nothing moves the pose.
#[test]
fn the_servo_counts_as_on_unless_the_line_says_off_or_a_key_stands_in_for_it() {
    let key = Some([7; 16]);
    for (line, key, outcome) in [
        (Some(true), None, Outcome::Done),
        (Some(true), key, Outcome::Done),
        (Some(false), key, Outcome::ServoOn),
        (None, key, Outcome::Done),
        (None, None, Outcome::ServoOn),
    ] {
        let parameters = Parameters::at_start(Some(loaded()), None, None, true);
        let identity = Identity {
            serial: None,
            key,
            program_version: 1,
        };
        let mut node = Node::new(parameters, false, Layout::Bits24, identity);
        let facts = Facts {
            servo_off_pin: line,
            ..Facts::default()
        };
        let frame = RawFrame::new([100, 200, 300], [10, 20, 30], 0, 0);
        node.tick(Ok(frame), &facts, &mut Outbox::new());
        ask(&mut node, Request::ServoOff { seconds: 9 }, 1, key);
        let answered = ask(&mut node, Request::ClearZero, 2, key);
        assert_eq!(answered, [outcome], "{line:?} {key:?}");
    }
}
