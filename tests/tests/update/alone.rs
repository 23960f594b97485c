//! One host: a bad bus, lost answers and refusals; and another that declares the servo on.

use super::world::World;
use super::{KEY, NEW, OLD, SERIAL, activating, changed, for_serial, plan, undeclared};
use hal_adapters::can::command::{Command, Content, Mailbox, Outcome, Request};
use hal_adapters::can::update::{UpdateRequest, blob_crc};
use host_fit::bus::update::{RezeroSettings, UpdateError, UpdateSettings, Updated, on};
use tests::fault::Fault;
use tests::flash_model::FlashModel;
use tests::node::Node;

const ACTIVATE: u8 = UpdateRequest::Activate.in_frame().0;
const COMMIT: u8 = UpdateRequest::Commit { sequence: 0 }.in_frame().0;

#[test]
fn on_a_bad_bus_the_update_ends_with_the_blob_bit_for_bit_or_a_refusal() {
    for (rate, least) in [(50_000, 108), (400_000, 107), (950_000, 0)] {
        let ends = on_a_bad_bus(rate);
        println!(
            "RESULT bad_bus_per_million={rate} updated={} refused={}",
            ends[0], ends[1]
        );
        assert!(ends[0] >= least, "{ends:?}");
    }
}

/// Twelve updates for each fault at this rate per million frames: how many were stored and refused.
fn on_a_bad_bus(rate: u64) -> [u32; 2] {
    let mut ends = [0; 2];
    for fault in Fault::ALL {
        for seed in 0..12 {
            let mut world = World::new(Some(&KEY), &[(fault, rate)], seed);
            match world.update(&plan(NEW)) {
                Ok(updated) => {
                    assert_eq!(world.newest(), NEW, "{fault:?} {seed}");
                    assert_eq!(updated.sequence, 1, "{fault:?} {seed}");
                    ends[0] += 1;
                }
                Err(error) => {
                    println!("{fault:?} {seed}: {error}");
                    // Only an unknown end may be the new blob.
                    let newest = world.newest();
                    let may_be_new = newest == NEW && error == UpdateError::Unknown;
                    assert!(newest == OLD || may_be_new, "{fault:?} {seed}: {error}");
                    ends[1] += 1;
                }
            }
        }
    }
    ends
}

#[test]
fn a_stored_blob_is_not_sent_again_and_activated_alone() {
    let mut world = World::new(Some(&KEY), &[], 12);
    let ended = |updated: Updated| (updated.is_stored, updated.sequence, updated.is_active);
    let alone = UpdateSettings {
        blob: None,
        activates: true,
        ..plan(&[])
    };
    let updated = world.update(&alone).expect("nothing to do");
    assert_eq!((ended(updated), world.node.resets()), ((false, 0, true), 0));
    let updated = world.update(&plan(NEW)).expect("it is stored");
    assert_eq!(ended(updated), (true, 1, false));
    let updated = world.update(&plan(NEW)).expect("nothing to do");
    assert_eq!(ended(updated), (false, 1, false));
    let next = world.identify().next.expect("it waits");
    assert_eq!((next.sequence, Some(next.crc)), (1, blob_crc(NEW)));
    let refused = world.update(&undeclared(alone.clone()));
    assert_eq!(refused, Err(UpdateError::NotActivated { sequence: 1 }));
    // A lost answer: the node has restarted, and the host asks which blob it runs.
    world.loses = |answer| answer.number == ACTIVATE && answer.outcome == Some(Outcome::Done);
    let updated = world.update(&alone).expect("it waits");
    assert_eq!((ended(updated), world.node.resets()), ((false, 1, true), 1));
    assert_eq!(world.node.records(), 1);
}

#[test]
fn a_lost_answer_to_a_commit_is_settled_by_asking_for_the_newest_blob() {
    let mut world = World::new(Some(&KEY), &[], 1);
    world.loses = |answer| answer.number == COMMIT && answer.outcome == Some(Outcome::Done);
    let updated = world.update(&plan(NEW)).expect("it is stored");
    assert_eq!((updated.sequence, updated.is_stored), (1, true));
    assert_eq!((&world.newest()[..], world.node.records()), (NEW, 1));
    // No node answers any more.
    let mut world = World::new(Some(&KEY), &[], 6);
    world.loses = |answer| answer.number == ACTIVATE;
    let silent = Err(UpdateError::Silent { sequence: 1 });
    assert_eq!(world.update(&activating(plan(NEW))), silent);
}

#[test]
fn each_refusal_has_its_reason_and_nothing_is_written() {
    let serial = "HS-0008";
    let foreign = changed(NEW, |set| set.serial = serial.try_into().expect("short"));
    let with_key = |key| UpdateSettings { key, ..plan(NEW) };
    let (expected, found) = ("HS-0008".to_owned(), SERIAL.to_owned());
    let other_stage = UpdateError::OtherStage { expected, found };
    let on = UpdateError::ServoOn { declared: false };
    for (plan, want) in [
        (undeclared(plan(NEW)), on),
        (with_key(None), UpdateError::KeyNeeded),
        (with_key(Some([0; 16])), UpdateError::NotAuthorised),
        (for_serial(Some(serial), plan(NEW)), other_stage.clone()),
        (for_serial(None, plan(&foreign)), other_stage),
    ] {
        let mut world = World::new(Some(&KEY), &[], 3);
        assert_eq!(world.update(&plan), Err(want));
        assert_eq!(world.node.records(), 0);
    }
    // A node without a serial number, where one was asked for.
    let mut world = World::new(None, &[], 3);
    world.node = Node::new(None, None, FlashModel::erased(), 3);
    let expected = SERIAL.to_owned();
    assert_eq!(
        world.update(&plan(NEW)),
        Err(UpdateError::NoSerial { expected })
    );
    assert_eq!(world.node.records(), 0);
    // No node at all.
    let mut world = World::new(None, &[(Fault::Drop, 1_000_000)], 3);
    assert_eq!(world.update(&plan(NEW)), Err(UpdateError::NoAnswer));
}

#[test]
fn an_interrupted_update_closes_its_transfer() {
    for at in [10, 60, 100, 170] {
        let mut world = World::new(Some(&KEY), &[], 3);
        world.interrupt_at = Some(at);
        assert_eq!(world.update(&plan(NEW)), Err(UpdateError::Interrupted));
        assert_eq!(world.node.records(), 0);
        world.interrupt_at = None;
        // Another update may begin at once, and the servo is on again.
        let refused = Err(UpdateError::ServoOn { declared: false });
        assert_eq!(world.update(&undeclared(plan(NEW))), refused);
        assert!(world.update(&plan(NEW)).is_ok());
    }
    // A commit can no longer be interrupted.
    let mut world = World::new(Some(&KEY), &[], 3);
    assert!(world.update(&plan(NEW)).is_ok());
    let commit = world.recording.len() - 1;
    let mut world = World::new(Some(&KEY), &[], 3);
    world.interrupt_at = Some(commit);
    assert!(world.update(&plan(NEW)).is_ok());
}

#[test]
fn a_stage_at_rest_is_zeroed_by_its_key_with_the_servo_off_on_a_bad_bus_too() {
    let settings = |key, declares_servo_off, clears| RezeroSettings {
        key,
        declares_servo_off,
        clears,
    };
    let rezero = |world: &mut World, settings| on::rezero(&mut world.talk(), &settings);
    for seed in 0..10 {
        let mut world = World::new(Some(&KEY), &[(Fault::Drop, 100_000)], seed);
        let refused = rezero(&mut world, settings(None, true, false));
        assert_eq!(refused, Err(UpdateError::NotAuthorised));
        let refused = rezero(&mut world, settings(Some(KEY), false, false));
        assert_eq!(refused, Err(UpdateError::ServoOn { declared: false }));
        for clears in [false, true] {
            let done = rezero(&mut world, settings(Some(KEY), true, clears));
            assert_eq!(done, Ok(()), "{seed}");
            assert_eq!(world.node.is_zeroed(), !clears, "{seed}");
        }
    }
}

#[test]
fn a_servo_that_another_host_declares_on_is_not_declared_off_again() {
    let (mut stored, mut refused) = (0, 0);
    for after_ms in (60..1_000).step_by(10) {
        let mut world = World::new(Some(&KEY), &[], 4);
        world.other_asks(after_ms * 1_000, Request::ServoOff { seconds: 0 }, 3);
        match world.update(&plan(NEW)) {
            Ok(updated) => {
                stored += 1;
                assert_eq!((updated.sequence, &world.newest()[..]), (1, NEW));
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
    // Once the blob is stored it waits.
    let mut world = World::new(None, &[], 6);
    world.other_asks(0, Request::ServoOff { seconds: 255 }, 3);
    world.declares_on_once_stored = true;
    let refused = world.update(&undeclared(activating(plan(NEW))));
    assert_eq!(refused, Err(UpdateError::NotActivated { sequence: 1 }));
}
