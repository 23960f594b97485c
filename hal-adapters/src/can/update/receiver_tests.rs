extern crate std;

use super::super::{BlobId, Key, Running, TAG_BYTES, TAG_INDEX, Updates, page, tag, word_at};
use super::*;
use crate::can::command::{Command, Content, Mailbox, Request};
use crate::can::service::Service;
use crate::can::{BusFrame, Coded, NodeNumber};
use std::vec::Vec;

const TICKS_PER_S: u32 = 500;
const KEY: Key = [0x5a; 16];
const OLD: &[u8] = include_bytes!("../../../../runtime/examples/stage.bin");
const NEW: &[u8] = include_bytes!("../../../../runtime/examples/field.bin");

/// The serial number that both examples carry.
const SERIAL: &str = "HS-0007";

/// A node with a store that asserts what it is given, and a host's mailbox.
struct Bench {
    service: Service,
    receiver: Receiver<'static>,
    store: Watched,
    host: Mailbox,
    nonce: u32,
}

/// Runs the old blob. Every write must be of the new blob under the next number.
struct Watched {
    runs: bool,
    newest: (u32, &'static [u8]),
    fails: Option<NotWritten>,
}

impl Store for Watched {
    fn running(&self) -> Option<Running<'_>> {
        let crc = blob_crc(OLD)?;
        self.runs.then_some(Running {
            id: BlobId { sequence: 3, crc },
            bytes: OLD.len() as u32,
            serial: SERIAL,
        })
    }

    fn word(&mut self, index: usize) -> Option<u32> {
        word_at(OLD, index).filter(|_| self.runs)
    }

    fn newest(&self) -> Option<BlobId> {
        let (sequence, blob) = self.newest;
        let crc = blob_crc(blob)?;
        Some(BlobId { sequence, crc })
    }

    fn newest_sequence(&self) -> u32 {
        self.newest.0
    }

    fn write(&mut self, sequence: u32, blob: &[u8]) -> Result<(), NotWritten> {
        assert_eq!((sequence, blob), (self.newest_sequence() + 1, NEW));
        self.fails.map_or(Ok(()), Err)?;
        self.newest = (sequence, NEW);
        Ok(())
    }
}

impl Bench {
    fn new(key: Option<&'static Key>) -> Self {
        let identity = Identity {
            serial: Some(SERIAL),
            key,
            program_version: 0x010203,
            ..Identity::default()
        };
        Self {
            service: Service::new(TICKS_PER_S),
            receiver: Receiver::new(identity, TICKS_PER_S),
            store: Watched {
                runs: true,
                newest: (3, OLD),
                fails: None,
            },
            host: Mailbox::default(),
            nonce: 0,
        }
    }

    fn take(&mut self, frame: &BusFrame) -> Option<Coded> {
        self.nonce += 1;
        let nonce = [self.nonce; 4];
        let mut updates = Updates {
            receiver: &mut self.receiver,
            store: &mut self.store,
            nonce: Some(nonce),
        };
        let taken =
            self.service
                .take(frame, None::<&mut runtime::PoseTracker>, Some(&mut updates))?;
        taken.ok()?.answer
    }

    fn frame(&mut self, what: Content) -> BusFrame {
        BusFrame::from(self.host.send(&what).expect("a known message"))
    }

    fn ask(&mut self, request: Request, token: u8) -> (Outcome, u32) {
        let frame = self.frame(Content::Command(Command::new(request, token)));
        let answer = self.take(&frame).expect("an answer");
        match Mailbox::default().take(&BusFrame::from(answer)) {
            Some(Ok(Content::Answer(answer))) if answer.token == token => {
                (answer.outcome.expect("a known one"), answer.detail)
            }
            other => panic!("{other:?}"),
        }
    }

    fn update(&mut self, request: UpdateRequest, token: u8) -> (Outcome, u32) {
        self.ask(Request::Update(request), token)
    }

    fn servo_off(&mut self) {
        let off = Request::ServoOff { seconds: 255 };
        assert_eq!(self.ask_tagged(off, 99), (Outcome::Done, 0));
    }

    /// Asks with the right tag, where the node has a key.
    fn ask_tagged(&mut self, request: Request, token: u8) -> (Outcome, u32) {
        if self.receiver.has_key() {
            let nonce = self.nonce();
            self.tag(
                token,
                tag(
                    &KEY,
                    NodeNumber::TABLE,
                    &nonce,
                    &Command::new(request, token),
                    &[],
                ),
            );
        }
        self.ask(request, token)
    }

    fn update_tagged(&mut self, request: UpdateRequest, token: u8) -> (Outcome, u32) {
        self.ask_tagged(Request::Update(request), token)
    }

    fn data(&mut self, token: u8, index: u8, word: u32) {
        let data = UpdateData { token, index, word };
        let frame = self.frame(Content::UpdateData(data));
        assert_eq!(self.take(&frame), None);
    }

    fn blob(&mut self, token: u8, blob: &[u8]) {
        for index in (0..blob.len().div_ceil(4)).rev() {
            self.data(token, index as u8, word_at(blob, index).expect("within"));
        }
    }

    fn nonce(&mut self) -> Nonce {
        core::array::from_fn(|part| {
            let part = part as u8;
            self.update(UpdateRequest::Challenge { part }, 200 + part).1
        })
    }

    fn tag(&mut self, token: u8, tag: [u8; TAG_BYTES]) {
        for index in 0..4 {
            let word = word_at(&tag, index).expect("four words");
            self.data(token, TAG_INDEX + index as u8, word);
        }
    }

    /// A second of ticks; every answer that comes.
    fn rest(&mut self) -> Vec<Answer> {
        self.ticks(TICKS_PER_S)
    }

    fn ticks(&mut self, ticks: u32) -> Vec<Answer> {
        let mut answers = Vec::new();
        for _ in 0..ticks {
            self.service
                .before_tick(None::<&mut runtime::PoseTracker>, None);
            assert_eq!(self.service.tick(None::<&runtime::PoseTracker>), None);
            let servo_is_off = self.service.servo_is_off();
            self.receiver.tick(servo_is_off);
            answers.extend(self.receiver.store(servo_is_off, &mut self.store));
        }
        answers
    }

    /// The end of what was committed.
    fn ends(&mut self, token: u8, (outcome, detail): (Outcome, u32)) {
        let end = Answer {
            number: COMMIT,
            token,
            outcome: Some(outcome),
            detail,
        };
        assert_eq!(self.rest(), [end]);
    }

    /// Everything up to the commit, with the right tag for `sequence`.
    fn transfer(&mut self, token: u8, blob: &[u8], sequence: u32) {
        let bytes = blob.len() as u16;
        assert_eq!(
            self.update_tagged(UpdateRequest::Begin { bytes }, token),
            DONE
        );
        let nonce = self.nonce();
        self.blob(token, blob);
        if self.receiver.identity.key.is_some() {
            let incomplete = (Outcome::Incomplete, TAG_INDEX.into());
            assert_eq!(self.update(commit(sequence), token), incomplete);
        }
        let command = Command::new(Request::Update(commit(sequence)), token);
        self.tag(token, tag(&KEY, NodeNumber::TABLE, &nonce, &command, blob));
    }
}

const DONE: (Outcome, u32) = (Outcome::Done, 0);
const STARTED: (Outcome, u32) = (Outcome::Started, 0);
const BEGIN: UpdateRequest = UpdateRequest::Begin {
    bytes: NEW.len() as u16,
};
const NEW_DONE: (Outcome, u32) = (Outcome::Done, NEW_CRC);
const NEW_CRC: u32 = match NEW {
    [.., a, b, c, d] => u32::from_le_bytes([*a, *b, *c, *d]),
    _ => 0,
};

const fn commit(sequence: u32) -> UpdateRequest {
    UpdateRequest::Commit { sequence }
}

#[path = "authority_tests.rs"]
mod authority;
#[path = "transfer_tests.rs"]
mod transfer;
