//! One host: how long it takes, a bad bus, resets, what is reported and refused.

use super::world::{World, flashed};
use super::{KEY, NEW, OLD, SERIAL, activating, back, changed, like, of, plan, undeclared};
use hal_adapters::can::command::{Outcome, Request};
use hal_adapters::can::status::NodeState;
use hal_adapters::can::update::{Kept, UpdateRequest, crc_of};
use host_fit::bus::update::{Plan, UpdateError, Updated, Wanted, on};
use runtime::ParameterSet;
use tests::fault::Fault;
use tests::flash_model::FlashModel;
use tests::node::Node;

/// The largest blob that a fit writes: the field model, with texts of full length.
fn largest() -> Vec<u8> {
    changed(NEW, |set| {
        set.serial = "S".repeat(32).as_str().try_into().expect("32 bytes");
        let created = "2026-11-22T10:00:00.000000+00:00";
        set.created = created.try_into().expect("32 bytes");
    })
}

#[test]
fn the_largest_blob_takes_less_than_one_second_and_a_half_on_a_loaded_bus() {
    let blob = largest();
    for key in [None, Some(KEY)] {
        let serial: &'static str = "S".repeat(32).leak();
        let mut world = World::new(key, &[], 1);
        world.node = Node::new(Some(serial), key, flashed(&blob), 1);
        world.other_asks(0, Request::Record { on: true }, 3);
        let newer = like(&blob);
        let job = of(Some(serial), plan(&newer));
        let updated = world.update(&job).expect("it is taken");
        assert_eq!(updated.sequence, Some(1));
        assert_eq!(updated.repeated, (0, 0));
        assert_eq!(world.newest(), newer);
        println!(
            "RESULT update_bytes={} key={} update_us={} frames={} overruns={}",
            newer.len(),
            key.is_some(),
            world.now_us,
            world.recording.len(),
            world.overruns
        );
        assert!(world.now_us <= 1_500_000);
        assert_eq!(world.overruns, 0);
    }
}

#[test]
fn on_a_bad_bus_the_update_ends_with_the_blob_bit_for_bit_or_a_refusal() {
    for (rate, least) in [(50_000, 108), (400_000, 108), (950_000, 0)] {
        let ends = on_a_bad_bus(rate);
        println!(
            "RESULT bad_bus_per_million={rate} updated={} refused={}",
            ends[0], ends[1]
        );
        assert!(ends[0] >= least, "{ends:?}");
    }
}

/// Twelve updates for each fault, at so many per million frames: how many were stored and refused.
fn on_a_bad_bus(rate: u64) -> [u32; 2] {
    let mut ends = [0; 2];
    for fault in Fault::ALL {
        for seed in 0..12 {
            let mut world = World::new(Some(KEY), &[(fault, rate)], seed);
            match world.update(&plan(NEW)) {
                Ok(updated) => {
                    assert_eq!(world.newest(), NEW, "{fault:?} {seed}");
                    assert_eq!(updated.sequence, Some(1), "{fault:?} {seed}");
                    ends[0] += 1;
                }
                Err(error) => {
                    println!("{fault:?} {seed}: {error}");
                    // Only an end that is not known may leave the new one.
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
fn a_reset_at_any_moment_leaves_the_old_or_the_new_and_says_which() {
    for (goes_back, [before, after]) in [(false, [OLD, NEW]), (true, [NEW, OLD])] {
        let job = if goes_back { back() } else { plan(NEW) };
        let (mut stored, mut refused) = (0, 0);
        for at_ms in (0..900).step_by(3) {
            let mut world = World::new(Some(KEY), &[], 5);
            if goes_back {
                world.update(&plan(NEW)).expect("it is taken");
            }
            let next = world.node.records() + 1;
            world.resets_us = vec![world.now_us + at_ms * 1_000];
            match world.update(&job) {
                Ok(updated) => {
                    stored += 1;
                    let found = (updated.sequence, &world.newest()[..]);
                    assert_eq!(found, (Some(next), after), "{at_ms}");
                }
                Err(error) => {
                    refused += 1;
                    // After a restart of the machine the servo may be on: it is not declared off again.
                    assert_eq!(error, UpdateError::ServoOn { declared: true }, "{at_ms}");
                    assert_eq!(world.newest(), before, "{at_ms}");
                    assert!(world.update(&job).is_ok(), "{at_ms}");
                }
            }
            assert_eq!(world.node.records(), next, "{at_ms}");
        }
        assert!(stored > 10 && refused > 3, "{stored} {refused}");
    }
}

#[test]
fn activated_parameters_run_are_reported_and_read_back() {
    let mut world = World::new(Some(KEY), &[(Fault::Drop, 20_000)], 8);
    let updated = world.update(&activating(plan(NEW))).expect("it is taken");
    assert!(updated.is_active && world.node.resets() == 1);
    let before = updated.before.running.expect("it ran");
    assert!(before.are(OLD) && before.sequence == 0);
    let read = on::read_back(&mut world.talk(), &mut |_, _| {});
    let (identity, blob) = read.expect("it runs");
    assert_eq!(blob, NEW);
    let (set, running) = (ParameterSet::from_bytes(NEW), identity.running);
    let (set, running) = (set.expect("sound"), running.expect("it runs"));
    assert_eq!(
        (identity.serial.as_str(), identity.needs_key),
        (SERIAL, true)
    );
    assert_eq!((running.sequence, identity.newest_sequence), (1, 1));
    assert_eq!((running.rms, running.peak), (set.fit.rms, set.fit.peak));
    assert_eq!(running.created, set.created.as_str());
    let program = (identity.program_version, identity.program_hash);
    assert_eq!(program, ([1, 2, 3], 0xfeed_beef));
    assert_eq!((running.slot, running.forced), (1, set.fit.forced));
    // The same again is not sent, and the record before comes back on demand.
    let mut again = undeclared(plan(NEW));
    again.key = None;
    let again = world.update(&again).expect("nothing to do");
    assert_eq!((again.sequence, again.is_active), (None, true));
    let back = world.update(&activating(back())).expect("there is one");
    assert_eq!(back.sequence, Some(2));
    assert_eq!(world.newest(), OLD);
    let running = world.identify().running;
    assert!(running.is_some_and(|running| running.are(OLD) && running.sequence == 2));
}

#[test]
fn what_waits_for_a_reset_is_not_sent_again_and_activated_alone() {
    let mut world = World::new(Some(KEY), &[], 12);
    let kept = |updated: Updated| (updated.sequence, updated.record, updated.is_active);
    let alone = Plan {
        wanted: Wanted::Newest,
        activates: true,
        ..plan(&[])
    };
    let updated = world.update(&alone).expect("nothing to do");
    assert_eq!((kept(updated), world.node.resets()), ((None, 0, true), 0));
    let updated = world.update(&plan(NEW)).expect("it is taken");
    assert_eq!(kept(updated), (Some(1), 1, false));
    let updated = world.update(&plan(NEW)).expect("nothing to do");
    assert_eq!(kept(updated), (None, 1, false));
    let identity = world.identify();
    let of = |record: Option<Kept>| record.map(|record| (record.sequence, record.crc));
    assert_eq!(of(identity.next), Some((1, crc_of(NEW).expect("a blob"))));
    assert_eq!(
        of(identity.previous),
        Some((0, crc_of(OLD).expect("a blob")))
    );
    let refused = world.update(&undeclared(alone.clone()));
    assert_eq!(refused, Err(UpdateError::NotActivated { sequence: 1 }));
    // The answer is lost: the node has restarted, and is asked what it runs.
    const ACTIVATE: u8 = UpdateRequest::Activate.number();
    world.loses = |answer| answer.number == ACTIVATE && answer.outcome == Some(Outcome::Done);
    let updated = world.update(&alone).expect("it waits");
    assert_eq!((kept(updated), world.node.resets()), ((None, 1, true), 1));
    assert_eq!(world.node.records(), 1);
}

#[test]
fn what_is_refused_is_refused_by_its_reason_and_nothing_is_written() {
    let serial = "HS-0008";
    let of_another = changed(NEW, |set| set.serial = serial.try_into().expect("short"));
    let with_key = |key| Plan { key, ..plan(NEW) };
    let (expected, found) = ("HS-0008".to_owned(), SERIAL.to_owned());
    let other_stage = UpdateError::OtherStage { expected, found };
    let on = UpdateError::ServoOn { declared: false };
    for (plan, want) in [
        (undeclared(plan(NEW)), on),
        (with_key(None), UpdateError::KeyNeeded),
        (with_key(Some([0; 16])), UpdateError::NotAuthorised),
        (of(Some(serial), plan(NEW)), other_stage.clone()),
        (of(None, plan(&of_another)), other_stage),
        (back(), UpdateError::NoPrevious),
    ] {
        let mut world = World::new(Some(KEY), &[], 3);
        assert_eq!(world.update(&plan), Err(want));
        assert_eq!(world.node.records(), 0);
    }
    // A node without a serial number is not taken for the one that was asked for.
    let mut world = World::new(None, &[], 3);
    world.node = Node::new(None, None, FlashModel::erased(), 3);
    let expected = SERIAL.to_owned();
    assert_eq!(
        world.update(&plan(NEW)),
        Err(UpdateError::NoSerial { expected })
    );
    assert_eq!(world.node.records(), 0);
    // Nobody is there.
    let mut world = World::new(None, &[(Fault::Drop, 1_000_000)], 3);
    assert_eq!(world.update(&plan(NEW)), Err(UpdateError::NoAnswer));
}

#[test]
fn an_interrupted_update_closes_its_transfer() {
    for at in [10, 60, 100, 180] {
        let mut world = World::new(Some(KEY), &[], 3);
        world.interrupt_at = Some(at);
        assert_eq!(world.update(&plan(NEW)), Err(UpdateError::Interrupted));
        assert_eq!(world.node.records(), 0);
        world.interrupt_at = None;
        // Another may begin at once, and the servo is on again.
        let refused = Err(UpdateError::ServoOn { declared: false });
        assert_eq!(world.update(&undeclared(plan(NEW))), refused);
        assert!(world.update(&plan(NEW)).is_ok());
    }
    // What is being stored is stored.
    let mut world = World::new(Some(KEY), &[], 3);
    assert!(world.update(&plan(NEW)).is_ok());
    let commit = world.recording.len() - 1;
    let mut world = World::new(Some(KEY), &[], 3);
    world.interrupt_at = Some(commit);
    assert!(world.update(&plan(NEW)).is_ok());
}

#[test]
fn parameters_that_fault_twice_stop_the_node_until_it_goes_back() {
    let mut world = World::new(Some(KEY), &[], 6);
    world.faults_after_activation_us = vec![1_000_000, 2_000_000];
    let result = world.update(&activating(plan(NEW)));
    assert_eq!(result, Err(UpdateError::NotActive { sequence: 1 }));
    for _ in 0..3 {
        assert_eq!(world.node.state(), (NodeState::Stopped, 1));
        assert_eq!(world.node.running(), None);
        (0..20_000).for_each(|_| drop(world.slot()));
        world.node.reset();
        (0..2_000).for_each(|_| drop(world.slot()));
    }
    let back = world.update(&activating(back())).expect("it is there");
    assert!(back.is_active);
    assert_eq!(world.node.running(), crc_of(OLD));
}
