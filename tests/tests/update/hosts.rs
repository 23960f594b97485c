//! Another host: one that updates at the same time, declares the servo on, asks when an answer is lost,
//! or plays a recording.

use super::world::{SLOT_US, World, command};
use super::{KEY, NEW, OLD, activating, back, like, plan, undeclared};
use hal_adapters::can::command::{Command, Content, Mailbox, Outcome, Request};
use hal_adapters::can::update::UpdateRequest;
use host_fit::bus::update::{UpdateError, Zero, on};
use tests::fault::Fault;

const ACTIVATE: u8 = UpdateRequest::Activate.number();
const COMMIT: u8 = UpdateRequest::Commit { sequence: 0 }.number();

/// Another transfer.
const BEGIN: Request = Request::Update(UpdateRequest::begin(500, 0));

#[test]
fn of_two_hosts_at_once_one_stores_and_the_other_is_refused() {
    let mut alone = World::new(None, &[], 1);
    assert!(alone.update(&plan(NEW)).is_ok());
    let other = like(NEW);
    let (mut stored, mut busy) = (0, 0);
    // The first host's frames as they were, and the second begins at any time beside them.
    for after_ms in (0..900).step_by(20) {
        let mut world = World::new(None, &[], 1);
        world.others = alone.recording.iter().copied().collect();
        (0..after_ms * 1_000 / SLOT_US).for_each(|_| drop(world.slot()));
        let second = world.update(&plan(&other));
        (0..15_000).for_each(|_| drop(world.slot()));
        let newest = world.newest();
        match second {
            Ok(updated) => {
                stored += 1;
                assert_eq!(newest, other, "{after_ms}");
                assert_eq!(updated.sequence, Some(world.node.records()));
            }
            Err(error) => {
                busy += u32::from(error == UpdateError::Busy);
                let reasons = [
                    UpdateError::Busy,
                    UpdateError::Overtaken { least: 2 },
                    UpdateError::ServoOn { declared: true },
                ];
                assert!(reasons.contains(&error), "{after_ms}: {error}");
                assert_eq!(newest, NEW, "{after_ms}: {error}");
            }
        }
    }
    assert!(stored > 0 && busy > 5, "{stored} {busy}");
}

#[test]
fn a_host_that_finds_another_at_it_gives_up_as_busy_and_does_not_end_its_transfer() {
    let mut world = World::new(None, &[], 1);
    world.other_asks(0, Request::ServoOff { seconds: 255 }, 3);
    world.other_asks(4_000, BEGIN, 200);
    (0..100).for_each(|_| drop(world.slot()));
    assert!(world.node.is_updating());
    assert_eq!(world.update(&plan(NEW)), Err(UpdateError::Busy));
    (0..1_000).for_each(|_| drop(world.slot()));
    assert!(world.node.is_updating());
    assert_eq!(world.node.records(), 0);
}

#[test]
fn a_host_whose_numbers_another_uses_up_waits_for_its_turn_or_gives_up_as_busy() {
    let zero = Zero {
        key: Some(KEY),
        declares_servo_off: true,
        clears: true,
    };
    for (lasts_ms, ends) in [(600, true), (10_000, false)] {
        for after_ms in 0..10 {
            let mut world = World::new(Some(KEY), &[], after_ms);
            for (k, at_ms) in (after_ms..lasts_ms).step_by(10).enumerate() {
                let draw = Request::Update(UpdateRequest::Challenge { part: 0 });
                world.other_asks(at_ms * 1_000, draw, 64 + k as u8 % 16);
            }
            let ended = on::rezero(&mut world.talk(), &zero);
            let want = if ends { Ok(()) } else { Err(UpdateError::Busy) };
            assert_eq!(ended, want, "{after_ms}");
        }
    }
}

#[test]
fn what_another_host_declares_on_is_not_declared_off_again() {
    let (mut stored, mut refused) = (0, 0);
    for after_ms in (80..1_000).step_by(10) {
        let mut world = World::new(Some(KEY), &[], 4);
        world.other_asks(after_ms * 1_000, Request::ServoOff { seconds: 0 }, 3);
        match world.update(&plan(NEW)) {
            Ok(updated) => {
                stored += 1;
                assert_eq!((updated.sequence, &world.newest()[..]), (Some(1), NEW));
            }
            Err(error) => {
                refused += 1;
                assert_eq!(error, UpdateError::ServoOn { declared: true }, "{after_ms}");
                assert_eq!(world.newest(), OLD, "{after_ms}");
            }
        }
        let mut mailbox = Mailbox::default();
        let declared = world.recording.iter().filter(|(_, frame)| {
            let is_off = |request| matches!(request, Some(Request::ServoOff { seconds: 1.. }));
            match mailbox.take(frame) {
                Some(Ok(Content::Command(Command { request, .. }))) => is_off(request),
                _ => false,
            }
        });
        assert_eq!(declared.count(), 1, "{after_ms}");
    }
    assert!(stored > 10 && refused > 10, "{stored} {refused}");
}

#[test]
fn a_lost_answer_to_a_commit_is_settled_by_asking_what_the_node_keeps() {
    let mut world = World::new(Some(KEY), &[], 1);
    world.update(&activating(plan(NEW))).expect("it is taken");
    world.loses = |answer| answer.number == COMMIT && answer.outcome == Some(Outcome::Done);
    for (sequence, newest) in [(2, OLD), (3, NEW)] {
        let updated = world.update(&activating(back())).expect("it is stored");
        assert_eq!(
            (updated.sequence, updated.record),
            (Some(sequence), sequence)
        );
        assert_eq!(
            (&world.newest()[..], world.node.records()),
            (newest, sequence)
        );
    }
    // Also where another host begins at once, whose transfer is left alone.
    let mut world = World::new(Some(KEY), &[], 6);
    world.loses = |answer| answer.number == COMMIT && answer.outcome == Some(Outcome::Done);
    world.once_stored = Some(command(BEGIN, 200, 0));
    let updated = world.update(&plan(NEW)).expect("it is stored");
    assert_eq!((updated.sequence, &world.newest()[..]), (Some(1), NEW));
}

#[test]
fn what_is_stored_and_not_activated_is_reported_as_stored() {
    let on_the_word_of_another = undeclared(activating(plan(NEW)));
    let off = |seconds| Request::ServoOff { seconds };
    let mut world = World::new(None, &[], 6);
    world.other_asks(0, off(255), 3);
    world.once_stored = Some(command(off(0), 4, 1));
    let refused = world.update(&on_the_word_of_another);
    assert_eq!(refused, Err(UpdateError::NotActivated { sequence: 1 }));
    // The answer is lost, and the declaration with the reset: the parameters run.
    let mut world = World::new(Some(KEY), &[], 6);
    world.loses = |answer| answer.number == ACTIVATE && answer.outcome == Some(Outcome::Done);
    let updated = world.update(&activating(plan(NEW))).expect("it runs");
    assert_eq!((updated.sequence, updated.is_active), (Some(1), true));
    // Nobody answers any more.
    let mut world = World::new(Some(KEY), &[], 6);
    world.loses = |answer| answer.number == ACTIVATE;
    let silent = Err(UpdateError::Silent { sequence: 1 });
    assert_eq!(world.update(&activating(plan(NEW))), silent);
}

#[test]
fn a_stage_at_rest_is_zeroed_by_its_key_with_the_servo_off_on_a_bad_bus_too() {
    let zero = Zero {
        key: Some(KEY),
        declares_servo_off: true,
        clears: false,
    };
    let rezero = |world: &mut World, zero: &Zero| on::rezero(&mut world.talk(), zero);
    let mut no_key = zero.clone();
    no_key.key = None;
    let mut undeclared = zero.clone();
    undeclared.declares_servo_off = false;
    let mut clear = zero.clone();
    clear.clears = true;
    for seed in 0..10 {
        let mut world = World::new(Some(KEY), &[(Fault::Drop, 100_000)], seed);
        assert_eq!(rezero(&mut world, &no_key), Err(UpdateError::NotAuthorised));
        let refused = Err(UpdateError::ServoOn { declared: false });
        assert_eq!(rezero(&mut world, &undeclared), refused);
        for (wanted, is_zeroed) in [(&zero, true), (&clear, false)] {
            assert_eq!(rezero(&mut world, wanted), Ok(()), "{seed}");
            assert_eq!(world.node.is_zeroed(), is_zeroed, "{seed}");
        }
    }
}

#[test]
fn a_recording_of_a_good_update_stores_nothing_when_it_is_played_again() {
    for key in [Some(KEY), None] {
        for pause_ms in [0, 10_000] {
            let mut world = World::new(key, &[], 21);
            world.update(&plan(NEW)).expect("it is taken");
            let (recording, ended_us) = (world.recording.clone(), world.now_us);
            assert!(recording.len() > 180);
            let again_us = ended_us + pause_ms * 1_000;
            let again = recording.iter().map(|(at, frame)| (again_us + at, *frame));
            world.others = again.collect();
            while !world.others.is_empty() {
                world.slot();
            }
            (0..10_000).for_each(|_| drop(world.slot()));
            assert_eq!((world.node.records(), &world.newest()[..]), (1, NEW));
        }
    }
}
