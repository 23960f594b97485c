//! What one host does: stored, refused, answered.

use super::*;

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
        assert_eq!(bench.update(commit(4), 7), incomplete);
        bench.data(7, missing as u8, word_at(NEW, missing).expect("within"));
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
        let mut bench = Bench::new(Some(&KEY));
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
    for bytes in [0, MAX_BYTES as u16 + 1] {
        let begin = UpdateRequest::Begin { bytes };
        assert_eq!(bench.update(begin, 7), (Outcome::BadContent, 0));
    }
}

/// What the pages say, a host reads: `tests/update`.
#[test]
fn a_page_or_a_word_that_is_not_there_is_refused() {
    let mut bench = Bench::new(Some(&KEY));
    let tell = |bench: &mut Bench, page| bench.update(UpdateRequest::Tell { page }, page);
    let read = |bench: &mut Bench, index| bench.update(UpdateRequest::ReadBack { index }, 1);
    let (none, unknown) = ((Outcome::NoParameters, 0), (Outcome::UnknownCommand, 0));
    assert_eq!(tell(&mut bench, page::COUNT), unknown);
    assert_eq!(read(&mut bench, 255), unknown);
    bench.store.runs = false;
    assert_eq!(tell(&mut bench, page::RUNNING_CRC), none);
    assert_eq!(read(&mut bench, 255), none);
}
