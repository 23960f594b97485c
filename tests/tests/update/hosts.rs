//! Two hosts, a lost answer, a declaration that another host takes back, a recording.

use super::world::{SLOT_US, World};
use super::{KEY, NEW, OLD, back, like, plan};
use hal_adapters::can::BusFrame;
use hal_adapters::can::command::{Command, Mailbox, Outcome, Request, Told};
use hal_adapters::can::update::{UpdateData, UpdateRequest};
use hal_adapters::fault::Fault;
use host_fit::bus::update::{Dialog, Plan, UpdateError, Updated, Updater};

#[test]
fn of_two_hosts_at_once_one_wins_and_the_other_is_told() {
    // The same tokens are the worst case.
    for (token, seed) in [(9, 1), (9, 2), (9, 6), (77, 3), (78, 4), (79, 5)] {
        for faults in [&[][..], &[(Fault::Drop, 10_000)]] {
            let other = like(NEW);
            let mut world = World::new(Some(KEY), faults, seed);
            let second = Plan {
                token,
                ..plan(&other)
            };
            let mut first = 1;
            let mut hosts = [plan(NEW), second].map(|plan| {
                let dialog = Dialog::new(Updater::new(plan), first);
                first += if token == 9 { 0 } else { 50 };
                dialog
            });
            world.run(&mut hosts);
            let [one, two] = hosts.map(|host| host.into_job().result());
            println!("{token} {seed}: {one:?} {two:?}");
            let (winner, blob, loser) = match one {
                Ok(winner) => (winner, NEW, two),
                Err(_) => (two.expect("one wins"), &other[..], one),
            };
            assert_eq!((winner.sequence, world.newest()), (Some(1), blob));
            assert_eq!(world.node.records(), 1);
            assert!(
                matches!(
                    loser,
                    Err(UpdateError::Overtaken { least: 2 }
                        | UpdateError::ServoOn { declared: true }
                        | UpdateError::Busy)
                ),
                "{loser:?}"
            );
        }
    }
}

#[test]
fn a_host_that_finds_another_at_it_gives_up_and_does_not_end_its_transfer() {
    let mut world = World::new(None, &[], 1);
    let command = |request, token| Told::Command(Command::new(request, token));
    let mut other = Mailbox::default();
    let begin = Request::Update(UpdateRequest::begin(500, 0));
    let mut send = |world: &mut World, told| {
        let coded = other.send(&told).expect("a known message");
        world.to_node.send(world.now_us, BusFrame::from(coded));
    };
    send(&mut world, command(Request::ServoOff { seconds: 255 }, 3));
    send(&mut world, command(begin, 200));
    let mut host = Dialog::new(Updater::new(plan(NEW)), 1);
    let mut next_us = 0;
    while !host.is_over() {
        for frame in world.slot() {
            host.take(&frame, world.now_us);
        }
        let polled = host.poll(world.now_us);
        if let Some(coded) = polled {
            world.to_node.send(world.now_us, BusFrame::from(coded));
        } else if world.now_us >= next_us {
            next_us = world.now_us + 1_000_000;
            let (token, index, word) = (200, 1, 2);
            send(
                &mut world,
                Told::UpdateData(UpdateData { token, index, word }),
            );
        }
    }
    assert_eq!(host.into_job().result(), Err(UpdateError::Busy));
    assert!(world.node.is_updating());
    assert_eq!(world.node.records(), 0);
}

/// Another host declares the servo on, `after_ms` after the first frame of this one.
fn declared_on(world: &mut World, plan: Plan, after_ms: u64) -> Result<Option<u32>, UpdateError> {
    let mut host = Dialog::new(Updater::new(plan), 1);
    let on = Command::new(Request::ServoOff { seconds: 0 }, 3);
    let mut other = Mailbox::default().send(&Told::Command(on));
    let at_us = world.now_us + after_ms * 1_000;
    while !host.is_over() {
        for frame in world.slot() {
            host.take(&frame, world.now_us);
        }
        if world.now_us >= at_us
            && let Some(coded) = other.take()
        {
            world.to_node.send(world.now_us, BusFrame::from(coded));
        }
        if let Some(coded) = host.poll(world.now_us) {
            let frame = BusFrame::from(coded);
            world.recording.push(frame);
            world.to_node.send(world.now_us, frame);
        }
    }
    host.into_job().result().map(|updated| updated.sequence)
}

#[test]
fn what_another_host_declares_on_is_not_declared_off_again() {
    let (mut stored, mut refused) = (0, 0);
    for after_ms in (80..700).step_by(5) {
        let mut world = World::new(Some(KEY), &[], 4);
        let result = declared_on(&mut world, plan(NEW), after_ms);
        match result {
            Ok(sequence) => {
                stored += 1;
                assert_eq!((sequence, world.newest()), (Some(1), NEW), "{after_ms}");
            }
            Err(error) => {
                refused += 1;
                assert_eq!(error, UpdateError::ServoOn { declared: true }, "{after_ms}");
                assert_eq!(world.newest(), OLD, "{after_ms}");
            }
        }
        let mut mailbox = Mailbox::default();
        let declared = world.recording.iter().filter(|frame| {
            let is_off = |request| matches!(request, Some(Request::ServoOff { seconds: 1.. }));
            match mailbox.take(*frame) {
                Some(Ok(Told::Command(command))) => is_off(command.request),
                _ => false,
            }
        });
        assert_eq!(declared.count(), 1, "{after_ms}");
    }
    assert!(stored > 10 && refused > 10, "{stored} {refused}");
}

/// A node with three blobs: the old one, as a probe flashes it, in record 1 a new one, in 2 another.
fn with_three(seed: u64) -> (World, Vec<u8>) {
    let mut world = World::new(Some(KEY), &[], seed);
    let third = like(NEW);
    for (blob, sequence) in [(NEW, 1), (&third, 2)] {
        let updated = world.update(plan(blob)).expect("it is taken");
        assert_eq!(updated.sequence, Some(sequence));
    }
    (world, third)
}

#[test]
fn a_lost_answer_to_a_commit_is_settled_by_asking_what_the_node_keeps() {
    let (mut world, _) = with_three(1);
    world.loses = |answer| answer.number == COMMIT && answer.outcome == Some(Outcome::Done);
    let updated = world.update(back()).expect("it is stored");
    assert_eq!((updated.sequence, updated.record), (Some(3), 3));
    assert_eq!((world.newest(), world.node.records()), (NEW, 3));
    // Back once more is back to the one before, and a blob is stored once, too.
    let third = like(NEW);
    let updated = world.update(plan(&third)).expect("it is stored");
    assert_eq!(updated.sequence, Some(4));
    assert_eq!((world.newest(), world.node.records()), (&third[..], 4));
}

/// An update, and what another host asks for once its record is stored; `before` it begins, that host
/// asks for this.
fn beside(
    world: &mut World,
    plan: Plan,
    before: Option<Request>,
    then: (Request, u8),
) -> Result<Updated, UpdateError> {
    let mut other = Mailbox::default();
    let mut send = |world: &mut World, request, token| {
        let told = Told::Command(Command::new(request, token));
        let coded = other.send(&told).expect("a known message");
        world.to_node.send(world.now_us, BusFrame::from(coded));
    };
    if let Some(request) = before {
        send(world, request, 3);
        (0..100).for_each(|_| drop(world.slot()));
    }
    let mut then = Some(then);
    let records = world.node.records();
    let mut host = Dialog::new(Updater::new(plan), 1);
    while !host.is_over() {
        for frame in world.slot() {
            host.take(&frame, world.now_us);
        }
        if world.node.records() > records
            && let Some((request, token)) = then.take()
        {
            send(world, request, token);
        }
        if let Some(coded) = host.poll(world.now_us) {
            world.to_node.send(world.now_us, BusFrame::from(coded));
        }
    }
    host.into_job().result()
}

const ACTIVATE: u8 = UpdateRequest::Activate.number();
const COMMIT: u8 = UpdateRequest::Commit { sequence: 0 }.number();

fn begin() -> (Request, u8) {
    (Request::Update(UpdateRequest::begin(500, 0)), 200)
}

#[test]
fn a_commit_of_which_the_answer_is_lost_is_no_failure_where_another_host_begins() {
    let mut world = World::new(Some(KEY), &[], 6);
    world.loses = |answer| answer.number == COMMIT && answer.outcome == Some(Outcome::Done);
    let updated = beside(&mut world, plan(NEW), None, begin()).expect("it is stored");
    assert_eq!((updated.sequence, world.newest()), (Some(1), NEW));
    // The other one's transfer is left alone.
    assert!(world.node.is_updating());
}

#[test]
fn what_is_stored_is_activated_once_another_host_is_done() {
    let mut world = World::new(Some(KEY), &[], 6);
    let activating = Plan {
        activates: true,
        ..plan(NEW)
    };
    let updated = beside(&mut world, activating, None, begin()).expect("it runs");
    assert_eq!((updated.sequence, updated.is_active), (Some(1), true));
    assert_eq!(world.node.resets(), 1);
}

#[test]
fn what_is_stored_and_not_activated_is_told_as_stored() {
    let on_the_word_of_another = Plan {
        activates: true,
        declares_servo_off: false,
        ..plan(NEW)
    };
    let off = |seconds| Request::ServoOff { seconds };
    let mut world = World::new(Some(KEY), &[], 6);
    let (before, then) = (Some(off(255)), (off(0), 4));
    let refused = beside(&mut world, on_the_word_of_another.clone(), before, then);
    assert_eq!(refused, Err(UpdateError::NotActivated { sequence: 1 }));
    // The answer is lost, and the declaration with the reset: the parameters run.
    let mut world = World::new(Some(KEY), &[], 6);
    world.loses = |answer| answer.number == ACTIVATE && answer.outcome == Some(Outcome::Done);
    let then = (off(255), 4);
    let updated = beside(&mut world, on_the_word_of_another, before, then).expect("it runs");
    assert_eq!((updated.sequence, updated.is_active), (Some(1), true));
}

#[test]
fn where_nobody_answers_after_the_commit_it_is_told_as_stored() {
    let mut world = World::new(Some(KEY), &[], 6);
    world.loses = |answer| answer.number == ACTIVATE;
    let activating = Plan {
        activates: true,
        ..plan(NEW)
    };
    let silent = Err(UpdateError::Silent { sequence: 1 });
    assert_eq!(world.update(activating), silent);
}

#[test]
fn after_an_update_that_waited_for_another_host_the_servo_is_on_again() {
    let mut world = World::new(Some(KEY), &[], 6);
    let mut other = Mailbox::default();
    for (request, token) in [(Request::ServoOff { seconds: 255 }, 3), begin()] {
        let told = Told::Command(Command::new(request, token));
        let coded = other.send(&told).expect("a known message");
        world.to_node.send(world.now_us, BusFrame::from(coded));
        (0..100).for_each(|_| drop(world.slot()));
    }
    assert!(world.node.is_updating());
    let updated = world.update(plan(NEW)).expect("it is stored");
    assert_eq!(updated.sequence, Some(1));
    let on = Plan {
        declares_servo_off: false,
        token: 50,
        ..back()
    };
    let refused = world.update(on);
    assert_eq!(refused, Err(UpdateError::ServoOn { declared: false }));
}

#[test]
fn parameters_that_fault_after_their_first_look_are_not_told_as_running() {
    let mut world = World::new(Some(KEY), &[], 6);
    let activating = Plan {
        activates: true,
        ..plan(NEW)
    };
    let mut host = Dialog::new(Updater::new(activating), 1);
    let mut faults_us = Vec::new();
    while !host.is_over() {
        for frame in world.slot() {
            host.take(&frame, world.now_us);
        }
        if world.node.resets() == 1 && faults_us.is_empty() {
            // Just before they count as proven, twice.
            faults_us = vec![world.now_us + 1_400_000, world.now_us + 2_800_000];
        }
        if faults_us
            .iter()
            .any(|at| world.now_us / SLOT_US == at / SLOT_US)
        {
            world.fault();
        }
        if let Some(coded) = host.poll(world.now_us) {
            world.to_node.send(world.now_us, BusFrame::from(coded));
        }
    }
    assert_eq!((world.node.resets(), world.newest()), (3, OLD));
    let (result, sequence) = (host.into_job().result(), 1);
    assert_eq!(result, Err(UpdateError::NotActive { sequence }));
}

#[test]
fn a_reset_at_any_moment_goes_back_once_or_not_at_all() {
    let (mut done, mut not) = (0, 0);
    for at_ms in (0..400).step_by(3) {
        let (mut world, third) = with_three(2);
        world.resets_us = vec![world.now_us + at_ms * 1_000];
        let result = world.update(back());
        let newest = world.newest().to_vec();
        match result {
            Ok(updated) => {
                done += 1;
                assert_eq!((updated.sequence, &newest[..]), (Some(3), NEW), "{at_ms}");
                assert_eq!(world.node.records(), 3, "{at_ms}");
            }
            Err(error) => {
                not += 1;
                assert_eq!(error, UpdateError::ServoOn { declared: true }, "{at_ms}");
                assert_eq!((&newest, world.node.records()), (&third, 2), "{at_ms}");
            }
        }
    }
    assert!(done > 10 && not > 10, "{done} {not}");
}

#[test]
fn a_recording_of_a_good_update_stores_nothing_when_it_is_played_again() {
    for key in [Some(KEY), None] {
        for pause_ms in [0, 10_000] {
            let mut world = World::new(key, &[], 21);
            world.update(plan(NEW)).expect("it is taken");
            let recording = world.recording.clone();
            assert!(recording.len() > 180);
            (0..pause_ms * 1_000 / SLOT_US).for_each(|_| drop(world.slot()));
            let mut frames = recording.iter().copied();
            let mut next_us = world.now_us;
            loop {
                if world.now_us >= next_us {
                    next_us = world.now_us + 1_000;
                    match frames.next() {
                        Some(frame) => world.to_node.send(world.now_us, frame),
                        None => break,
                    }
                }
                world.slot();
            }
            (0..10_000).for_each(|_| drop(world.slot()));
            assert_eq!(world.node.records(), 1);
            assert_eq!(world.newest(), NEW);
        }
    }
}
