//! What one host does: stored, refused, told.

use super::*;

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
    bench.ends(VERIFY, 7, NEW_DONE);
    assert_eq!(bench.update(verify(4), 7), NEW_DONE);
    assert_eq!(bench.update(commit(5), 7), (Outcome::Busy, 0));
    assert_eq!(bench.update(commit(4), 7), STARTED);
    assert_eq!(bench.update(commit(4), 7), STARTED);
    assert_eq!(bench.update(UpdateRequest::Abort, 7), (Outcome::Busy, 0));
    bench.ends(COMMIT, 7, NEW_DONE);
    assert_eq!(bench.update(commit(4), 7), NEW_DONE);
    assert!(!bench.receiver.is_updating());
    assert_eq!(bench.store.inner.newest_blob(), Some(NEW));
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
    let old_done = (Outcome::Done, crc_of(OLD).expect("a blob"));
    bench.ends(VERIFY, 10, old_done);
    assert_eq!(bench.update(commit(5), 10), STARTED);
    bench.ends(COMMIT, 10, old_done);
    assert_eq!(bench.store.inner.newest_blob(), Some(OLD));
    assert_eq!(bench.store.inner.writes(), 2);
}

#[test]
fn every_word_that_is_missing_is_asked_for() {
    let mut bench = Bench::new(None);
    bench.servo_off();
    assert_eq!(bench.update(BEGIN, 7), BEGUN);
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
    bench.ends(VERIFY, 7, NEW_DONE);
    bench.store.fails = true;
    assert_eq!(bench.update(commit(4), 7), STARTED);
    bench.ends(COMMIT, 7, (Outcome::StoreFailed, 0));
    assert_eq!(bench.store.inner.newest_blob(), Some(OLD));
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
    let long = UpdateRequest::begin(657, 0);
    assert_eq!(bench.update(long, 7), (Outcome::BadContent, 0));
    let back = UpdateRequest::begin(0, 0);
    assert_eq!(bench.update(back, 7), (Outcome::NoParameters, 0));
    bench.store.room = false;
    assert_eq!(bench.update(BEGIN, 7), (Outcome::NoRoom, 0));
    bench.store.fails = true;
    assert_eq!(bench.update(BEGIN, 7), (Outcome::StoreFailed, 0));
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
    bench.ends(COMMIT, 7, NEW_DONE);
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
        (page::NEXT, 3),
        (page::NEXT + 1, crc.expect("a blob")),
    ] {
        assert_eq!(tell(&mut bench, page), (Outcome::Done, want), "page {page}");
    }
    let none = (Outcome::NoParameters, 0);
    assert_eq!(tell(&mut bench, page::PREVIOUS), none);
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
    assert_eq!(tell(&mut bench, page::PLACE), none);
    assert_eq!(tell(&mut bench, page::NEXT), none);
    assert_eq!(tell(&mut bench, page::NEWEST), DONE);
    assert_eq!(bench.update(beyond, 1), (Outcome::NoParameters, 0));
}
