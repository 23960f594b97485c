//! Who may, and what another host or a recording gets.

use super::*;

#[test]
fn a_wrong_tag_a_second_guess_and_data_after_the_commit_store_nothing() {
    let mut bench = Bench::new(Some(&KEY));
    bench.servo_off();
    bench.transfer(7, NEW, 4);
    let stale = tag(&KEY, NodeNumber::TABLE, &[0; 4], &committing(4, 7), NEW);
    bench.tag(7, stale);
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
    assert_eq!(bench.store.newest, (4, NEW));
}

/// The command that commits.
const fn committing(sequence: u32, token: u8) -> Command {
    Command::new(Request::Update(commit(sequence)), token)
}

#[test]
fn without_a_random_number_nothing_can_be_asked_for_that_needs_a_tag() {
    let mut bench = Bench::new(Some(&KEY));
    for part in 0..4 {
        let challenge = UpdateRequest::Challenge { part };
        let answered = (bench.receiver).obey(7, challenge, true, None, &mut bench.store);
        let why = [Outcome::NoRandomNumber, Outcome::NoTransfer][usize::from(part > 0)];
        assert_eq!(answered, (why, 0));
    }
    bench.tag(
        7,
        tag(
            &KEY,
            NodeNumber::TABLE,
            &[0; 4],
            &Command::new(Request::Update(BEGIN), 7),
            &[],
        ),
    );
    assert_eq!(bench.update(BEGIN, 7), NOT_AUTHORISED);
    assert!(!bench.receiver.is_updating());
}

const NOT_AUTHORISED: (Outcome, u32) = (Outcome::NotAuthorised, 0);

/// All that moves the pose, makes it invalid or resets.
const WITH_TAG: [Request; 7] = [
    Request::ServoOff { seconds: 255 },
    Request::Rezero { ticks: 300 },
    Request::ClearZero,
    Request::Record { on: true },
    Request::Record { on: false },
    Request::Update(UpdateRequest::Activate),
    Request::Update(BEGIN),
];

#[test]
fn no_request_that_moves_or_resets_is_obeyed_without_its_own_fresh_tag() {
    for request in WITH_TAG {
        let mut bench = Bench::new(Some(&KEY));
        bench.servo_off();
        // Without a tag, and without a challenge.
        assert_eq!(bench.ask(request, 7), NOT_AUTHORISED, "{request:?}");
        // The tag of another token, of another request, and by another key.
        let other = Request::ServoOff { seconds: 254 };
        for wrong in [
            tag(
                &KEY,
                NodeNumber::TABLE,
                &bench.nonce(),
                &Command::new(request, 8),
                &[],
            ),
            tag(
                &KEY,
                NodeNumber::TABLE,
                &bench.nonce(),
                &Command::new(other, 7),
                &[],
            ),
            tag(
                &[0; 16],
                NodeNumber::TABLE,
                &bench.nonce(),
                &Command::new(request, 7),
                &[],
            ),
        ] {
            bench.tag(7, wrong);
            assert_eq!(bench.ask(request, 7), NOT_AUTHORISED, "{request:?}");
        }
        // Three of its four words, and then the fourth.
        let own = tag(
            &KEY,
            NodeNumber::TABLE,
            &bench.nonce(),
            &Command::new(request, 7),
            &[],
        );
        for k in 1..4 {
            bench.data(
                7,
                TAG_INDEX + k,
                word_at(&own, k.into()).expect("four words"),
            );
        }
        assert_eq!(
            bench.ask(request, 7),
            (Outcome::Incomplete, TAG_INDEX.into())
        );
        bench.data(7, TAG_INDEX, word_at(&own, 0).expect("four words"));
        let answer = bench.ask(request, 7);
        assert_ne!(answer, NOT_AUTHORISED, "{request:?}");
        // Its answer comes again, and nobody else's request passes by it.
        assert_eq!(bench.ask(request, 7), answer);
        assert_eq!(bench.ask(request, 8), NOT_AUTHORISED, "{request:?}");
    }
}

#[test]
fn a_nonce_and_its_tag_expire_after_five_seconds() {
    let off = Request::ServoOff { seconds: 1 };
    for (late, answer) in [(0, DONE), (1, NOT_AUTHORISED)] {
        let mut bench = Bench::new(Some(&KEY));
        let own = tag(
            &KEY,
            NodeNumber::TABLE,
            &bench.nonce(),
            &Command::new(off, 7),
            &[],
        );
        bench.ticks(IDLE_S * TICKS_PER_S - 1);
        // Frames do not keep it alive.
        bench.tag(7, own);
        bench.ticks(1 + late);
        assert_eq!(bench.ask(off, 7), answer);
    }
}

#[test]
fn a_tagged_request_that_is_played_again_is_answered_and_not_obeyed() {
    let mut bench = Bench::new(Some(&KEY));
    let off = Request::ServoOff { seconds: 1 };
    let nonce = bench.nonce();
    let recorded = tag(&KEY, NodeNumber::TABLE, &nonce, &Command::new(off, 7), &[]);
    bench.tag(7, recorded);
    assert_eq!(bench.ask(off, 7), DONE);
    assert!(bench.service.servo_is_off());
    bench.rest();
    assert_eq!(bench.ask(off, 7), DONE);
    assert!(!bench.service.servo_is_off());
    // The next challenge has another nonce, which the recorded tag does not answer.
    assert_ne!(bench.nonce(), nonce);
    let incomplete = (Outcome::Incomplete, TAG_INDEX.into());
    assert_eq!(bench.ask(off, 7), incomplete);
    bench.tag(7, recorded);
    assert_eq!(bench.ask(off, 7), NOT_AUTHORISED);
    assert!(!bench.service.servo_is_off());
}

#[test]
fn a_second_host_is_refused_as_busy_until_the_first_is_done_or_silent() {
    let mut bench = Bench::new(None);
    bench.servo_off();
    assert_eq!(bench.update(BEGIN, 7), DONE);
    bench.data(7, 0, 1);
    assert_eq!(bench.update(BEGIN, 7), DONE);
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
    assert_eq!(bench.update(BEGIN, 8), DONE);
    assert_eq!(bench.update(UpdateRequest::Abort, 8), DONE);
    assert_eq!(bench.update(UpdateRequest::Abort, 8), DONE);
    assert_eq!(bench.update(commit(4), 8), (Outcome::NoTransfer, 0));
}
