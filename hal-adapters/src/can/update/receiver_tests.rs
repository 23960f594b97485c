extern crate std;

use super::super::{MemoryStore, Running, TAG_BYTES, TAG_INDEX, tag};
use super::*;
use crate::can::command::{Command, Mailbox, Request, Told};
use crate::can::service::{Service, Updates};
use crate::can::{BusFrame, Coded};
use crate::fault::Random;
use embedded_can::Frame;
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
    random: Random,
}

/// Every write must be of a sound blob of this stage, under a newer number; `expected` is what
/// may be written at all.
struct Watched {
    inner: MemoryStore,
    expected: Option<Vec<u8>>,
    room: bool,
    fails: bool,
}

impl Store for Watched {
    fn running(&self) -> Option<Running<'_>> {
        self.inner.running()
    }

    fn newest_sequence(&self) -> u32 {
        self.inner.newest_sequence()
    }

    fn is_writable(&self) -> bool {
        !self.fails
    }

    fn has_room(&self) -> bool {
        self.room
    }

    fn has_previous(&self) -> bool {
        self.inner.has_previous()
    }

    fn write(&mut self, sequence: u32, change: Change<'_>) -> Written {
        assert_eq!(sequence, self.newest_sequence() + 1);
        match change {
            Change::Blob(blob) => {
                let set = ParameterSet::from_bytes(blob).expect("a sound blob");
                assert_eq!(set.serial, SERIAL);
                let expected = self.expected.as_deref();
                assert_eq!(blob, expected.expect("no write is expected"));
            }
            Change::Previous => assert!(self.has_previous()),
        }
        if self.fails {
            return Written::Failed;
        }
        self.inner.write(sequence, change)
    }
}

impl Bench {
    fn new(key: Option<Key>) -> Self {
        let identity = Identity {
            serial: Some(SERIAL),
            key,
            program_version: 0x010203,
            program_hash: 0xfeed,
        };
        Self {
            service: Service::new(TICKS_PER_S),
            receiver: Receiver::new(identity, TICKS_PER_S),
            store: Watched {
                inner: MemoryStore::holding(3, OLD).expect("a sound example"),
                expected: Some(NEW.to_vec()),
                room: true,
                fails: false,
            },
            host: Mailbox::default(),
            random: Random::new(1),
        }
    }

    fn take(&mut self, frame: &BusFrame) -> Option<Coded> {
        let word = |random: &mut Random| random.bits() as u32;
        let nonce = core::array::from_fn(|_| word(&mut self.random));
        let updates = Updates {
            receiver: &mut self.receiver,
            store: &mut self.store,
            nonce: Some(nonce),
        };
        let taken = self.service.take_updating(frame, None, Some(updates))?;
        taken.ok()?.answer
    }

    fn frame(&mut self, what: Told) -> BusFrame {
        BusFrame::from(self.host.send(&what).expect("a known message"))
    }

    fn ask(&mut self, request: Request, token: u8) -> (Outcome, u32) {
        let frame = self.frame(Told::Command(Command::new(request, token)));
        let answer = self.take(&frame).expect("an answer");
        match Mailbox::default().take(&BusFrame::from(answer)) {
            Some(Ok(Told::Answer(answer))) if answer.token == token => {
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
        assert_eq!(self.ask(off, 99), (Outcome::Done, 0));
    }

    fn data(&mut self, token: u8, index: u8, word: u32) {
        let data = UpdateData { token, index, word };
        let frame = self.frame(Told::UpdateData(data));
        assert_eq!(self.take(&frame), None);
    }

    fn blob(&mut self, token: u8, blob: &[u8]) {
        for index in (0..blob.len().div_ceil(4)).rev() {
            self.data(token, index as u8, word_of(blob, index).expect("within"));
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
            let word = word_of(&tag, index).expect("four words");
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
            self.service.before_tick(None, None);
            assert_eq!(self.service.tick(None), None);
            let servo_is_off = self.service.servo_is_off();
            answers.extend(self.receiver.tick(servo_is_off, &mut self.store));
        }
        answers
    }

    fn ends(&mut self, number: u8, token: u8, end: (Outcome, u32)) {
        assert_eq!(self.rest(), [answer(number, token, end)]);
    }

    /// Everything up to the verification, with the right tag for `sequence`.
    fn transfer(&mut self, token: u8, blob: &[u8], sequence: u32) {
        let bytes = blob.len() as u16;
        assert_eq!(self.update(UpdateRequest::Begin { bytes }, token), DONE);
        let nonce = self.nonce();
        self.blob(token, blob);
        if self.receiver.identity.key.is_some() {
            let incomplete = (Outcome::Incomplete, TAG_INDEX.into());
            assert_eq!(self.update(verify(sequence), token), incomplete);
        }
        self.tag(token, tag(&KEY, &nonce, sequence, blob));
    }
}

const DONE: (Outcome, u32) = (Outcome::Done, 0);
const STARTED: (Outcome, u32) = (Outcome::Started, 0);
const BEGIN: UpdateRequest = UpdateRequest::Begin {
    bytes: NEW.len() as u16,
};

const fn verify(sequence: u32) -> UpdateRequest {
    UpdateRequest::Verify { sequence }
}

const fn commit(sequence: u32) -> UpdateRequest {
    UpdateRequest::Commit { sequence }
}

#[test]
fn a_whole_update_with_a_key_is_stored_and_runs_after_the_reset() {
    let mut bench = Bench::new(Some(KEY));
    assert_eq!(bench.update(BEGIN, 7), (Outcome::ServoOn, 0));
    bench.servo_off();
    assert!(!bench.receiver.is_updating());
    bench.transfer(7, NEW, 4);
    assert!(bench.receiver.is_updating());
    assert_eq!(bench.update(commit(4), 7), (Outcome::NotAuthorised, 0));
    assert_eq!(bench.update(verify(4), 7), STARTED);
    assert_eq!(bench.update(verify(4), 7), STARTED);
    bench.ends(VERIFY, 7, DONE);
    assert_eq!(bench.update(verify(4), 7), DONE);
    assert_eq!(bench.update(commit(5), 7), (Outcome::Busy, 0));
    assert_eq!(bench.update(commit(4), 7), STARTED);
    assert_eq!(bench.update(commit(4), 7), STARTED);
    assert_eq!(bench.update(UpdateRequest::Abort, 7), (Outcome::Busy, 0));
    bench.ends(COMMIT, 7, DONE);
    assert_eq!(bench.update(commit(4), 7), DONE);
    assert!(!bench.receiver.is_updating());
    assert_eq!(bench.store.inner.newest(), Some(NEW));
    // It runs after the reset only.
    let tell = |page| UpdateRequest::Tell { page };
    assert_eq!(bench.update(tell(page::SEQUENCE), 8).1, 3);
    assert_eq!(bench.update(tell(page::NEWEST), 8).1, 4);
    assert_eq!(bench.update(UpdateRequest::Activate, 9), DONE);
    assert!(bench.receiver.wants_reset());
    bench.store.inner.reset();
    assert_eq!(bench.update(tell(page::SEQUENCE), 8).1, 4);
    // Back again: the record before, under a new number, authorised like any.
    bench.transfer(10, &[], 5);
    assert_eq!(bench.update(verify(5), 10), STARTED);
    bench.ends(VERIFY, 10, DONE);
    assert_eq!(bench.update(commit(5), 10), STARTED);
    bench.ends(COMMIT, 10, DONE);
    assert_eq!(bench.store.inner.newest(), Some(OLD));
    assert_eq!(bench.store.inner.writes(), 2);
}

#[test]
fn a_wrong_tag_a_second_guess_and_data_after_the_verification_store_nothing() {
    let mut bench = Bench::new(Some(KEY));
    bench.servo_off();
    bench.transfer(7, NEW, 4);
    bench.tag(7, tag(&KEY, &[0; 4], 4, NEW));
    assert_eq!(bench.update(verify(4), 7), STARTED);
    let refused = (Outcome::NotAuthorised, 0);
    bench.ends(VERIFY, 7, refused);
    // The transfer is closed; the answer is there for a host that lost it.
    assert_eq!(bench.update(verify(4), 7), refused);
    assert_eq!(bench.update(commit(4), 7), refused);
    // The tag of one sequence number is none of another.
    bench.transfer(8, NEW, 5);
    assert_eq!(bench.update(verify(5), 8), (Outcome::WrongSequence, 4));
    assert_eq!(bench.update(verify(4), 8), STARTED);
    bench.ends(VERIFY, 8, refused);
    // A verified transfer takes no more data.
    bench.transfer(9, NEW, 4);
    assert_eq!(bench.update(verify(4), 9), STARTED);
    bench.data(9, 20, 0);
    bench.ends(VERIFY, 9, DONE);
    bench.data(9, 21, 0);
    assert_eq!(bench.update(commit(4), 9), STARTED);
    bench.data(9, 140, 0);
    bench.ends(COMMIT, 9, DONE);
    assert_eq!(bench.store.inner.newest(), Some(NEW));
    assert_eq!(bench.store.inner.writes(), 1);
}

#[test]
fn without_a_nonce_nobody_is_authorised() {
    let mut bench = Bench::new(Some(KEY));
    bench.servo_off();
    let around = Surroundings {
        servo_is_off: true,
        store: &mut bench.store,
        nonce: None,
    };
    assert_eq!(bench.receiver.obey(7, BEGIN, around), DONE);
    bench.blob(7, NEW);
    bench.tag(7, tag(&KEY, &[0; 4], 4, NEW));
    assert_eq!(bench.update(verify(4), 7), (Outcome::NotAuthorised, 0));
    assert!(bench.rest().is_empty() && !bench.receiver.is_updating());
}

#[test]
fn every_word_that_is_missing_is_asked_for() {
    let mut bench = Bench::new(None);
    bench.servo_off();
    assert_eq!(bench.update(BEGIN, 7), DONE);
    for missing in 0..NEW.len().div_ceil(4) {
        let incomplete = (Outcome::Incomplete, missing as u32);
        // Words beyond the blob, of the tag and of another transfer change nothing.
        bench.data(7, 147, 1);
        bench.data(7, TAG_INDEX, 1);
        bench.data(8, missing as u8, 1);
        assert_eq!(bench.update(verify(4), 7), incomplete);
        bench.data(7, missing as u8, word_of(NEW, missing).expect("within"));
    }
    assert_eq!(bench.update(verify(3), 7), (Outcome::WrongSequence, 4));
    assert_eq!(bench.update(verify(4), 7), STARTED);
    bench.ends(VERIFY, 7, DONE);
    bench.store.fails = true;
    assert_eq!(bench.update(commit(4), 7), STARTED);
    bench.ends(COMMIT, 7, (Outcome::StoreFailed, 0));
    assert_eq!(bench.store.inner.newest(), Some(OLD));
}

#[test]
fn a_damaged_blob_and_one_of_another_stage_are_refused_by_kind() {
    let mut damaged = NEW.to_vec();
    damaged[100] ^= 1;
    let mut other = ParameterSet::from_bytes(NEW).expect("sound");
    other.serial = "HS-0008".try_into().expect("short");
    let mut buffer = [0; MAX_BYTES];
    let other = other.to_bytes(&mut buffer).expect("room");
    for (blob, kind) in [(&damaged[..], 7), (other, 10)] {
        let mut bench = Bench::new(Some(KEY));
        bench.servo_off();
        bench.transfer(7, blob, 4);
        assert_eq!(bench.update(verify(4), 7), STARTED);
        bench.ends(VERIFY, 7, (Outcome::BadContent, kind));
        assert!(!bench.receiver.is_updating());
    }
    let mut bench = Bench::new(None);
    bench.servo_off();
    let long = UpdateRequest::Begin { bytes: 657 };
    assert_eq!(bench.update(long, 7), (Outcome::BadContent, 0));
    let back = UpdateRequest::Begin { bytes: 0 };
    assert_eq!(bench.update(back, 7), (Outcome::NoParameters, 0));
    bench.store.room = false;
    assert_eq!(bench.update(BEGIN, 7), (Outcome::NoRoom, 0));
    bench.store.fails = true;
    assert_eq!(bench.update(BEGIN, 7), (Outcome::StoreFailed, 0));
}

#[test]
fn a_second_host_is_told_busy_until_the_first_is_done_or_silent() {
    let mut bench = Bench::new(None);
    bench.servo_off();
    assert_eq!(bench.update(BEGIN, 7), DONE);
    bench.data(7, 0, 1);
    assert_eq!(bench.update(BEGIN, 7), DONE);
    for request in [
        BEGIN,
        verify(4),
        commit(4),
        UpdateRequest::Abort,
        UpdateRequest::Activate,
    ] {
        assert_eq!(bench.update(request, 8), (Outcome::Busy, 0), "{request:?}");
    }
    assert_eq!(bench.update(verify(4), 7), (Outcome::Incomplete, 1));
    // Five seconds after the last word of the first.
    assert!(bench.ticks(IDLE_S * TICKS_PER_S).is_empty());
    assert!(bench.receiver.is_updating());
    assert!(bench.ticks(1).is_empty());
    assert_eq!(bench.update(verify(4), 7), (Outcome::NoTransfer, 0));
    assert_eq!(bench.update(BEGIN, 8), DONE);
    assert_eq!(bench.update(UpdateRequest::Abort, 8), DONE);
    assert_eq!(bench.update(UpdateRequest::Abort, 8), DONE);
    assert_eq!(bench.update(commit(4), 8), (Outcome::NoTransfer, 0));
}

#[test]
fn a_servo_that_goes_on_ends_a_transfer_at_once() {
    let on = Request::ServoOff { seconds: 0 };
    for checks in [false, true] {
        let mut bench = Bench::new(Some(KEY));
        bench.servo_off();
        bench.transfer(7, NEW, 4);
        if checks {
            assert_eq!(bench.update(verify(4), 7), STARTED);
        }
        bench.ask(on, 50);
        let answers = bench.ticks(1);
        let want = answer(VERIFY, 7, (Outcome::ServoOn, 0));
        assert_eq!(answers, if checks { [want].to_vec() } else { Vec::new() });
        assert!(!bench.receiver.is_updating());
    }
    // What is being stored is stored: half a record helps nobody.
    let mut bench = Bench::new(Some(KEY));
    bench.servo_off();
    bench.transfer(7, NEW, 4);
    assert_eq!(bench.update(verify(4), 7), STARTED);
    bench.rest();
    assert_eq!(bench.update(commit(4), 7), STARTED);
    bench.ask(on, 50);
    bench.ends(COMMIT, 7, DONE);
}

#[test]
fn a_replayed_recording_of_an_update_stores_nothing() {
    for key in [Some(KEY), None] {
        let mut bench = Bench::new(key);
        bench.servo_off();
        bench.transfer(7, NEW, 4);
        bench.update(verify(4), 7);
        bench.rest();
        bench.update(commit(4), 7);
        bench.rest();
        assert_eq!(bench.store.inner.writes(), 1);
        // The same frames once more, to the same node: its counters go on, and nothing else counts.
        bench.store.expected = None;
        let nonce = [1, 2, 3, 4];
        for sequence in [4, 5] {
            assert_eq!(bench.update(BEGIN, 7), DONE);
            bench.blob(7, NEW);
            bench.tag(7, tag(&KEY, &nonce, sequence, NEW));
            if key.is_none() && sequence == 5 {
                break; // Without a key whoever can send may update.
            }
            let outcome = bench.update(verify(sequence), 7);
            let answers = bench.rest();
            match sequence {
                4 => assert_eq!((outcome, answers.len()), ((Outcome::WrongSequence, 5), 0)),
                _ => assert_eq!(answers, [answer(VERIFY, 7, (Outcome::NotAuthorised, 0))]),
            }
            bench.update(commit(sequence), 7);
            bench.update(UpdateRequest::Abort, 7);
            bench.rest();
        }
        assert_eq!(bench.store.inner.writes(), 1);
    }
}

#[test]
fn every_page_tells_what_runs() {
    let mut bench = Bench::new(Some(KEY));
    let set = ParameterSet::from_bytes(OLD).expect("sound");
    let tell = |bench: &mut Bench, page| bench.update(UpdateRequest::Tell { page }, page);
    let crc = OLD.last_chunk().copied().map(u32::from_le_bytes);
    for (page, want) in [
        (page::PLACE, u32::from(set.fit.forced) << 8),
        (page::SEQUENCE, 3),
        (page::CRC, crc.expect("a blob")),
        (page::LENGTH, OLD.len() as u32),
        (page::RMS + 2, set.fit.rms[2].to_bits()),
        (page::PEAK, set.fit.peak[0].to_bits()),
        (page::PROGRAM_VERSION, 0x010203),
        (page::PROGRAM_HASH, 0xfeed),
        (page::LAST_UPDATE, 0x1ff),
        (page::NEWEST, 3),
    ] {
        assert_eq!(tell(&mut bench, page), (Outcome::Done, want), "page {page}");
    }
    let created: Vec<u8> = (page::CREATED..page::RMS)
        .flat_map(|page| tell(&mut bench, page).1.to_le_bytes())
        .collect();
    let text = set.created.as_bytes();
    assert!(created.starts_with(text) && created[text.len()..].iter().all(|&byte| byte == 0));
    let serial = u32::from_le_bytes(*b"HS-0");
    assert_eq!(tell(&mut bench, page::SERIAL).1, serial);
    assert_eq!(tell(&mut bench, page::COUNT), (Outcome::UnknownCommand, 0));
    let read: Vec<u8> = (0..OLD.len().div_ceil(4))
        .flat_map(|index| {
            let index = index as u8;
            bench
                .update(UpdateRequest::ReadBack { index }, index)
                .1
                .to_le_bytes()
        })
        .collect();
    assert_eq!(&read[..OLD.len()], OLD);
    let beyond = UpdateRequest::ReadBack { index: 255 };
    assert_eq!(bench.update(beyond, 1), (Outcome::UnknownCommand, 0));
    bench.store.inner = MemoryStore::default();
    assert_eq!(tell(&mut bench, page::PLACE), (Outcome::NoParameters, 0));
    assert_eq!(tell(&mut bench, page::NEWEST), DONE);
    assert_eq!(bench.update(beyond, 1), (Outcome::NoParameters, 0));
}

#[path = "fuzz_tests.rs"]
mod fuzz;
