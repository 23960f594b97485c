//! Who may, and what another host or a recording gets.

use super::*;

#[test]
fn a_wrong_tag_a_second_guess_and_data_after_the_commit_store_nothing() {
    let mut bench = Bench::new(Some(KEY));
    bench.servo_off();
    bench.transfer(7, NEW, 4);
    bench.tag(7, tag(&KEY, &[0; 4], 4, NEW, NEW_CRC));
    assert_eq!(bench.update(commit(4), 7), STARTED);
    let refused = (Outcome::NotAuthorised, 0);
    bench.ends(7, refused);
    // The transfer is closed; the answer is there for a host that lost it.
    assert_eq!(bench.update(commit(4), 7), refused);
    // The tag of one sequence number is none of another.
    bench.transfer(8, NEW, 5);
    assert_eq!(bench.update(commit(5), 8), (Outcome::WrongSequence, 4));
    assert_eq!(bench.update(commit(4), 8), STARTED);
    bench.ends(8, refused);
    // A committed transfer takes no more data.
    bench.transfer(9, NEW, 4);
    assert_eq!(bench.update(commit(4), 9), STARTED);
    bench.data(9, 20, 0);
    bench.ends(9, NEW_DONE);
    assert_eq!((&bench.store.newest.1[..], bench.store.writes), (NEW, 1));
}

#[test]
fn without_a_random_number_no_transfer_begins_where_a_key_is_needed() {
    for (key, want) in [(Some(KEY), (Outcome::NoRandomNumber, 0)), (None, BEGUN)] {
        let mut bench = Bench::new(key);
        let around = Surroundings {
            servo_is_off: true,
            store: &mut bench.store,
            nonce: None,
        };
        assert_eq!(bench.receiver.obey(7, BEGIN, around), want);
        assert_eq!(bench.receiver.is_updating(), key.is_none());
    }
}

#[test]
fn a_second_host_is_told_busy_until_the_first_is_done_or_silent() {
    let mut bench = Bench::new(None);
    bench.servo_off();
    assert_eq!(bench.update(BEGIN, 7), BEGUN);
    bench.data(7, 0, 1);
    assert_eq!(bench.update(BEGIN, 7), BEGUN);
    for request in [
        BEGIN,
        commit(4),
        UpdateRequest::Abort,
        UpdateRequest::Activate,
    ] {
        assert_eq!(bench.update(request, 8), (Outcome::Busy, 0), "{request:?}");
    }
    assert_eq!(bench.update(commit(4), 7), (Outcome::Incomplete, 1));
    // Five seconds after the last word of the first.
    assert!(bench.ticks(IDLE_S * TICKS_PER_S).is_empty());
    assert!(bench.receiver.is_updating());
    assert!(bench.ticks(1).is_empty());
    assert_eq!(bench.update(commit(4), 7), (Outcome::NoTransfer, 0));
    assert_eq!(bench.update(BEGIN, 8), BEGUN);
    assert_eq!(bench.update(UpdateRequest::Abort, 8), DONE);
    assert_eq!(bench.update(UpdateRequest::Abort, 8), DONE);
    assert_eq!(bench.update(commit(4), 8), (Outcome::NoTransfer, 0));
}

/// Whoever recorded a transfer that was never stored has a blob, a tag and a number that are still
/// due. Only the nonce tells them from an answer to this challenge.
#[test]
fn each_transfer_asks_for_a_new_nonce_and_a_recorded_tag_answers_none() {
    let mut bench = Bench::new(Some(KEY));
    bench.servo_off();
    let (mut nonces, mut recorded) = (Vec::new(), None);
    for token in 0..20 {
        assert_eq!(bench.update(BEGIN, token), BEGUN);
        let nonce = bench.nonce();
        // The same for the whole of one transfer, and then never again.
        assert_eq!(bench.nonce(), nonce);
        assert!(!nonces.contains(&nonce));
        nonces.push(nonce);
        bench.blob(token, NEW);
        let own = tag(&KEY, &nonce, 4, NEW, NEW_CRC);
        bench.tag(token, *recorded.get_or_insert(own));
        // The first tag would be right: it is kept, and never used.
        if token > 0 {
            assert_eq!(bench.update(commit(4), token), STARTED);
            bench.ends(token, (Outcome::NotAuthorised, 0));
        }
        bench.update(UpdateRequest::Abort, token);
    }
    assert_eq!(bench.store.writes, 0);
}

#[test]
fn under_one_token_and_length_only_the_blob_that_was_begun_is_done() {
    let mut other = NEW.to_vec();
    let mut set = ParameterSet::from_bytes(NEW).expect("sound");
    set.fit.rows += 1;
    let length = set.to_bytes(&mut other).expect("room").len();
    let crc = crc_of(&other).expect("a blob");
    assert_eq!(length, NEW.len());
    let begin = UpdateRequest::begin(length, crc);
    let mut bench = Bench::new(None);
    bench.servo_off();
    assert_eq!(bench.update(BEGIN, 7), BEGUN);
    assert_eq!(bench.update(begin, 7), (Outcome::Busy, 0));
    // The other blob in the transfer of the first is none of either.
    bench.blob(7, &other);
    assert_eq!(
        bench.update(commit(4), 7),
        (Outcome::BadContent, WRONG_CHECK)
    );
    // And what was stored is named, for whoever asks under this token.
    assert_eq!(bench.update(BEGIN, 7), BEGUN);
    bench.blob(7, NEW);
    assert_eq!(bench.update(commit(4), 7), STARTED);
    bench.ends(7, NEW_DONE);
    assert_eq!(bench.update(commit(4), 7), NEW_DONE);
    // Back to the one that is meant, and to no other.
    assert_eq!(
        bench.update(begin_back(NEW_CRC), 8),
        (Outcome::WrongSequence, 5)
    );
    let back = begin_back(crc_of(OLD).expect("a blob"));
    let begun = (Outcome::Done, back.argument());
    assert_eq!(bench.update(back, 8), begun);
}

const fn begin_back(crc: u32) -> UpdateRequest {
    UpdateRequest::begin(0, crc)
}
