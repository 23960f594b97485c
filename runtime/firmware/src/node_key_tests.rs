//! When the servo counts as off: by the line, and by the key.

use super::*;
use hal_adapters::can::update::{Key, TAG_INDEX, UpdateData, UpdateRequest, tag};

/// The same with the tag by this key, where there is one.
fn ask_tagged(node: &mut Node<'_>, request: Request, token: u8, key: Option<Key>) -> Vec<Content> {
    if let Some(key) = key {
        ask(
            node,
            Request::Update(UpdateRequest::Challenge { part: 0 }),
            token,
        );
        let command = Command::new(request, token);
        let tag = tag(&key, &NONCE, &command, &[]);
        let mut host = Mailbox::default();
        for (index, word) in (TAG_INDEX..).zip(tag.as_chunks().0) {
            let word = u32::from_le_bytes(*word);
            let coded = host.send(&Content::UpdateData(UpdateData { token, index, word }));
            let frame = BusFrame::from(coded.expect("a word"));
            take(node, &frame, &mut Outbox::new());
        }
    }
    ask(node, request, token)
}

/// The line must say so; without a line, the key must, and without both nothing moves the pose.
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
        let loaded = loaded();
        let parameters = Parameters::at_start(Some(loaded), None, None, true);
        let identity = Identity { key, ..IDENTITY };
        let mut node = Node::new(parameters, false, Layout::Bits24, identity);
        let facts = Facts {
            servo_off_pin: line,
            ..Facts::default()
        };
        let mut outbox = Outbox::new();
        node.tick(Ok(frame(0)), &facts, &mut Disturbed::default(), &mut outbox);
        ask_tagged(&mut node, Request::ServoOff { seconds: 9 }, 1, key);
        let contents = ask_tagged(&mut node, Request::ClearZero, 2, key);
        let answered = contents.iter().find_map(|content| match content {
            Content::Answer(answer) => answer.outcome,
            _ => None,
        });
        assert_eq!(answered, Some(outcome), "{line:?} {key:?}");
    }
}
