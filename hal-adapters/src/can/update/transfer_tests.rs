//! What one host does: stored, refused, answered.

use super::*;

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
        assert_eq!(bench.update(commit(4), 7), incomplete);
        bench.data(7, missing as u8, word_of(NEW, missing).expect("within"));
    }
    assert_eq!(bench.update(commit(3), 7), (Outcome::WrongSequence, 4));
    assert_eq!(bench.update(commit(4), 7), STARTED);
    bench.ends(7, NEW_DONE);
}

#[test]
fn what_cannot_be_stored_is_refused_by_kind() {
    let mut damaged = NEW.to_vec();
    damaged[100] ^= 1;
    let mut other = ParameterSet::from_bytes(NEW).expect("sound");
    other.serial = "HS-0008".try_into().expect("short");
    let mut buffer = [0; MAX_BYTES];
    let other = other.to_bytes(&mut buffer).expect("room");
    for (blob, fails, end) in [
        (&damaged[..], None, (Outcome::BadContent, 7)),
        (other, None, (Outcome::BadContent, 10)),
        (NEW, Some(NotWritten::Failed), (Outcome::StoreFailed, 0)),
        (NEW, Some(NotWritten::SupplyLow), (Outcome::SupplyLow, 0)),
    ] {
        let mut bench = Bench::new(Some(KEY));
        bench.store.fails = fails;
        bench.servo_off();
        bench.transfer(7, blob, 4);
        assert_eq!(bench.update(commit(4), 7), STARTED);
        bench.ends(7, end);
        assert!(!bench.receiver.is_updating());
        assert_eq!(bench.store.newest.1, OLD);
    }
    let mut bench = Bench::new(None);
    bench.servo_off();
    let long = UpdateRequest::begin(657, 0);
    assert_eq!(bench.update(long, 7), (Outcome::BadContent, 0));
    let back = UpdateRequest::begin(0, 0);
    assert_eq!(bench.update(back, 7), (Outcome::NoParameters, 0));
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
    bench.store.running = None;
    assert_eq!(tell(&mut bench, page::PLACE), none);
    assert_eq!(bench.update(beyond, 1), (Outcome::NoParameters, 0));
}
