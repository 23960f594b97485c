//! Another host on the bus: it updates, declares the servo on, or replays a recording.

use super::world::World;
use super::{KEY, NEW, OLD, activating, plan, undeclared};
use hal_adapters::can::command::{Command, Content, Mailbox, Request};
use hal_adapters::can::update::UpdateRequest;
use host_fit::bus::update::UpdateError;

/// Another transfer.
const BEGIN: Request = Request::Update(UpdateRequest::Begin { bytes: 500 });

#[test]
fn a_second_host_stops_as_busy_and_does_not_end_the_transfer_of_the_first() {
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
fn a_servo_that_another_host_declares_on_is_not_declared_off_again() {
    let (mut stored, mut refused) = (0, 0);
    for after_ms in (60..1_000).step_by(10) {
        let mut world = World::new(Some(KEY), &[], 4);
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

#[test]
fn a_recording_of_a_good_update_stores_nothing_when_it_is_played_again() {
    for key in [Some(KEY), None] {
        for pause_ms in [0, 10_000] {
            let mut world = World::new(key, &[], 21);
            world.update(&plan(NEW)).expect("it is stored");
            let (recording, ended_us) = (world.recording.clone(), world.now_us);
            assert!(recording.len() > 160);
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
